// What durability costs: the store's pipeline (encode, checksum, O_DIRECT write, sync, rename, journal) against OpenEXR alone writing
// the same pictures to plain files with as many workers. Goal: at least 0.8 of its rate. Usage: store_bench [FOLDER]

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfOutputFile.h>
#include <half.h>

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <filesystem>
#include <random>
#include <thread>

#include "absl/time/clock.h"
#include "base/env.h"
#include "base/memory.h"
#include "daemon/config/rig_file.h"
#include "daemon/store/data_directory.h"
#include "daemon/store/pipeline.h"

namespace lightstage {
namespace {

constexpr int kRounds = 5;

// A smooth picture with a sensor's noise: what PIZ sees in a real capture.
BasisImage Picture(int width, int height) {
  std::mt19937 random(1);
  std::normal_distribution<float> noise(0, 0.01f);
  BasisImage picture{Image(width, height, 3), std::vector<uint8_t>(size_t(width) * height)};
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      for (int c = 0; c < 3; ++c)
        picture.pixels.at(x, y, c) =
            std::max(0.0f, 0.2f + 0.1f * std::sin(0.02f * (x + c * y)) + noise(random));
  return picture;
}

void WriteByOpenExr(const BasisImage& picture, const std::string& path) {
  int width = picture.pixels.width(), height = picture.pixels.height();
  std::vector<half> halves(picture.pixels.pixels().begin(), picture.pixels.pixels().end());
  Imf::Header header(width, height);
  header.compression() = Imf::PIZ_COMPRESSION;
  Imf::FrameBuffer buffer;
  const char* names[] = {"R", "G", "B"};
  for (int c = 0; c < 3; ++c) {
    header.channels().insert(names[c], Imf::Channel(Imf::HALF));
    buffer.insert(names[c], Imf::Slice(Imf::HALF, reinterpret_cast<char*>(halves.data() + c),
                                       3 * sizeof(half), 3 * sizeof(half) * width));
  }
  Imf::OutputFile file(path.c_str(), header, 0);
  file.setFrameBuffer(buffer);
  file.writePixels(height);
}

// Images per second that OpenEXR alone writes.
double MeasureAlone(const std::string& folder, const BasisImage& picture, int shots, int workers) {
  std::filesystem::create_directories(folder);
  std::atomic<int> next{0};
  absl::Time start = absl::Now();
  std::vector<std::thread> threads;
  for (int i = 0; i < workers; ++i) {
    threads.emplace_back([&] {
      for (int shot; (shot = next++) < shots;)
        WriteByOpenExr(picture, folder + "/" + std::to_string(shot) + ".exr");
    });
  }
  for (auto& thread : threads) thread.join();
  return shots / absl::ToDoubleSeconds(absl::Now() - start);
}

// Images per second that the store makes durable.
absl::StatusOr<double> MeasureStore(const std::string& folder, const BasisImage& picture, int shots,
                                    int workers) {
  std::unique_ptr<Env> env = MakePosixEnv({.direct_io = true});
  ASSIGN_OR_RETURN(auto data, DataDirectory::Open(*env, folder));
  RunHeader header;
  header.plan_json = "{}";
  header.width = picture.pixels.width();
  header.height = picture.pixels.height();
  header.channels = 3;
  header.compression = "piz";
  header.expected_shots = shots;
  ASSIGN_OR_RETURN(auto run, data->CreateRun(header, "", {}));
  std::atomic<int> failed{0};
  absl::Time start = absl::Now();
  {
    Pipeline pipeline(
        *run,
        [&](const RawShot&) -> absl::StatusOr<Developed> {
          return Developed{picture, {}, {}};
        },
        {workers, 8, ExrCompression::kPiz},
        [&](ShotOutcome outcome) { failed += !outcome.record.ok(); });
    for (int shot = 0; shot < shots; ++shot) {
      RawShot raw;
      raw.shot.id = shot;
      raw.shot.exposures = {std::chrono::milliseconds(1)};
      PutPatiently(pipeline, std::move(raw));
    }
    pipeline.Drain();
  }
  double rate = shots / absl::ToDoubleSeconds(absl::Now() - start);
  if (failed > 0) return absl::InternalError(absl::StrCat(failed.load(), " shots failed"));
  return rate;
}

// Both in turn, so that what else the machine does meets both alike.
absl::Status Measure(const std::string& folder, int width, int height, int shots) {
  const int workers = DefaultWorkers();
  const BasisImage picture = Picture(width, height);
  std::vector<double> alone, ours;
  for (int round = 0; round < kRounds; ++round) {
    std::filesystem::remove_all(folder);
    alone.push_back(MeasureAlone(folder, picture, shots, workers));
    std::filesystem::remove_all(folder);
    ASSIGN_OR_RETURN(double rate, MeasureStore(folder, picture, shots, workers));
    ours.push_back(rate);
    std::filesystem::remove_all(folder);
  }
  auto median = [](std::vector<double>& rates) {
    std::sort(rates.begin(), rates.end());
    return rates[rates.size() / 2];
  };
  const double reference = median(alone), rate = median(ours);
  std::printf(
      "%4dx%-4d %d workers, median of %d: OpenEXR alone %6.1f/s (%.1f to %.1f), durable store "
      "%6.1f/s (%.1f to %.1f), ratio %.2f (goal 0.8)\n",
      width, height, workers, kRounds, reference, alone.front(), alone.back(), rate, ours.front(),
      ours.back(), rate / reference);
  return absl::OkStatus();
}

}  // namespace
}  // namespace lightstage

int main(int argc, char** argv) {
  lightstage::KeepFrameMemory();  // as the daemon does
  std::string folder = (argc > 1 ? std::string(argv[1]) : "/var/tmp") + "/lightstage-store-bench";
  for (auto [width, height, shots] :
       {std::tuple{320, 240, 600}, {640, 480, 300}, {1920, 1200, 60}}) {
    absl::Status measured = lightstage::Measure(folder, width, height, shots);
    if (!measured.ok())
      return std::fprintf(stderr, "%s\n", lightstage::MessageOf(measured).c_str()), 1;
  }
  return 0;
}
