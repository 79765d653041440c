#include "daemon/calibrate/latency.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <random>
#include <utility>

#include "absl/strings/str_format.h"
#include "base/status.h"
#include "daemon/calibrate/light_seen.h"
#include "spdlog/spdlog.h"

namespace lightstage {
namespace {

using std::chrono::seconds;

// Frames of which it is known whether there is light in them.
constexpr int kReferences = 8;
// More than the least if frames have not come at all phases by then.
constexpr int kLeastSwitches = 40, kMostSwitches = 200;
// The longest latency that is found. So long after light was switched all frames are taken to be of it.
constexpr Duration kLongest = seconds(1);

// How often it is asked whether it is interrupted.
constexpr Duration kHearing = std::chrono::milliseconds(200);

double Ms(Duration d) { return Seconds(d) * 1e3; }

// One exposure on its way.
class Exposing {
 public:
  Exposing(Rig& rig, Duration exposure)
      : rig_(&rig),
        triggered_(rig.clock().Now()),
        deadline_(triggered_ + exposure + rig.camera().info().readout + rig.device_timeout()),
        frame_(rig.clock()) {
    rig.camera().Trigger(
        exposure, deadline_, [](const absl::StatusOr<ExposureEnd>&) {}, frame_.sink());
  }
  TimePoint triggered() const { return triggered_; }
  bool over() const { return frame_.done(); }
  TimePoint GiveUp() const { return deadline_ + rig_->device_timeout(); }
  absl::StatusOr<Frame> Wait() {
    absl::StatusOr<Frame> frame = frame_.Wait(GiveUp(), "camera: frame");
    if (!frame.ok()) rig_->SuspectCamera();
    return frame;
  }

 private:
  Rig* rig_;
  TimePoint triggered_, deadline_;
  Pending<Frame> frame_;
};

// A frame, and whether there was light in it.
struct Sample {
  Duration age{};  // from the command that the light go off to the latest start
  bool light = false;
};

struct Bracket {
  Duration with_light{}, without_light{};
};

// `widest` is what holds without any sample.
Bracket BracketOf(const std::vector<Sample>& samples, const Bracket& widest) {
  Bracket bracket = widest;
  for (const Sample& sample : samples) {
    if (sample.light) bracket.with_light = std::max(bracket.with_light, sample.age);
  }
  for (const Sample& sample : samples) {
    if (!sample.light && sample.age > bracket.with_light) {
      bracket.without_light = std::min(bracket.without_light, sample.age);
    }
  }
  return bracket;
}

class Measurement {
 public:
  Measurement(Rig& rig, const Condition& light, Duration exposure,
              absl::FunctionRef<bool()> interrupted)
      : rig_(rig),
        light_(light),
        exposure_(exposure),
        interrupted_(interrupted),
        since_(rig.disturbances()) {}

  // What frames look like in the dark and in the light, and when they come.
  absl::Status Learn();
  // Switches the light off once and looks at the frames around that.
  absl::Status Switch();
  bool Clear() const { return bracket_.without_light - bracket_.with_light <= interval_ / 8; }
  // What was found, but for what is the same for all exposures.
  LatencyReport Found() const;

 private:
  absl::Status Light(const Condition& condition) { return rig_.StartCondition(condition)->Wait(); }
  // CANCELLED when interrupted; else waits until `end` or `over`.
  absl::Status Pass(
      TimePoint end, absl::FunctionRef<bool()> over = [] { return false; });
  absl::Status Pass(Duration time) { return Pass(rig_.clock().Now() + time); }
  // Waits for the frame; one that came damaged is taken again.
  absl::StatusOr<Frame> Finish(Exposing& exposing);
  absl::StatusOr<std::vector<RowMeans>> TakeReferences();
  absl::Status AwaitLight();
  Duration Uniform(Duration from, Duration to) {
    return Duration(std::uniform_int_distribution<int64_t>(from.count(), to.count())(random_));
  }

  Rig& rig_;
  const Condition light_;
  const Duration exposure_;
  const absl::FunctionRef<bool()> interrupted_;
  const uint64_t since_;
  std::optional<LightSeen> seen_;
  Duration interval_{};  // between frames
  Duration lead_{};      // from a trigger to the latest start of its frame, about
  int rearmed_ = 0;      // frames before and after it are not numbered in one row
  Bracket widest_, bracket_;
  std::vector<Sample> samples_;
  int switches_ = 0;
  Duration light_time_{};
  std::mt19937 random_{1};
};

absl::Status Measurement::Pass(TimePoint end, absl::FunctionRef<bool()> over) {
  while (true) {
    if (interrupted_()) {
      return Error(absl::StatusCode::kCancelled, "INTERRUPTED", "the measurement was interrupted");
    }
    const TimePoint next = std::min(end, rig_.clock().Now() + kHearing);
    if (rig_.clock().WaitUntil(next, over) || next == end) return absl::OkStatus();
  }
}

absl::StatusOr<Frame> Measurement::Finish(Exposing& exposing) {
  for (int attempt = 1;; ++attempt) {
    RETURN_IF_ERROR(Pass(exposing.GiveUp(), [&] { return exposing.over(); }));
    absl::StatusOr<Frame> frame = exposing.Wait();
    if (frame.ok() && !frame->latest_start) {
      return Error(
          absl::StatusCode::kFailedPrecondition, "LATENCY_NOT_NEEDED",
          absl::StrFormat("camera: with driver %s it exposes when it is triggered: it has no "
                          "latency that could be measured",
                          rig_.camera().info().identity.driver),
          {{"driver", rig_.camera().info().identity.driver}});
    }
    if (!absl::IsDataLoss(frame.status()) || attempt == rig_.file().engine.max_attempts)
      return frame;
    RETURN_IF_ERROR(rig_.ArmCamera());
    ++rearmed_;
    exposing = Exposing(rig_, exposure_);
  }
}

absl::StatusOr<std::vector<RowMeans>> Measurement::TakeReferences() {
  RETURN_IF_ERROR(Pass(kLongest));
  std::vector<RowMeans> references;
  Duration lead{};
  std::optional<Frame> first;
  int armed = rearmed_;
  for (int i = 0; i < kReferences; ++i) {
    Exposing exposing(rig_, exposure_);
    ASSIGN_OR_RETURN(Frame frame, Finish(exposing));
    references.push_back(RowMeansOf(frame));
    lead += *frame.latest_start - exposing.triggered();
    if (!first || rearmed_ != armed) {
      first = std::move(frame);
      armed = rearmed_;
    } else if (frame.sequence > first->sequence) {
      interval_ = (*frame.latest_start - *first->latest_start) /
                  static_cast<int64_t>(frame.sequence - first->sequence);
    }
  }
  if (interval_ <= Duration::zero()) {
    return Error(absl::StatusCode::kAborted, "LATENCY_UNCLEAR",
                 absl::StrFormat("%d frames do not tell how far apart the camera's frames are",
                                 kReferences));
  }
  lead_ = lead / kReferences;
  return references;
}

absl::Status Measurement::Learn() {
  RETURN_IF_ERROR(rig_.ArmCamera());
  RETURN_IF_ERROR(Light({}));
  ASSIGN_OR_RETURN(const std::vector<RowMeans> dark, TakeReferences());
  RETURN_IF_ERROR(Light(light_));
  ASSIGN_OR_RETURN(const std::vector<RowMeans> lit, TakeReferences());
  RETURN_IF_ERROR(rig_.CheckUndisturbed(since_));
  ASSIGN_OR_RETURN(seen_, LightSeen::Learn(dark, lit));
  // A frame that began before the light went off has light, whatever the latency.
  widest_ = bracket_ = {-interval_, kLongest};
  return absl::OkStatus();
}

// The light that goes off must have been on.
absl::Status Measurement::AwaitLight() {
  RETURN_IF_ERROR(Light(light_));
  // So late a frame can show the light, and damaged ones take time too.
  const Duration patience = kLongest + 3 * std::max(interval_, exposure_);
  const TimePoint give_up = rig_.clock().Now() + patience;
  while (true) {
    Exposing exposing(rig_, exposure_);
    ASSIGN_OR_RETURN(const Frame frame, Finish(exposing));
    if (seen_->Whole(RowMeansOf(frame))) return absl::OkStatus();
    if (rig_.clock().Now() < give_up) continue;
    return Error(
        absl::StatusCode::kFailedPrecondition, "LIGHT_NOT_SEEN",
        absl::StrFormat("the light was switched on and %g s later the picture is not as bright as "
                        "it was at first",
                        Seconds(patience)));
  }
}

absl::Status Measurement::Switch() {
  RETURN_IF_ERROR(AwaitLight());
  // At any phase of the camera's frames, which the last one that came would tell.
  RETURN_IF_ERROR(Pass(Uniform(Duration::zero(), interval_)));
  // Half a frame or more around what has been found so far.
  const Duration age =
      Uniform(bracket_.with_light - interval_ / 2, bracket_.without_light + interval_ / 2);
  const Duration ahead = lead_ - age;  // of the command
  std::optional<Exposing> exposing;
  if (ahead >= Duration::zero()) {
    exposing.emplace(rig_, exposure_);
    RETURN_IF_ERROR(Pass(ahead));
  }
  const TimePoint commanded = rig_.clock().Now();
  const std::unique_ptr<Rig::Lighting> off = rig_.StartCondition({});
  if (!exposing) {
    RETURN_IF_ERROR(Pass(-ahead));
    exposing.emplace(rig_, exposure_);
  }
  while (true) {
    ASSIGN_OR_RETURN(const Frame frame, Finish(*exposing));
    const Sample sample{*frame.latest_start - commanded, seen_->Any(RowMeansOf(frame))};
    samples_.push_back(sample);
    if (sample.light && sample.age > kLongest) {
      return Error(absl::StatusCode::kFailedPrecondition, "LIGHT_NOT_SEEN",
                   absl::StrFormat("there is light in a frame %g s after it was switched off",
                                   Seconds(sample.age)));
    }
    if (!sample.light && sample.age >= bracket_.without_light) break;
    exposing.emplace(rig_, exposure_);
  }
  RETURN_IF_ERROR(off->Wait());
  light_time_ = std::max(light_time_, off->lit_at() - commanded);
  bracket_ = BracketOf(samples_, widest_);
  ++switches_;
  return rig_.CheckUndisturbed(since_);
}

LatencyReport Measurement::Found() const {
  LatencyReport found;
  found.with_light = bracket_.with_light;
  found.without_light = bracket_.without_light + FromSeconds(seen_->unseen() * Seconds(exposure_));
  found.margin = interval_ / 4;
  found.light_time = light_time_;
  found.switches = switches_;
  return found;
}

struct SwitchedLight {
  std::string name;
  Condition on;
};

// The faster one of the rig's lights, as much of it as may be on: what it takes to go off is a part of the result.
absl::StatusOr<SwitchedLight> LightOf(const Rig& rig) {
  const Lamps* lamps = rig.lamps();
  const Projector* projector = rig.projector();
  SwitchedLight light;
  if (lamps && (!projector || lamps->info().settle <= projector->info().settle)) {
    light.name = "lamps";
    const int all = static_cast<int>(rig.file().geometry.brace.lamps.size());
    const int most = std::min(all, rig.file().limits.max_lamps_on);
    for (int i = 0; i < most; ++i) light.on.lamps.push_back({i * all / most, 1.0});
    return light;
  }
  if (projector) {
    light.name = "projector";
    light.on.pattern = Pattern{PatternArrangement::kFull};
    return light;
  }
  return Error(absl::StatusCode::kFailedPrecondition, "LATENCY_NO_LIGHT",
               "a camera's latency is measured by switching light, but the rig file has neither "
               "[lamps] nor [projector]");
}

absl::StatusOr<LatencyReport> MeasureWith(Rig& rig, const SwitchedLight& light, Duration exposure,
                                          absl::FunctionRef<bool()> interrupted) {
  spdlog::info("latency: switching the {} off, exposing for {:g} us", light.name,
               Seconds(exposure) * 1e6);
  Measurement measurement(rig, light.on, exposure, interrupted);
  RETURN_IF_ERROR(measurement.Learn());
  for (int i = 0; i < kLeastSwitches || !measurement.Clear(); ++i) {
    if (i == kMostSwitches) {
      const LatencyReport found = measurement.Found();
      return Error(
          absl::StatusCode::kAborted, "LATENCY_UNCLEAR",
          absl::StrFormat(
              "after %d switches light has been seen in a frame %.1f ms old and missed in "
              "one of %.1f ms, with none between: the camera's frames come too irregularly",
              i, Ms(found.with_light), Ms(found.without_light)));
    }
    RETURN_IF_ERROR(measurement.Switch());
  }
  return measurement.Found();
}

absl::StatusOr<LatencyReport> Measure(Rig& rig, absl::FunctionRef<bool()> interrupted) {
  ASSIGN_OR_RETURN(const SwitchedLight light, LightOf(rig));
  const std::vector<Duration>& bracket = rig.file().camera_options.exposures;
  LatencyReport report;
  report.light = light.name;
  report.exposures = {bracket.front()};
  if (bracket.size() > 1) report.exposures.push_back(bracket.back());
  for (Duration exposure : report.exposures) {
    ASSIGN_OR_RETURN(const LatencyReport found, MeasureWith(rig, light, exposure, interrupted));
    report.switches += found.switches;
    report.light_time = std::max(report.light_time, found.light_time);
    if (exposure != report.exposures.front() && found.latency() <= report.latency()) continue;
    report.with_light = found.with_light;
    report.without_light = found.without_light;
    report.margin = found.margin;
  }
  return report;
}

}  // namespace

absl::StatusOr<LatencyReport> MeasureLatency(Rig& rig, absl::FunctionRef<bool()> interrupted) {
  RETURN_IF_ERROR(rig.Acquire(RigUse::kManual));
  absl::StatusOr<LatencyReport> report = Measure(rig, interrupted);
  const absl::Status dark = rig.Dark();
  rig.Release();
  if (report.ok() && !dark.ok()) return dark;
  return report;
}

std::string LatencyToml(const LatencyReport& report) {
  std::string exposures;
  for (Duration exposure : report.exposures) {
    absl::StrAppend(&exposures, exposures.empty() ? "" : " and ", Seconds(exposure) * 1e6, " us");
  }
  // Rounded up: too long costs time, too short costs pictures.
  const double latency_ms = std::ceil(Ms(report.latency()) * 10) / 10;
  return absl::StrFormat(
      "# Measured by switching the %s off %d times, with exposures of %s.\n"
      "# Frames that by their time stamps began up to %.1f ms after the command had light, those "
      "from %.1f ms on had none.\n"
      "# A quarter of a frame, %.1f ms, is added for what so few frames do not show. The light "
      "confirmed up to %.1f ms\n"
      "# after the command; when before that it went off can not be told, so that the latency is "
      "from %.1f ms to this.\n"
      "latency_ms = %.1f\n",
      report.light, report.switches, exposures, Ms(report.with_light), Ms(report.without_light),
      Ms(report.margin), Ms(report.light_time),
      std::max(0.0, Ms(report.with_light - report.light_time)), latency_ms);
}

}  // namespace lightstage
