#include "sim/rig/world_scene.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "base/status.h"
#include "sim/render/rig_parts.h"
#include "sim/scenes/scenes.h"

namespace lightstage::sim {

absl::StatusOr<Scene> MakeWorldScene(const WorldOptions& options, const RigGeometry& geometry) {
  const auto lamps = static_cast<int>(geometry.brace.lamps.size());
  if (!options.lamps.dim.empty() && options.lamps.dim.rbegin()->first >= lamps) {
    return Error(absl::StatusCode::kInvalidArgument, "LAMP_UNKNOWN",
                 absl::StrCat("[[simulation.lamps.dim]] lamp ", options.lamps.dim.rbegin()->first,
                              " does not exist: this rig has ", lamps, " lamps"));
  }
  ASSIGN_OR_RETURN(SceneDescription description, LoadScene(options.scene, options.scene_directory));
  for (Mesh& mesh : CameraBody(geometry.camera, options.parts)) {
    mesh.material = static_cast<int>(description.materials.size());
    description.meshes.push_back(std::move(mesh));
  }
  description.materials.emplace_back();  // black
  absl::StatusOr<Scene> scene = Scene::Build(std::move(description));
  if (!scene.ok()) return Annotate(scene.status(), options.scene);
  const Vec3f camera = geometry.camera.position.cast<float>();
  if (absl::Status outside = scene->CheckOutside(camera, "the camera"); !outside.ok())
    return Annotate(outside, options.scene);
  return scene;
}

LensOptions LensOf(const ProjectorOptics& optics, const ProjectorGeometry& projector) {
  return {Meters(optics.lens_radius_m),
          optics.focus_m > 0 ? Meters(optics.focus_m) : projector.distance};
}

}  // namespace lightstage::sim
