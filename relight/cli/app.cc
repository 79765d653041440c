#include "relight/cli/app.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "absl/strings/numbers.h"
#include "absl/strings/str_format.h"
#include "base/status.h"
#include "base/version.h"
#include "dataset/exr.h"
#include "optics/environment_map.h"
#include "relight/contact_sheet.h"
#include "relight/dataset_reader.h"
#include "relight/environment.h"
#include "relight/png.h"
#include "relight/studio_map.h"

namespace lightstage::relight {
namespace {

using Json = nlohmann::ordered_json;

// Light farther than this from every lamp is a sign that the capture does not surround the object.
constexpr double kFarDegrees = 20;

constexpr char kFooter[] = R"(
DATASET is the folder of a finished run (it holds manifest.json).
MAP is a latitude-longitude OpenEXR picture of the whole sphere: top row above, azimuth 0 (the
object's +X) in the middle, azimuth growing to the left, as seen from inside.
With --format json standard output is one JSON object.

Exit codes: 0 done, 1 failed, 2 the command line cannot be read)";

struct Flags {
  std::string format = "text";
  std::string dataset, environment, out, png, scene = "studio";
  double rotate_deg = 0;
  int width = 512;
};

// What a command did: for people, for programs, and what they should be warned of.
struct Answer {
  std::string text;
  Json json;
  std::vector<std::string> warnings;
};

Json Rgb(const Radiance& r) { return {r[0], r[1], r[2]}; }

// The greatest channel's share of `part` in part + rest.
double Share(const Radiance& part, const Radiance& rest) {
  double share = 0;
  for (int c = 0; c < 3; ++c) {
    const double whole = part[c] + rest[c];
    if (whole > 0) share = std::max(share, part[c] / whole);
  }
  return share;
}

absl::StatusOr<Answer> Env(const Flags& flags) {
  ASSIGN_OR_RETURN(Image picture, ReadExr(flags.environment));
  if (picture.width() != 2 * picture.height()) {
    return Error(absl::StatusCode::kInvalidArgument, "ENVIRONMENT_INVALID",
                 absl::StrFormat("%s: a picture of %d×%d; a latitude-longitude map of the whole "
                                 "sphere is twice as wide as high",
                                 flags.environment, picture.width(), picture.height()));
  }
  absl::StatusOr<EnvironmentMap> map = EnvironmentMap::FromImage(std::move(picture));
  if (!map.ok()) return Annotate(map.status(), flags.environment);
  ASSIGN_OR_RETURN(const Dataset dataset, Dataset::Open(flags.dataset));
  ASSIGN_OR_RETURN(Relit relit, RelightWithEnvironment(dataset, *map, Degrees(flags.rotate_deg)));
  RETURN_IF_ERROR(WriteExr(flags.out, relit.image, ExrPixelType::kFloat));
  const Cells& cells = relit.cells;
  const double left_out = Share(cells.left_out, cells.covered);

  Answer answer;
  answer.json = {{"output", flags.out},
                 {"width", relit.image.width()},
                 {"height", relit.image.height()},
                 {"images", relit.images_used},
                 {"imagesWithoutDirection", relit.images_skipped},
                 {"environment", flags.environment},
                 {"rotateDeg", flags.rotate_deg},
                 {"coverage", cells.upper_hemisphere_only ? "upperHemisphere" : "sphere"},
                 {"irradianceCovered", Rgb(cells.covered)},
                 {"irradianceLeftOut", Rgb(cells.left_out)},
                 {"leftOutShare", left_out},
                 {"farthestLampDeg", cells.farthest.degrees()},
                 {"aboveRangeShare", relit.above_range_share}};
  answer.text = absl::StrFormat("%s: %d×%d from %d basis images\n", flags.out, relit.image.width(),
                                relit.image.height(), relit.images_used);
  if (cells.upper_hemisphere_only) {
    absl::StrAppendFormat(&answer.text,
                          "no lamp lies below the horizon: %.1f %% of the map's light comes from "
                          "there and is left out\n",
                          100 * left_out);
  }
  if (!flags.png.empty()) {
    const double exposure = AutoExposure(relit.image);
    RETURN_IF_ERROR(WritePng(flags.png, relit.image, exposure));
    answer.json["png"] = flags.png;
    answer.json["pngExposure"] = exposure;
    absl::StrAppendFormat(&answer.text, "%s: exposure %.4g\n", flags.png, exposure);
  }
  if (relit.images_skipped > 0) {
    answer.warnings.push_back(
        absl::StrCat(relit.images_skipped, " basis images have no light direction: not used"));
  }
  if (cells.farthest.degrees() > kFarDegrees) {
    answer.warnings.push_back(absl::StrFormat(
        "some of the map's light is %.0f° from the nearest lamp, which stands for it: the capture "
        "does not surround the object",
        cells.farthest.degrees()));
  }
  if (relit.above_range_share > 0) {
    answer.warnings.push_back(absl::StrFormat(
        "%.2f %% of the pixels were beyond the camera's range in some basis image: too dark here",
        100 * relit.above_range_share));
  }
  return answer;
}

absl::StatusOr<Answer> ContactSheet(const Flags& flags) {
  ASSIGN_OR_RETURN(const Dataset dataset, Dataset::Open(flags.dataset));
  const SheetLayout layout = LayOut(dataset.basis());
  ASSIGN_OR_RETURN(Image sheet, MakeContactSheet(dataset, layout));
  const double exposure = AutoExposure(sheet);
  RETURN_IF_ERROR(WritePng(flags.out, sheet, exposure));
  Answer answer;
  answer.json = {{"output", flags.out},
                 {"columns", layout.columns},
                 {"rows", layout.rows},
                 {"imagesShown", layout.images.size()},
                 {"images", dataset.basis().size()},
                 {"regular", layout.regular},
                 {"width", sheet.width()},
                 {"height", sheet.height()},
                 {"pngExposure", exposure}};
  answer.text =
      absl::StrFormat("%s: %d×%d, %d of %d basis images%s\n", flags.out, layout.columns,
                      layout.rows, layout.images.size(), dataset.basis().size(),
                      layout.regular ? "; columns azimuth, rows tilt from the zenith down" : "");
  return answer;
}

absl::StatusOr<Answer> MakeEnvironment(const Flags& flags) {
  const Image map = StudioMap(flags.width);
  RETURN_IF_ERROR(WriteExr(flags.out, map, ExrPixelType::kHalf));
  Answer answer;
  answer.json = {{"output", flags.out},
                 {"scene", flags.scene},
                 {"width", map.width()},
                 {"height", map.height()}};
  answer.text =
      absl::StrFormat("%s: %s, %d×%d\n", flags.out, flags.scene, map.width(), map.height());
  return answer;
}

// Adds the commands; each one's callback leaves its answer in `answer`.
void Declare(CLI::App& app, Flags& flags, absl::StatusOr<Answer>& answer) {
  app.require_subcommand(1);
  app.fallthrough();
  app.footer(kFooter);
  app.set_version_flag("--version", std::string("relight ") + kVersion);
  app.add_option("--format", flags.format, "text or json")
      ->check(CLI::IsMember({"text", "json"}))
      ->capture_default_str();

  CLI::App* env = app.add_subcommand("env", "Relight a dataset with an environment map");
  env->add_option("DATASET", flags.dataset, "Folder of a finished run")->required();
  env->add_option("--environment", flags.environment, "Environment map (OpenEXR)")->required();
  env->add_option("--out", flags.out, "Relit picture (OpenEXR, linear float)")->required();
  env->add_option("--png", flags.png, "The same for looking at, exposed automatically");
  env->add_option("--rotate", flags.rotate_deg,
                  "Turn the map about the vertical, degrees, counterclockwise from above")
      ->check([](const std::string& text) {
        double degrees = 0;  // not CLI::Range, which lets NaN pass
        const bool right = absl::SimpleAtod(text, &degrees) && std::abs(degrees) <= 360;
        return right ? std::string()
                     : absl::StrCat("'", text, "' is not an angle from -360 to 360");
      });
  env->callback([&] { answer = Env(flags); });

  CLI::App* sheet = app.add_subcommand("contact-sheet", "Basis images by light direction");
  sheet->add_option("DATASET", flags.dataset, "Folder of a finished run")->required();
  sheet->add_option("--out", flags.out, "The sheet (PNG)")->required();
  sheet->callback([&] { answer = ContactSheet(flags); });

  CLI::App* make = app.add_subcommand("make-environment", "Write an environment map to try with");
  make->add_option("SCENE", flags.scene, "studio: a window, a warm lamp and a blue strip")
      ->check(CLI::IsMember({"studio"}))
      ->capture_default_str();
  make->add_option("--out", flags.out, "The map (OpenEXR)")->required();
  make->add_option("--width", flags.width, "Texels around; half as many high")
      ->check(CLI::Range(16, 8192))
      ->capture_default_str();
  make->callback([&] { answer = MakeEnvironment(flags); });
}

}  // namespace

int RunApp(const std::vector<std::string>& arguments, std::ostream& out, std::ostream& err) {
  CLI::App app("Relights captured objects: sums of basis images under new light", "relight");
  Flags flags;
  absl::StatusOr<Answer> answer = absl::UnknownError("no command ran");
  Declare(app, flags, answer);
  try {
    app.parse(std::vector<std::string>(arguments.rbegin(), arguments.rend()));  // last one first
  } catch (const CLI::ParseError& e) {
    return app.exit(e, out, err) == 0 ? 0 : 2;
  }
  if (!answer.ok()) {
    err << "relight: " << answer.status().message() << "\n";
    return 1;
  }
  for (const std::string& warning : answer->warnings)
    err << "relight: warning: " << warning << "\n";
  if (flags.format == "json") {
    if (!answer->warnings.empty()) answer->json["warnings"] = answer->warnings;
    out << answer->json.dump() << "\n";
  } else {
    out << answer->text;
  }
  out.flush();
  if (!out) {
    err << "relight: cannot write to standard output\n";
    return 1;
  }
  return 0;
}

}  // namespace lightstage::relight
