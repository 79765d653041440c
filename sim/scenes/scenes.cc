#include "sim/scenes/scenes.h"

#include <algorithm>
#include <filesystem>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "base/status.h"
#include "sim/scenes/scene_file.h"
#include "sim/scenes/shipped.h"

namespace lightstage::sim {
namespace {

struct Entry {
  const char* name;
  const char* what;
  SceneDescription (*make)();
};

constexpr Entry kScenes[] = {
    {"default", "a still life of diffuse, glossy and finely self-shadowing things", &StillLife},
    {"car", "a toy race car: diffuse, glossy and finely self-shadowing", &Car},
    {"toys", "two soft toys, one of fur and one of terry cloth", &Toys},
    {"chess", "tall pieces on a wooden board, with long shadows", &Chess},
    {"materials", "dark wood, crumpled paper, scattering balls and stones on a board", &Materials},
    {"balls", "three balls on a plain board: diffuse, chrome, glass", &Balls},
    {"bowl", "a bright hollow that lights itself", &Bowl},
    {"calibration", "a bust between four white diffuse spheres", &Calibration},
    {"room", "a mirror ball in a furnished room", &Room},
};

}  // namespace

const std::vector<ShippedScene>& ShippedScenes() {
  static const auto* const kShipped = [] {
    auto* all = new std::vector<ShippedScene>;
    for (const Entry& entry : kScenes) all->push_back({entry.name, entry.what});
    return all;
  }();
  return *kShipped;
}

bool IsSceneName(const std::string& scene) {
  const auto& shipped = ShippedScenes();
  return scene.ends_with(".toml") ||
         std::any_of(shipped.begin(), shipped.end(),
                     [&](const ShippedScene& s) { return s.name == scene; });
}

absl::StatusOr<SceneDescription> LoadScene(const std::string& scene, const std::string& directory,
                                           Env& env) {
  if (scene.ends_with(".toml")) {
    return ReadSceneFile((std::filesystem::path(directory) / scene).string(), env);
  }
  std::vector<std::string> names;
  for (const Entry& entry : kScenes) {
    if (scene == entry.name) return entry.make();
    names.emplace_back(entry.name);
  }
  return Error(absl::StatusCode::kNotFound, "SCENE",
               absl::StrCat("there is no scene '", scene, "'; known: ", absl::StrJoin(names, ", "),
                            ", or a scene file that ends with .toml"),
               {{"scene", scene}});
}

}  // namespace lightstage::sim
