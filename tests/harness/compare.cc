#include "tests/harness/compare.h"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <vector>

#include "dataset/basis_exr.h"
#include "gtest/gtest.h"

namespace lightstage {

namespace {

int Images(const std::filesystem::path& run) {
  int count = 0;
  for (const auto& file : std::filesystem::directory_iterator(run / "basis")) {
    count += file.path().extension() == ".exr";
  }
  return count;
}

}  // namespace

std::filesystem::path DirectRun(const TestFolder& folder, const std::string& rig,
                                const std::vector<std::string>& plan) {
  std::string key = rig;
  for (const std::string& word : plan) key += " " + word;
  const char* outside = std::getenv("LIGHTSTAGE_DIRECT_RUNS");
  const std::filesystem::path data =
      (outside != nullptr ? std::filesystem::path(outside) : folder.path()) /
      std::to_string(std::hash<std::string>()(key));
  if (!std::filesystem::exists(data)) Daemon(folder, rig, {.data = data}).Capture(plan);
  for (const auto& entry : std::filesystem::recursive_directory_iterator(data)) {
    if (entry.path().filename() == "basis") return entry.path().parent_path();
  }
  ADD_FAILURE() << "no run in " << data;
  return data;
}

BasisComparison CompareBasis(const std::filesystem::path& a, const std::filesystem::path& b,
                             int bits, double exposure_s) {
  BasisComparison result;
  const int shots = Images(a);
  EXPECT_EQ(Images(b), shots);
  int lit = 0;
  for (int shot = 0; shot < shots; ++shot) {
    char name[32];
    std::snprintf(name, sizeof name, "basis/%06d.exr", shot);
    const auto one = ReadBasisExr((a / name).string());
    const auto two = ReadBasisExr((b / name).string());
    EXPECT_TRUE(one.ok()) << one.status();
    EXPECT_TRUE(two.ok()) << two.status();
    if (!one.ok() || !two.ok()) return result;
    const Image &x = one->image.pixels, &y = two->image.pixels;
    EXPECT_TRUE(x.SameShape(y)) << name;
    if (!x.SameShape(y)) return result;
    ++result.images;
    const auto [least, most] = std::minmax_element(x.pixels().begin(), x.pixels().end());
    if (*most > *least) ++lit;
    for (size_t i = 0; i < x.pixels().size(); ++i) {
      const double p = x.pixels()[i], q = y.pixels()[i];
      const double step = 1 / ((1 << bits) - 1.0) / exposure_s + std::max(p, q) / 1024;
      if (std::abs(p - q) / step <= result.worst) continue;
      result.worst = std::abs(p - q) / step;
      result.where = std::string(name) + ", value " + std::to_string(i) + ": " + std::to_string(p) +
                     " and " + std::to_string(q);
    }
  }
  // Pictures that show nothing would be equal whatever the wires did.
  EXPECT_GT(lit, shots / 3);
  return result;
}

namespace {

// How long the light of each shot had been right when its first exposure began: never the other way round.
void PrintSkew(const std::filesystem::path& run) {
  std::ifstream file(run / "manifest.json");
  const Json manifest = Json::parse(file, nullptr, false);
  ASSERT_TRUE(manifest.is_object()) << run;
  std::vector<double> skews;
  for (const Json& shot : manifest["shots"]) {
    const int64_t lit = shot.value("lit_at_ns", int64_t{0});
    const int64_t start = shot["exposures"][0]["start_ns"];
    EXPECT_GT(lit, 0) << shot.dump();
    EXPECT_LE(lit, start) << "exposed before the light was right: " << shot.dump();
    skews.push_back(static_cast<double>(start - lit) * 1e-6);
  }
  ASSERT_FALSE(skews.empty());
  std::sort(skews.begin(), skews.end());
  std::printf("measured: exposures begin %.2f ms after their light (median; at most %.2f ms)\n",
              skews[skews.size() / 2], skews.back());
}

}  // namespace

void ExpectSame(const TestFolder& folder, const std::string& direct_rig,
                const std::string& wire_rig, const std::vector<std::string>& plan, int images,
                double exposure_s) {
  const std::filesystem::path direct = DirectRun(folder, direct_rig, plan);
  Daemon wire(folder, wire_rig);
  const std::string run = wire.Capture(plan);
  const BasisComparison same = CompareBasis(direct, wire.RunFolder(run), 12, exposure_s);
  EXPECT_EQ(same.images, images);
  EXPECT_LE(same.worst, 1.0) << same.where;
  PrintSkew(wire.RunFolder(run));
  std::printf("measured: %d images, worst difference %.3f of what one code is worth\n", same.images,
              same.worst);
}

std::string SimGige(const std::string& format, const std::string& exposures_us) {
  return "driver = \"sim-gige\"\nformat = \"" + format +
         "\"\nwidth = 64\nheight = 48\nexposures_us = [" + exposures_us + "]\n";
}

std::string SimGigeOptions(int packet_size) {
  return "address = \"127.0.0.1\"\ngain_db_per_step = 1.0\npacket_size = " +
         std::to_string(packet_size) + "\n";
}

std::string SimDisplay() { return "driver = \"sim-display\"\n" + SimDisplayOutput(); }

std::string SimDisplayOutput() {
  return "x_display = \":" + std::to_string(10000 + getpid() % 50000) +
         "\"\noutput = \"screen\"\nrenderer = \"software\"\n";
}

std::string WithMirrors(const std::string& rig) {
  return Replaced(rig, "width = 256\nheight = 192", "width = 912\nheight = 1140");
}

std::string WithTable(const std::string& rig, const std::string& name, const std::string& text) {
  const std::string head = "[" + name + "]\n";
  const size_t begin = rig.find(head);
  EXPECT_NE(begin, std::string::npos) << "the rig has no " << head;
  if (begin == std::string::npos) return rig;
  const size_t end = rig.find("\n[", begin);
  return rig.substr(0, begin) + head + text +
         (end == std::string::npos ? std::string() : rig.substr(end));
}

}  // namespace lightstage
