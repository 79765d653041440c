#include "drivers/dlpc350/link.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <thread>
#include <utility>

#include "absl/strings/str_cat.h"

namespace lightstage::dlpc350 {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr uint8_t kStop = 0, kStart = 2;
constexpr uint8_t kLedsOff = 0, kLedsBySequencer = 8;
constexpr Duration kWakeUp = seconds(6), kStarts = milliseconds(500);
constexpr Duration kScreenPatience = seconds(2);

absl::Status Fault(std::string_view what) {
  return Error(absl::StatusCode::kFailedPrecondition, "DEVICE_FAULT", what,
               {{"fault", std::string(what)}});
}

}  // namespace

Link::Link(const DeviceContext& context, Options options, HidOpener open,
           std::unique_ptr<Projector> screen)
    : name_(context.name),
      clock_(*context.clock),
      options_(std::move(options)),
      open_(std::move(open)),
      screen_(std::move(screen)),
      width_(context.geometry != nullptr ? context.geometry->projector.width : 0),
      height_(context.geometry != nullptr ? context.geometry->projector.height : 0) {}

absl::Status Link::Named(const absl::Status& status) const {
  return status.ok() ? status : Annotate(status, name_);
}

absl::Status Link::Connect() {
  controller_.reset();
  if (options_.flash && (width_ != kMirrorColumns || height_ != kMirrorRows)) {
    return Error(absl::StatusCode::kFailedPrecondition, "DEVICE_UNSUITABLE",
                 absl::StrCat(name_, ": images in flash have ", kMirrorColumns, "x", kMirrorRows,
                              " pixels, the rig's projector ", width_, "x", height_,
                              ": they must be the same"),
                 {{"device", name_}});
  }
  absl::StatusOr<std::unique_ptr<HidPort>> port = open_();
  if (!port.ok()) return Named(port.status());
  if (connected_once_ && (*port)->serial() != serial_) {
    return Error(absl::StatusCode::kFailedPrecondition, "DEVICE_UNSUITABLE",
                 absl::StrCat(name_, ": there is another projector now: serial \"",
                              (*port)->serial(), "\" instead of \"", serial_, "\""),
                 {{"device", name_}});
  }
  controller_ = std::make_unique<Controller>(*std::move(port));
  if (absl::Status configured = Configure(); !configured.ok()) {
    // After power-on it shows its video input by itself; as well as it still can it is left dark.
    TryDark();
    controller_.reset();
    return Named(configured);
  }
  connected_once_ = true;
  return absl::OkStatus();
}

std::array<uint8_t, 3> Link::LedCurrents() const {
  std::array<uint8_t, 3> currents;
  std::transform(options_.current.begin(), options_.current.end(), currents.begin(),
                 [](uint8_t current) { return static_cast<uint8_t>(255 - current); });
  return currents;
}

absl::StatusOr<bool> Link::IsConfigured() {
  ASSIGN_OR_RETURN(const std::vector<uint8_t> mode, controller_->Read(kMode, 1));
  ASSIGN_OR_RETURN(const std::vector<uint8_t> currents, controller_->Read(kLedCurrent, 3));
  ASSIGN_OR_RETURN(const std::vector<uint8_t> enabled, controller_->Read(kLedEnable, 1));
  const std::array<uint8_t, 3> told = LedCurrents();
  return (mode[0] == 1) == options_.flash &&
         std::equal(told.begin(), told.end(), currents.begin()) &&
         (lit_ || enabled[0] == kLedsOff);  // after power-on they shine by themselves
}

absl::Status Link::Configure() {
  ASSIGN_OR_RETURN(std::vector<uint8_t> version, controller_->Read(kVersion, 4));
  ASSIGN_OR_RETURN(version_, ParseVersion(version));
  serial_ = controller_->serial();
  ASSIGN_OR_RETURN(std::vector<uint8_t> power, controller_->Read(kPower, 1));
  RETURN_IF_ERROR((power[0] & 1) != 0 ? WakeUp() : CheckHealthInTheDark());
  // The LightCrafter's drivers invert what the polarity says: 255 is dark (e2e.ti.com, thread 451589).
  RETURN_IF_ERROR(controller_->Set(kLedPolarity, {0}));
  RETURN_IF_ERROR(controller_->Set(kLedCurrent, LedCurrents()));
  RETURN_IF_ERROR(controller_->Set(kMode, {static_cast<uint8_t>(options_.flash ? 1 : 0)}));
  if (!options_.flash) return ShowOnScreen(Pattern{});
  RETURN_IF_ERROR(controller_->Set(kStartStop, {kStop}));
  RETURN_IF_ERROR(controller_->Set(kSource, {3}));
  RETURN_IF_ERROR(controller_->Set(kTriggerMode, {1}));
  RETURN_IF_ERROR(controller_->Set(kTriggerOut1, options_.trigger_out1));
  RETURN_IF_ERROR(controller_->Set(kTriggerOut2, options_.trigger_out2));
  RETURN_IF_ERROR(
      controller_->Set(kTriggerIn1Delay, EncodeTriggerInDelay(options_.trigger_in_delay_us)));
  return controller_->Set(kExposure, EncodeExposure(options_.exposure_us, options_.period_us));
}

absl::Status Link::WakeUp() {
  spdlog::info("{}: wakes from standby", name_);
  // Some firmware does not answer this, nor anything until it is awake: TI's own program takes no answer and looks later.
  const TimePoint give_up = clock_.Now() + kWakeUp;
  absl::Status awake = controller_->Write(kPower, std::array<uint8_t, 1>{0});
  while (ErrorReason(awake) != "DEVICE_LOST" && clock_.Now() < give_up) {
    const absl::StatusOr<std::vector<uint8_t>> power = controller_->Read(kPower, 1);
    awake = !power.ok()              ? power.status()
            : ((*power)[0] & 1) != 0 ? Fault("it stays in standby")
                                     : CheckHealthInTheDark();
    if (awake.ok()) return awake;
    std::this_thread::sleep_for(milliseconds(20));
  }
  return awake;
}

ProjectorInfo Link::info() const {
  ProjectorInfo info;
  info.identity.model = "TI DLPC350 firmware " + version_;
  info.identity.serial = serial_;
  info.width = width_;
  info.height = height_;
  info.settle = options_.settle;
  if (screen_ != nullptr) info.settle += screen_->info().settle;
  return info;
}

absl::Status Link::Show(const Pattern& pattern) {
  const bool black = pattern.arrangement == PatternArrangement::kBlack;
  if (controller_ != nullptr) {
    const absl::StatusOr<bool> configured = IsConfigured();
    if (configured.ok() && !*configured) {
      spdlog::warn("{}: was reset; it is configured anew", name_);
      controller_.reset();
    }
  }
  if (controller_ == nullptr) {
    absl::Status connected = Connect();
    if (!connected.ok()) {
      // What it projects is not its own.
      if (black && screen_ != nullptr) ShowOnScreen(pattern).IgnoreError();
      return connected;
    }
  }
  lit_ = !black;
  absl::Status shown = black ? Dark() : options_.flash ? ShowStored(pattern) : ShowVideo(pattern);
  if (shown.ok()) return shown;
  // What is lit now is not what was asked for. Also if it is the video output that is lost or silent.
  if (!black) TryDark();
  if (ErrorReason(shown) == "DEVICE_LOST") controller_.reset();
  return Named(shown);
}

void Link::TryDark() {
  const absl::Status off = controller_->Set(kLedEnable, {kLedsOff});
  if (off.ok() || ErrorReason(off) == "DEVICE_LOST") return;  // that is told anyway
  spdlog::error("{}: may be lit: {}", name_, MessageOf(off));
}

absl::Status Link::Check() {
  const absl::StatusOr<bool> configured = IsConfigured();
  absl::Status same = configured.status();
  if (same.ok() && !*configured) {
    same = Error(absl::StatusCode::kUnavailable, "DEVICE_LOST", "it was reset meanwhile",
                 {{"device", name_}});
  }
  if (same.ok()) same = CheckHealth(lit_);
  if (same.ok() && screen_ != nullptr) {
    Pending<std::monostate> checked(clock_);
    screen_->Check(clock_.Now() + kScreenPatience, checked.sink());
    same = checked.Wait(kNever, "the video output").status();
  }
  if (ErrorReason(same) == "DEVICE_LOST") controller_.reset();
  return Named(same);
}

absl::Status Link::CheckHealthInTheDark() {
  RETURN_IF_ERROR(controller_->Set(kLedEnable, {kLedsOff}));
  return CheckHealth(false);
}

absl::Status Link::CheckHealth(bool light) {
  ASSIGN_OR_RETURN(StatusBits status, controller_->ReadStatus());
  if (const std::string errors = DescribeErrors(status); !errors.empty()) return Fault(errors);
  if (status.parked()) return Fault("the mirrors are parked");
  if (!light) return absl::OkStatus();
  if (!status.running()) return Fault("the sequencer stands still");
  if (!options_.flash && status.frozen()) return Fault("the picture of the video input is frozen");
  return absl::OkStatus();
}

absl::Status Link::AwaitRunning() {
  const TimePoint give_up = clock_.Now() + kStarts;
  while (true) {
    absl::Status health = CheckHealth(true);
    if (health.ok() || ErrorReason(health) != "DEVICE_FAULT" || clock_.Now() >= give_up) {
      return health;
    }
    std::this_thread::sleep_for(milliseconds(5));
  }
}

// In both ways: if one fails the other may do it.
absl::Status Link::Dark() {
  absl::Status off = controller_->Set(kLedEnable, {kLedsOff});
  const absl::Status black =
      options_.flash ? controller_->Set(kStartStop, {kStop}) : ShowOnScreen(Pattern{});
  off.Update(black);
  return off;
}

absl::Status Link::ShowStored(const Pattern& pattern) {
  auto stored = options_.patterns.find(Canonical(pattern));
  if (stored == options_.patterns.end()) {
    return Error(absl::StatusCode::kFailedPrecondition, "PATTERN_NOT_STORED",
                 absl::StrCat("the rig file's table of patterns in flash has no ",
                              PatternName(pattern), " (grid ", pattern.grid, ")"),
                 {{"pattern", PatternName(pattern)}});
  }
  const StoredPattern& where = stored->second;
  RETURN_IF_ERROR(controller_->Set(kLedEnable, {kLedsOff}));
  RETURN_IF_ERROR(controller_->Set(kStartStop, {kStop}));
  RETURN_IF_ERROR(CheckHealth(false));
  LutEntry entry;
  entry.trigger = options_.trigger_in;
  entry.number = where.number;
  entry.depth = where.depth;
  entry.leds = options_.leds;
  entry.invert = where.invert;
  entry.black = options_.trigger_in != 0;
  entry.swap = true;  // loads the image
  RETURN_IF_ERROR(controller_->SetSequence(static_cast<uint8_t>(where.image), entry));
  // Light last: what is waited for until then is not lit.
  RETURN_IF_ERROR(controller_->Set(kStartStop, {kStart}));
  RETURN_IF_ERROR(AwaitRunning());
  RETURN_IF_ERROR(controller_->Set(kLedEnable, {kLedsBySequencer}));
  // The first one may have begun with the image before.
  std::this_thread::sleep_for(std::chrono::microseconds(options_.period_us));
  return CheckHealth(true);
}

absl::Status Link::ShowOnScreen(const Pattern& pattern) {
  Pending<ProjectorState> shown(clock_);
  const TimePoint deadline = clock_.Now() + kScreenPatience;
  if (pattern.arrangement == PatternArrangement::kBlack) {
    screen_->Black(deadline, shown.sink());
  } else {
    screen_->Show(pattern, deadline, shown.sink());
  }
  return shown.Wait(kNever, "the video output").status();
}

absl::Status Link::ShowVideo(const Pattern& pattern) {
  RETURN_IF_ERROR(ShowOnScreen(pattern));
  RETURN_IF_ERROR(controller_->Set(kLedEnable, {kLedsBySequencer}));
  return AwaitRunning();
}

}  // namespace lightstage::dlpc350
