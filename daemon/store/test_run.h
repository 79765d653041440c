// A small run for the store's tests.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "base/env.h"
#include "base/mutex.h"
#include "daemon/store/data_directory.h"
#include "daemon/store/pipeline.h"
#include "gtest/gtest.h"

namespace lightstage {

class TemporaryDirectory {
 public:
  TemporaryDirectory() : path_(::testing::TempDir() + "lightstage_store_XXXXXX") {
    if (::mkdtemp(path_.data()) == nullptr) std::abort();
  }
  TemporaryDirectory(const TemporaryDirectory&) = delete;
  TemporaryDirectory& operator=(const TemporaryDirectory&) = delete;
  ~TemporaryDirectory() { std::filesystem::remove_all(path_); }
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

inline constexpr int kTestWidth = 16, kTestHeight = 8;

inline RunHeader TestHeader(uint64_t shots) {
  RunHeader header;
  header.name = "test";
  header.rig_name = "test rig";
  header.geometry.brace.radius = Meters(1);
  header.geometry.brace.lamps = {{Degrees(0), Degrees(30)}, {Degrees(180), Degrees(60)}};
  header.geometry.camera.position = Vec3(2, 0, 1);
  header.plan_json = R"({"lightStage":{"azimuths":4}})";
  header.width = kTestWidth;
  header.height = kTestHeight;
  header.channels = 3;
  header.compression = "piz";
  header.expected_shots = shots;
  return header;
}

// Every tenth shot is a dark one, every tenth after it a reference.
inline RawShot TestShot(uint64_t id, int attempt = 1) {
  RawShot raw;
  raw.shot.id = id;
  raw.shot.kind = id % 10 == 8   ? ShotKind::kDark
                  : id % 10 == 9 ? ShotKind::kReference
                                 : ShotKind::kBasis;
  raw.shot.pose = {Degrees(static_cast<double>(id) * 5.625), Degrees(0)};
  raw.reported_pose = raw.shot.pose;
  if (raw.shot.kind == ShotKind::kBasis)
    raw.shot.condition.lamps = {{static_cast<int>(id % 2), 1.0}};
  raw.shot.exposures = {std::chrono::microseconds(500)};
  ExposureRecord exposure;
  exposure.requested = exposure.used = std::chrono::microseconds(500);
  exposure.frame_sequence = id;
  raw.exposures = {exposure};
  raw.attempt = attempt;
  raw.captured_at = WallTime(std::chrono::seconds(1'000'000 + id));
  return raw;
}

// An image that depends on the shot alone, as a deterministic rig's would.
inline absl::StatusOr<Developed> TestDevelop(const RawShot& raw) {
  Developed developed;
  developed.image.pixels = Image(kTestWidth, kTestHeight, 3);
  float value = 0.25f * static_cast<float>(raw.shot.id + 1);
  for (float& pixel : developed.image.pixels.pixels()) pixel = value;
  developed.image.flags.assign(kTestWidth * kTestHeight, 0);
  if (raw.shot.kind == ShotKind::kBasis) developed.direction = Vec3(0, 0.6, 0.8);
  return developed;
}

// Collects outcomes; thread-safe.
class Outcomes {
 public:
  ShotSink::OutcomeFn fn() {
    return [this](ShotOutcome outcome) {
      MutexLock lock(&mutex_);
      all_.push_back(std::move(outcome));
    };
  }
  std::vector<ShotOutcome> Take() {
    MutexLock lock(&mutex_);
    return std::exchange(all_, {});
  }

 private:
  Mutex mutex_;
  std::vector<ShotOutcome> all_ ABSL_GUARDED_BY(mutex_);
};

// Puts shots [first, end) into `run` and waits; failed outcomes are returned.
inline std::vector<ShotOutcome> Capture(RunFolder& run, uint64_t first, uint64_t end,
                                        int workers = 2) {
  Outcomes outcomes;
  Pipeline pipeline(run, TestDevelop, {.workers = workers, .queue_shots = 4}, outcomes.fn());
  for (uint64_t id = first; id < end; ++id) PutPatiently(pipeline, TestShot(id));
  pipeline.Drain();
  std::vector<ShotOutcome> failed;
  std::vector<ShotOutcome> all = outcomes.Take();
  EXPECT_EQ(all.size(), end - first);
  for (ShotOutcome& outcome : all) {
    if (!outcome.record.ok()) failed.push_back(std::move(outcome));
  }
  return failed;
}

inline void FlipBit(const std::string& path, size_t byte) {
  std::string bytes = PosixEnv().ReadFile(path).value();
  ASSERT_LT(byte, bytes.size());
  bytes[byte] = static_cast<char>(bytes[byte] ^ 0x10);
  ASSERT_TRUE(PosixEnv().WriteFile(path, bytes).ok());
}

}  // namespace lightstage
