// Captures to the end: what is on disk, and that the pictures show what was commanded.
#include <cmath>
#include <cstdlib>
#include <map>
#include <set>
#include <sstream>

#include "dataset/basis_exr.h"
#include "dataset/exr.h"
#include "dataset/sha256.h"
#include "gtest/gtest.h"
#include "tests/harness/daemon.h"

namespace lightstage {
namespace {

namespace fs = std::filesystem;

Json ReadManifestJson(const fs::path& run) {
  Json manifest = Json::parse(ReadText(run / "manifest.json"), nullptr, false);
  EXPECT_TRUE(manifest.is_object());
  return manifest;
}

DecodedBasis Read(const fs::path& path) {
  auto decoded = ReadBasisExr(path.string());
  EXPECT_TRUE(decoded.ok()) << decoded.status();
  return decoded.ok() ? *std::move(decoded) : DecodedBasis{BasisImage{Image(1, 1, 3), {0}}, {}};
}

double Sum(const Image& image) {
  double sum = 0;
  for (float value : image.pixels()) sum += value;
  return sum;
}

// All files below a folder by their relative path.
std::map<std::string, std::string> Files(const fs::path& folder) {
  std::map<std::string, std::string> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file())
      files[fs::relative(entry.path(), folder).string()] = ReadText(entry.path());
  }
  return files;
}

TEST(Capture, EveryShotIsThereAsTheManifestSays) {
  TestFolder folder;
  Daemon daemon(folder, SmallRig());
  Answer capture =
      daemon.Ctl({"capture", "light-stage", "--azimuths", "4", "--lamps", "10-15", "--dark-every",
                  "6", "--reference-every", "12", "--name", "first light"});
  ASSERT_EQ(capture.code, 0) << capture.err;
  const Json& last = capture.json()["run"];
  EXPECT_EQ(last["state"], "RUN_STATE_SUCCEEDED");
  EXPECT_EQ(last["displayName"], "first light");
  EXPECT_EQ(last["doneShots"], 32);
  EXPECT_TRUE(last.contains("endTime"));
  EXPECT_TRUE(fs::path(last["directory"].get<std::string>()).is_absolute()) << last["directory"];

  fs::path run = daemon.RunFolder(last["name"]);
  Json manifest = ReadManifestJson(run);
  std::map<std::string, int> kinds;
  std::set<int> ids;
  std::set<std::string> files;
  for (const Json& shot : manifest["shots"]) {
    ++kinds[shot["kind"]];
    ids.insert(shot["shot"].get<int>());
    std::string file = shot["file"];
    files.insert(file);
    std::string bytes = ReadText(run / file);
    EXPECT_EQ(shot["bytes"], bytes.size());
    EXPECT_EQ(shot["sha256"], Sha256Hex(bytes));
    EXPECT_EQ(file.rfind(shot["kind"].get<std::string>() + "/", 0), 0u) << file;
  }
  EXPECT_EQ(kinds, (std::map<std::string, int>{{"basis", 24}, {"dark", 5}, {"reference", 3}}));
  EXPECT_EQ(ids.size(), 32u);
  EXPECT_EQ(*ids.rbegin(), 31);
  EXPECT_EQ(files.size(), 32u);

  // No image file beside them.
  int exrs = 0;
  for (const auto& [name, bytes] : Files(run)) {
    exrs += name.ends_with(".exr");
    EXPECT_FALSE(name.ends_with(".tmp")) << name;
  }
  EXPECT_EQ(exrs, 32);

  Answer verify = daemon.Ctl({"runs", "verify", "latest"});
  EXPECT_EQ(verify.code, 0);
  EXPECT_TRUE(Problems(verify).empty());
  EXPECT_GE(verify.json()["checkedFiles"].get<int>(), 33);
  EXPECT_EQ(verify.json()["checkedFiles"], verify.json()["totalFiles"]);
  EXPECT_FALSE(Lit(daemon.State()));
  EXPECT_EQ(daemon.State()["activity"], "RIG_ACTIVITY_IDLE");
}

// The direction towards lamp i of 40 on the half circle, in the frame of an object turned by `azimuth`.
void ExpectDirection(const Json& shot, int lamp, double azimuth_deg) {
  constexpr double kDegree = M_PI / 180;
  double tilt = (-90 + 180.0 / 40 * (lamp + 0.5)) * kDegree;  // negative: opposite to azimuth 0
  double x = std::sin(tilt), z = std::cos(tilt), turn = -azimuth_deg * kDegree;
  const Json& d = shot["direction"];
  EXPECT_NEAR(d[0].get<double>(), x * std::cos(turn), 1e-9) << shot;
  EXPECT_NEAR(d[1].get<double>(), x * std::sin(turn), 1e-9) << shot;
  EXPECT_NEAR(d[2].get<double>(), z, 1e-9) << shot;
}

TEST(Capture, WholeLightStageHasItsLightPositionsInFilesOfAThousand) {
  TestFolder folder;
  Daemon daemon(folder, SmallRig());
  std::string run_name = daemon.Capture({"light-stage", "--exposures-us", "4000"});
  fs::path run = daemon.RunFolder(run_name);
  Json manifest = ReadManifestJson(run);
  ASSERT_EQ(manifest["shots"].size(), 1280u);
  for (int i : {0, 39, 40, 777, 1279})
    ExpectDirection(manifest["shots"][i], i % 40, i / 40 * 5.625);

  std::vector<std::string> names;
  for (auto [file, count] : {std::pair("lights_000.lp", 1000), std::pair("lights_001.lp", 280)}) {
    std::istringstream lines(ReadText(run / file));
    int told = 0;
    lines >> told;
    EXPECT_EQ(told, count);
    std::string name;
    double x, y, z;
    int lights = 0;
    while (lines >> name >> x >> y >> z) {
      ++lights;
      EXPECT_NEAR(x * x + y * y + z * z, 1, 1e-5) << name;
      EXPECT_TRUE(fs::exists(run / name)) << name;
      names.push_back(name);
    }
    EXPECT_EQ(lights, count);
    EXPECT_EQ(ReadText(run / file).find(" \n"), std::string::npos) << "trailing space";
  }
  EXPECT_FALSE(fs::exists(run / "lights_002.lp"));
  EXPECT_EQ(std::set<std::string>(names.begin(), names.end()).size(), 1280u);
  EXPECT_TRUE(std::is_sorted(names.begin(), names.end())) << "readers pair images by sorted order";
  EXPECT_EQ(daemon.Ctl({"runs", "verify", run_name}).code, 0);
}

TEST(Capture, LightAddsUpAndDarkIsDark) {
  TestFolder folder;
  Daemon daemon(folder, WithoutNoise(SmallRig()));
  std::string name =
      daemon.Capture({"light-stage", "--azimuths", "0.0,70.0", "--lamps", "8,14,20,26,31",
                      "--dark-every", "5", "--reference-every", "5", "--exposures-us", "250,4000"});
  fs::path run = daemon.RunFolder(name);
  Json manifest = ReadManifestJson(run);
  // One position's basis images stand between two reference frames; the second is of the same pose.
  for (double azimuth : {0.0, 70.0}) {
    Image sum(64, 48, 3);
    std::vector<bool> measured(64 * 48, true);
    Image reference;
    int basis = 0;
    for (const Json& shot : manifest["shots"]) {
      if (std::abs(shot["commanded"]["azimuth_deg"].get<double>() - azimuth) > 1e-6) continue;
      DecodedBasis image = Read(run / shot["file"].get<std::string>());
      if (shot["kind"] == "dark") {
        EXPECT_LT(Sum(image.image.pixels), 1e-3) << shot["file"];
        continue;
      }
      for (size_t i = 0; i < measured.size(); ++i)
        if (image.image.flags[i] & kAboveRange) measured[i] = false;
      if (shot["kind"] == "reference") {
        reference = image.image.pixels;
        continue;
      }
      ++basis;
      for (size_t i = 0; i < sum.pixels().size(); ++i)
        sum.pixels()[i] += image.image.pixels.pixels()[i];
    }
    ASSERT_EQ(basis, 5);
    ASSERT_FALSE(reference.empty());
    double error = 0, total = 0;
    int pixels = 0;
    for (size_t i = 0; i < measured.size(); ++i) {
      if (!measured[i]) continue;
      ++pixels;
      for (int c = 0; c < 3; ++c) {
        error += std::abs(sum.pixels()[3 * i + c] - reference.pixels()[3 * i + c]);
        total += reference.pixels()[3 * i + c];
      }
    }
    EXPECT_GT(pixels, 1500) << "too much is saturated to tell";
    EXPECT_GT(total, 0);
    // What 12 bits, halves and blacks that no exposure sees leave.
    EXPECT_LT(error / total, 0.02) << "azimuth " << azimuth;
  }
}

TEST(Capture, Projector4dShootsEveryPatternAtEveryPosition) {
  TestFolder folder;
  Daemon daemon(folder, SmallRig());
  std::string name = daemon.Capture({"projector-4d", "--tilts", "2", "--azimuths", "2", "--grid",
                                     "8", "--influence", "1", "--dark-every", "64"});
  fs::path run = daemon.RunFolder(name);
  Json manifest = ReadManifestJson(run);
  std::map<std::string, int> per_position;
  std::set<std::string> conditions;
  for (const Json& shot : manifest["shots"]) {
    if (shot["kind"] != "basis") continue;
    ++per_position[shot["commanded"].dump()];
    conditions.insert(shot["commanded"].dump() + shot["condition"].dump());
  }
  ASSERT_EQ(per_position.size(), 4u);
  for (const auto& [pose, shots] : per_position) EXPECT_EQ(shots, 2 * 8 * 2) << pose;
  EXPECT_EQ(conditions.size(), 4u * 2 * 8 * 2) << "a pattern was shot twice";
  EXPECT_EQ(manifest["shots"].size(), 128u + 1 + 2);
  EXPECT_EQ(daemon.Ctl({"runs", "verify", name}).code, 0);
}

// Masselus 2004, section 4.5: the image of a square is the per-pixel minimum of the two pictures that hold it.
TEST(Capture, TheSpeedupsMinimumIsTheSquaresPicture) {
  TestFolder folder;
  Daemon daemon(folder, WithoutNoise(SmallRig()));
  const std::vector<std::string> position = {"projector-4d", "--tilts", "40.0", "--azimuths",
                                             "20.0",         "--grid",  "8",    "--exposures-us",
                                             "250,4000"};
  auto with = [&](std::initializer_list<std::string> more) {
    std::vector<std::string> plan = position;
    plan.insert(plan.end(), more);
    return daemon.RunFolder(daemon.Capture(plan));
  };
  auto pattern_of = [](const Json& shot) { return shot["condition"]["pattern"]; };
  fs::path full = with({"--full"}), fast = with({"--influence", "1"});
  Json squares = ReadManifestJson(full), sets = ReadManifestJson(fast);
  ASSERT_EQ(squares["shots"].size(), 64u);
  ASSERT_EQ(sets["shots"].size(), 32u);

  std::map<std::tuple<std::string, int, int>, DecodedBasis> fast_images;
  for (const Json& shot : sets["shots"]) {
    Json p = pattern_of(shot);
    fast_images[{p["arrangement"], p["column"], p["row"]}] =
        Read(fast / shot["file"].get<std::string>());
  }
  double error = 0, total = 0;
  int bright_squares = 0;
  for (const Json& shot : squares["shots"]) {
    Json p = pattern_of(shot);
    int column = p["column"], row = p["row"];
    DecodedBasis square = Read(full / shot["file"].get<std::string>());
    auto h = fast_images.find({"horizontal", column % 2, row});
    auto v = fast_images.find({"vertical", column, row % 2});
    ASSERT_TRUE(h != fast_images.end() && v != fast_images.end()) << p;
    auto truth = square.image.pixels.pixels();
    auto rows = h->second.image.pixels.pixels(), columns = v->second.image.pixels.pixels();
    double light = 0;
    for (size_t i = 0; i < truth.size(); ++i) {
      if ((square.image.flags[i / 3] | h->second.image.flags[i / 3] |
           v->second.image.flags[i / 3]) &
          kAboveRange)
        continue;
      error += std::abs(std::min(rows[i], columns[i]) - truth[i]);
      light += truth[i];
    }
    total += light;
    bright_squares += light > 0;
  }
  EXPECT_GT(bright_squares, 8) << "the projector lights nothing that the camera sees";
  EXPECT_LT(error / total, 0.01);
}

TEST(Capture, FetchCopiesTheRunAndGoesOnWhereItWas) {
  TestFolder folder;
  Daemon daemon(folder, SmallRig());
  std::string name = daemon.Capture({"light-stage", "--azimuths", "3", "--lamps", "0-3"});
  std::string copy = folder / "copy";
  Answer fetch = daemon.Ctl({"runs", "fetch", name, copy});
  ASSERT_EQ(fetch.code, 0) << fetch.err;
  auto source = Files(daemon.RunFolder(name));
  EXPECT_EQ(Files(copy), source);
  EXPECT_EQ(fetch.lines.size(), source.size());

  // One file gone, one cut short, one changed: these come anew, the others stay as they are.
  auto written = fs::last_write_time(fs::path(copy) / "basis/000005.exr");
  fs::remove(fs::path(copy) / "basis/000000.exr");
  WriteText(fs::path(copy) / "basis/000001.exr", source["basis/000001.exr"].substr(0, 100));
  std::string changed = source["basis/000002.exr"];
  changed[changed.size() / 2] ^= 1;
  WriteText(fs::path(copy) / "basis/000002.exr", changed);
  SleepFor(Milliseconds(20));
  ASSERT_EQ(daemon.Ctl({"runs", "fetch", name, copy}).code, 0);
  EXPECT_EQ(Files(copy), source);
  EXPECT_EQ(fs::last_write_time(fs::path(copy) / "basis/000005.exr"), written);
}

TEST(Capture, VerifyAndFetchFindAFlippedBit) {
  TestFolder folder;
  Daemon daemon(folder, SmallRig());
  std::string name = daemon.Capture({"light-stage", "--azimuths", "3", "--lamps", "0-3"});
  fs::path victim = daemon.RunFolder(name) / "basis/000007.exr";
  const std::string good = ReadText(victim);
  for (size_t at : {size_t{0}, good.size() / 2, good.size() - 1}) {
    std::string bad = good;
    bad[at] ^= 0x10;
    WriteText(victim, bad);
    Answer verify = daemon.Ctl({"runs", "verify", name});
    EXPECT_EQ(verify.code, 5) << verify.err;
    EXPECT_EQ(Problems(verify),
              (std::map<std::string, std::string>{{"basis/000007.exr", "FILE_CHECKSUM"}}));
  }
  Answer fetch = daemon.Ctl({"runs", "fetch", name, folder / "copy"});
  EXPECT_EQ(fetch.code, 5);
  EXPECT_NE(fetch.err.find("basis/000007.exr"), std::string::npos) << fetch.err;
  EXPECT_FALSE(fs::exists(folder / "copy/basis/000007.exr")) << "a damaged file was kept";
  EXPECT_TRUE(fs::exists(folder / "copy/basis/000008.exr"));
  // Mended, everything is good again, without the daemon being told.
  WriteText(victim, good);
  EXPECT_EQ(daemon.Ctl({"runs", "verify", name}).code, 0);
  EXPECT_EQ(daemon.Ctl({"runs", "fetch", name, folder / "copy"}).code, 0);
}

TEST(Capture, RelightMakesPicturesOfIt) {
  TestFolder folder;
  Daemon daemon(folder, SmallRig());
  std::string name = daemon.Capture({"light-stage", "--azimuths", "6", "--lamps", "0-39"});
  std::string run = daemon.RunFolder(name).string();
  auto relit = [&](float radiance, const std::string& out) {
    Image map(32, 16, 3, radiance);
    std::string environment = folder / "map.exr";
    EXPECT_TRUE(WriteExr(environment, map, ExrPixelType::kFloat).ok());
    Process relight({RelightProgram(), "env", run, "--environment", environment, "--out",
                     folder / (out + ".exr"), "--png", folder / (out + ".png")},
                    folder / "relight");
    EXPECT_EQ(relight.Wait(), 0) << relight.err();
    auto picture = ReadExr(folder / (out + ".exr"));
    EXPECT_TRUE(picture.ok()) << picture.status();
    EXPECT_GT(fs::file_size(folder / (out + ".png")), 100u);
    return picture.ok() ? *picture : Image();
  };
  Image one = relit(1, "one"), two = relit(2, "two");
  ASSERT_EQ(one.width(), 64);
  ASSERT_EQ(one.height(), 48);
  EXPECT_GT(Sum(one), 0);
  EXPECT_NEAR(Sum(two) / Sum(one), 2, 1e-4);  // light adds
  Process sheet({RelightProgram(), "contact-sheet", run, "--out", folder / "sheet.png"},
                folder / "sheet");
  EXPECT_EQ(sheet.Wait(), 0) << sheet.err();
  EXPECT_GT(fs::file_size(folder / "sheet.png"), 1000u);
}

}  // namespace
}  // namespace lightstage
