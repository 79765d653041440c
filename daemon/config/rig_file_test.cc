#include "daemon/config/rig_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/str_split.h"
#include "base/status.h"

namespace lightstage {
namespace {

using std::chrono::milliseconds;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

template <class Device>
Driver<Device> FakeDriver(bool on_virtual_time) {
  return {[](const TomlTable& table) -> DeviceOpener<Device> {
            double speed = table.Double("speed", 0, 10, 1);
            return
                [speed](const DeviceContext& context) -> absl::StatusOr<std::unique_ptr<Device>> {
                  return absl::UnknownError(absl::StrCat(context.name, " at ", speed));
                };
          },
          on_virtual_time};
}

DriverRegistry TestDrivers() {
  DriverRegistry drivers;
  drivers.cameras["fake"] = FakeDriver<Camera>(true);
  drivers.cameras["wire"] = FakeDriver<Camera>(false);
  drivers.axes["fake"] = FakeDriver<Axis>(true);
  drivers.lamps["fake"] = FakeDriver<Lamps>(true);
  drivers.projectors["fake"] = FakeDriver<Projector>(true);
  drivers.tables["simulation"] = [](const TomlTable& table) { table.Int("seed", 0, 1000, 1); };
  return drivers;
}

// Line numbers stand at the right for the tests below.
constexpr char kGood[] = R"([rig]
name = "test rig"
time = "fast"
[geometry.camera]
position_m = [1, 2.5, 3]
field_of_view_deg = 30
[geometry.brace]
radius_m = 1
lamp_radius_m = 0.02
semicircle = 40
[geometry.projector]
distance_m = 2
field_of_view_deg = 25
width = 1024
height = 768
[limits]
tilt_max_deg = 80
max_lamps_on = 20
[camera]
driver = "fake"
format = "RGB16"
width = 320
height = 240
exposures_us = [500, 4000, 32000]
[camera.options]
speed = 3
[turntable]
driver = "fake"
speed = 2.5
[tilt]
driver = "fake"
[lamps]
driver = "fake"
[projector]
driver = "fake"
[simulation]
seed = 7
[develop]
black_level = 64
[store]
compression = "zips"
[engine]
heartbeat_ms = 500
)";

absl::StatusOr<std::unique_ptr<RigFile>> Parse(std::string_view text) {
  return ParseRigFile(text, "rig.toml", TestDrivers());
}

// kGood with one passage replaced must be refused with exactly this one message.
void ExpectRefused(const std::string& passage, const std::string& by, const std::string& message) {
  std::string text = absl::StrReplaceAll(kGood, {{passage, by}});
  ASSERT_NE(text, kGood) << passage;
  absl::Status status = Parse(text).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(ErrorReason(status), "RIG_FILE_INVALID");
  EXPECT_EQ(std::string(status.message()), message);
}

TEST(RigFile, ReadsEverything) {
  auto parsed = Parse(kGood);
  ASSERT_TRUE(parsed.ok()) << parsed.status();
  const RigFile& rig = **parsed;
  EXPECT_EQ(rig.name, "test rig");
  EXPECT_EQ(rig.text, kGood);
  EXPECT_TRUE(rig.virtual_time);
  EXPECT_EQ(rig.geometry.camera.position, Vec3(1, 2.5, 3));
  EXPECT_EQ(rig.geometry.camera.look_at, Vec3(0, 0, 0));
  EXPECT_EQ(rig.geometry.brace.lamps.size(), 40u);
  EXPECT_TRUE(rig.geometry.projector.present);
  EXPECT_EQ(rig.geometry.projector.width, 1024);
  EXPECT_EQ(rig.limits.tilt_max, Degrees(80));
  EXPECT_EQ(rig.limits.azimuth_min, Degrees(-360));
  EXPECT_EQ(rig.limits.max_lamps_on, 20);
  EXPECT_EQ(rig.camera_options.config, (CameraConfig{PixelFormat::kRGB16, 320, 240, 0}));
  EXPECT_THAT(rig.camera_options.exposures,
              ElementsAre(std::chrono::microseconds(500), milliseconds(4), milliseconds(32)));
  EXPECT_EQ(rig.develop.black_level, 64);
  EXPECT_TRUE(rig.develop.response.is_linear());
  EXPECT_EQ(rig.store.compression, "zips");
  EXPECT_EQ(rig.engine.heartbeat, milliseconds(500));
  EXPECT_EQ(rig.camera.driver, "fake");
  EXPECT_TRUE(rig.turntable.present);
  DeviceContext context;
  context.name = "turntable";
  EXPECT_EQ(rig.turntable.open(context).status().message(), "turntable at 2.5");
  EXPECT_EQ(rig.camera.open(context).status().message(), "turntable at 3");
}

TEST(RigFile, NeedsLittle) {
  auto parsed = Parse(R"(
[rig]
name = "camera only"
[geometry.camera]
position_m = [0, -1, 1]
field_of_view_deg = 30
[camera]
driver = "wire"
format = "BayerRG8"
width = 1920
height = 1200
exposures_us = [1000]
)");
  ASSERT_TRUE(parsed.ok()) << parsed.status();
  const RigFile& rig = **parsed;
  EXPECT_FALSE(rig.virtual_time);
  EXPECT_FALSE(rig.turntable.present || rig.tilt.present || rig.lamps.present ||
               rig.projector.present);
  EXPECT_TRUE(rig.geometry.brace.lamps.empty());
  EXPECT_FALSE(rig.geometry.projector.present);
  EXPECT_EQ(rig.limits.max_lamps_on, 0);
  EXPECT_EQ(rig.develop.workers, DefaultWorkers());
  EXPECT_EQ(rig.engine.heartbeat, std::chrono::seconds(2));
}

TEST(RigFile, SemicircleIsCellCentredThroughTheZenith) {
  auto parsed = Parse(kGood);
  ASSERT_TRUE(parsed.ok());
  const auto& lamps = (*parsed)->geometry.brace.lamps;
  EXPECT_NEAR(lamps[0].azimuth.degrees(), 180, 1e-12);
  EXPECT_NEAR(lamps[0].tilt.degrees(), 87.75, 1e-12);
  EXPECT_NEAR(lamps[19].azimuth.degrees(), 180, 1e-12);
  EXPECT_NEAR(lamps[19].tilt.degrees(), 2.25, 1e-12);
  EXPECT_NEAR(lamps[20].azimuth.degrees(), 0, 1e-12);
  EXPECT_NEAR(lamps[20].tilt.degrees(), 2.25, 1e-12);
  EXPECT_NEAR(lamps[39].tilt.degrees(), 87.75, 1e-12);
}

TEST(RigFile, LampsByTiltsOrOneByOne) {
  auto by_tilts = Parse(
      absl::StrReplaceAll(kGood, {{"semicircle = 40", "azimuth_deg = 30\ntilts_deg = [-60, 0, 45]"},
                                  {"max_lamps_on = 20", ""}}));
  ASSERT_TRUE(by_tilts.ok()) << by_tilts.status();
  const auto& lamps = (*by_tilts)->geometry.brace.lamps;
  ASSERT_EQ(lamps.size(), 3u);
  EXPECT_EQ(lamps[0].azimuth, Degrees(210));
  EXPECT_EQ(lamps[0].tilt, Degrees(60));
  EXPECT_EQ(lamps[2].azimuth, Degrees(30));
  EXPECT_EQ((*by_tilts)->limits.max_lamps_on, 3);

  auto one_by_one = Parse(
      absl::StrReplaceAll(kGood, {{"semicircle = 40",
                                   "lamp = [{azimuth_deg = -10, tilt_deg = 20}, {azimuth_deg = 5, "
                                   "tilt_deg = 120}]"},
                                  {"max_lamps_on = 20", ""}}));
  ASSERT_TRUE(one_by_one.ok()) << one_by_one.status();
  ASSERT_EQ((*one_by_one)->geometry.brace.lamps.size(), 2u);
  EXPECT_EQ((*one_by_one)->geometry.brace.lamps[0].azimuth, Degrees(350));
  EXPECT_EQ((*one_by_one)->geometry.brace.lamps[1].tilt, Degrees(120));
}

TEST(RigFile, RefusesUnknownKeysAndTypes) {
  ExpectRefused("heartbeat_ms", "hartbeat_ms",
                "rig.toml:43:1: [engine] hartbeat_ms: unknown key; did you mean 'heartbeat_ms'?");
  ExpectRefused("[engine]", "[engines]",
                "rig.toml:42:2: engines: unknown key; did you mean 'engine'?");
  ExpectRefused("seed = 7", "sead = 7",
                "rig.toml:37:1: [simulation] sead: unknown key; did you mean 'seed'?");
  ExpectRefused("speed = 2.5", "sped = 2.5",
                "rig.toml:29:1: [turntable] sped: unknown key; did you mean 'speed'?");
  ExpectRefused("width = 320", "width = \"320\"",
                "rig.toml:22:1: [camera] width: is a string, must be an integer from 1 to 32768");
  ExpectRefused("tilt_max_deg = 80", "tilt_max_deg = 91",
                "rig.toml:17:1: [limits] tilt_max_deg: is 91, must be from 0 to 90");
  ExpectRefused("name = \"test rig\"\n", "", "rig.toml:1:1: [rig] name: missing; a string");
  ExpectRefused("time = \"fast\"", "time = \"warp\"",
                "rig.toml:3:1: [rig] time: is \"warp\", must be one of \"real\", \"fast\"");
}

TEST(RigFile, RefusesTablesOfFamiliesThatAreNotThere) {
  DriverRegistry drivers = TestDrivers();
  drivers.tables.clear();
  absl::Status status = ParseRigFile(kGood, "rig.toml", drivers).status();
  EXPECT_THAT(std::string(status.message()), HasSubstr("rig.toml:36:2: simulation: unknown key"));
}

TEST(RigFile, RefusesDrivers) {
  ExpectRefused("[tilt]\ndriver = \"fake\"", "[tilt]\ndriver = \"vendor\"\nsteps = 5",
                "rig.toml:31:1: [tilt] driver: there is no driver \"vendor\"; known: \"fake\"");
  ExpectRefused("[tilt]\ndriver = \"fake\"", "[tilt]",
                "rig.toml:30:1: [tilt] driver: missing; a string");
  ExpectRefused("[camera]\ndriver = \"fake\"", "[camera]\ndriver = \"wire\"",
                "rig.toml:20:1: [camera] driver: \"wire\" works in real time: [rig] time must be "
                "\"real\"");
}

TEST(RigFile, RefusesDevicesWithoutAPlace) {
  std::string brace = "[geometry.brace]\nradius_m = 1\nlamp_radius_m = 0.02\nsemicircle = 40\n";
  ExpectRefused("radius_m = 1\nlamp_radius_m = 0.02\nsemicircle = 40",
                "radius_m = 1\nlamp_radius_m = 0.02",
                "rig.toml:7:1: [geometry.brace]: has 0 of semicircle, tilts_deg and "
                "[[geometry.brace.lamp]]: exactly one must say where the lamps are");
  std::string text = absl::StrReplaceAll(kGood, {{brace, ""}, {"max_lamps_on = 20\n", ""}});
  EXPECT_EQ(Parse(text).status().message(),
            "rig.toml:27:2: lamps: needs [geometry.brace] with the place of every lamp");
  text = absl::StrReplaceAll(kGood, {{"[geometry.projector]\ndistance_m = 2\nfield_of_view_deg = "
                                      "25\nwidth = 1024\nheight = 768\n",
                                      ""}});
  EXPECT_EQ(Parse(text).status().message(), "rig.toml:29:2: projector: needs [geometry.projector]");
}

TEST(RigFile, RefusesLamps) {
  ExpectRefused("semicircle = 40", "semicircle = 40\ntilts_deg = [1]",
                "rig.toml:7:1: [geometry.brace]: has 2 of semicircle, tilts_deg and "
                "[[geometry.brace.lamp]]: exactly one must say where the lamps are");
  ExpectRefused("semicircle = 40\n", "tilts_deg = [10, 20, 10.005, 30]\n",
                "rig.toml:10:1: [geometry.brace] tilts_deg: lamp 2 (azimuth 0 deg, tilt 10.005 "
                "deg) stands where lamp 0 (azimuth 0 deg, tilt 10 deg) does: lamps must be at "
                "least 0.01 deg apart");
  // Two lamps in the zenith are in one place whatever their azimuths.
  std::string text = absl::StrReplaceAll(kGood, {{"semicircle = 40\n", R"([[geometry.brace.lamp]]
azimuth_deg = 0
tilt_deg = 0
[[geometry.brace.lamp]]
azimuth_deg = 90
tilt_deg = 0
)"},
                                                 {"max_lamps_on = 20\n", ""}});
  EXPECT_THAT(std::string(Parse(text).status().message()),
              HasSubstr("rig.toml:13:1: [geometry.brace.lamp[1]]: lamp 1 (azimuth 90 deg, tilt 0 "
                        "deg) stands where lamp 0"));
  ExpectRefused("lamp_radius_m = 0.02", "lamp_radius_m = 0.7",
                "rig.toml:9:1: [geometry.brace] lamp_radius_m: is 0.7, must be at most half of "
                "radius_m (1)");
  ExpectRefused("semicircle = 40", "semicircle = 0",
                "rig.toml:10:1: [geometry.brace] semicircle: is 0, must be an integer from 1 to "
                "1024");
}

TEST(RigFile, RefusesTheCamera) {
  ExpectRefused("position_m = [1, 2.5, 3]", "position_m = [1, 2.5]",
                "rig.toml:5:1: [geometry.camera] position_m: has 2 elements, must be an array of 3 "
                "numbers");
  ExpectRefused("position_m = [1, 2.5, 3]", "position_m = [0, 0, 0]",
                "rig.toml:5:1: [geometry.camera] position_m: is where look_at_m is; they must be "
                "at least 0.001 m apart");
  absl::Status format = Parse(absl::StrReplaceAll(kGood, {{"RGB16", "RGB12"}})).status();
  EXPECT_THAT(std::string(format.message()),
              HasSubstr("rig.toml:21:1: [camera] format: unknown pixel format 'RGB12'; known: "
                        "Mono8, "));
  ExpectRefused("[500, 4000, 32000]", "[500, 32000, 4000]",
                "rig.toml:24:1: [camera] exposures_us: element 2 is not above the one before it; "
                "exposures must ascend");
  ExpectRefused("[500, 4000, 32000]", "[]",
                "rig.toml:24:1: [camera] exposures_us: has 0 elements, must have 1 to 16 ([limits] "
                "max_exposures_per_shot)");
  ExpectRefused("[500, 4000, 32000]", "[500, 70e6]",
                "rig.toml:24:1: [camera] exposures_us: element 1 is above [limits] max_exposure_ms "
                "= 60000");
  ExpectRefused("exposures_us = [500, 4000, 32000]\n", "",
                "rig.toml:19:1: [camera] exposures_us: missing; an array of numbers");
}

TEST(RigFile, RefusesContradictions) {
  ExpectRefused("tilt_max_deg = 80", "tilt_max_deg = 20\ntilt_min_deg = 30",
                "rig.toml:18:1: [limits] tilt_min_deg: is 30, above the maximum 20");
  ExpectRefused("black_level = 64", "saturation = 0.1\nnoise_floor = 0.2",
                "rig.toml:40:1: [develop] noise_floor: is 0.2, must be below saturation (0.1)");
  ExpectRefused("black_level = 64", "response_table = [0, 1]",
                "rig.toml:39:1: [develop] response_table: is only read if response = \"table\"");
  ExpectRefused("black_level = 64", "response = \"table\"",
                "rig.toml:38:1: [develop] response_table: missing; an array of numbers");
}

TEST(RigFile, DevelopMustFitTheCamerasCodes) {
  auto refused = [](const std::string& develop) {
    return std::string(
        Parse(absl::StrReplaceAll(kGood, {{"RGB16", "Mono8"}, {"black_level = 64", develop}}))
            .status()
            .message());
  };
  EXPECT_THAT(refused("black_level = 250"),
              HasSubstr("rig.toml:39:1: [develop] black_level: is 250, must be below saturation "
                        "(0.98 of 255)"));
  EXPECT_THAT(refused("response = \"table\"\nresponse_table = [0, 1, 2, 3]"),
              HasSubstr("response_table: has 4 entries, Mono8 has 256 codes"));
}

TEST(RigFile, ReadsAResponseTable) {
  std::string table = "response = \"table\"\nresponse_table = [-5";
  for (int i = 1; i < 256; ++i) absl::StrAppend(&table, ", ", -5 + i * 0.02);
  table += "]";
  auto parsed = Parse(absl::StrReplaceAll(kGood, {{"black_level = 64", table}}));
  ASSERT_TRUE(parsed.ok()) << parsed.status();
  EXPECT_EQ((*parsed)->develop.response.levels(), 256);
  table = absl::StrReplaceAll(table, {{"[-5,", "[5,"}});
  absl::Status falling = Parse(absl::StrReplaceAll(kGood, {{"black_level = 64", table}})).status();
  EXPECT_THAT(std::string(falling.message()),
              HasSubstr("rig.toml:40:1: [develop] response_table: response table falls from 5"));
}

TEST(RigFile, NamesEveryMistakeAtOnce) {
  absl::Status status = Parse("[rig]\ntime = 3\n[camera]\n").status();
  std::vector<std::string> lines = absl::StrSplit(std::string(status.message()), '\n');
  EXPECT_GE(lines.size(), 6u);
  EXPECT_THAT(std::string(status.message()), HasSubstr("table [geometry] is missing"));
  EXPECT_THAT(std::string(status.message()), Not(HasSubstr("geometry.camera")));
}

}  // namespace
}  // namespace lightstage
