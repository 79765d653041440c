#include "drivers/canopen/lamps.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_format.h"
#include "base/status.h"
#include "drivers/canopen/cia402.h"
#include "drivers/canopen/identity.h"

namespace lightstage::canopen {
namespace {

using std::chrono::milliseconds;

// CiA 401 objects; sub-index 0 is how many there are.
constexpr uint16_t kDigitalOutputs = 0x6200, kDigitalErrorMode = 0x6206,
                   kDigitalErrorValue = 0x6207, kAnalogueOutputs = 0x6411,
                   kAnalogueErrorMode = 0x6443, kAnalogueErrorValue = 0x6444;
constexpr ObjectAddress kConsumerHeartbeat{0x1016, 1}, kErrorBehaviour{0x1029, 1};

// Object 1029h:1, what a communication error does to an operational node.
constexpr int kToPreOperational = 0;
constexpr Duration kLongestTimeToDark = milliseconds(65535);  // 16 bits

}  // namespace

CanopenLampsLink::CanopenLampsLink(const std::string& device, const LampsOptions& options,
                                   int lamps, std::shared_ptr<CanBus> bus)
    : options_(options),
      lamps_(lamps),
      node_(device, std::move(bus), options.node.node, options.node.answer_time, options.node.eds) {
  const int first = options_.first_output, last = first + lamps_ - 1;
  if (digital()) {
    for (int group = first / 8; group <= last / 8; ++group) {
      outputs_.push_back({static_cast<uint8_t>(std::min(group + 1, 255)), {}});
    }
  } else {
    for (int i = first; i <= last; ++i) {
      outputs_.push_back({static_cast<uint8_t>(std::min(i + 1, 255)), {}});
    }
  }
}

CanopenLampsLink::~CanopenLampsLink() { node_.bus().RemoveHeartbeat(this); }

absl::Status CanopenLampsLink::Connect() {
  connected_ = false;
  for (Output& output : outputs_) output.value.reset();
  RETURN_IF_ERROR(node_.Attach());
  RETURN_IF_ERROR(node_.bus().Send(EncodeNmt(NmtCommand::kPreOperational, node_.id())));
  ASSIGN_OR_RETURN(const NodeIdentity identity, node_.ReadIdentity());
  RETURN_IF_ERROR(CheckIdentity(node_, options_.node, identity, kProfileIo, identity_));
  ASSIGN_OR_RETURN(const std::optional<uint32_t> there,
                   node_.ReadOptional({digital() ? kDigitalOutputs : kAnalogueOutputs, 0}));
  const int needed = options_.first_output + lamps_;
  const int has = static_cast<int>(there.value_or(0)) * (digital() ? 8 : 1);
  if (has < needed) {
    return node_.Fault(
        absl::StatusCode::kFailedPrecondition, "DEVICE_UNSUITABLE",
        absl::StrFormat("has %d %s outputs; the rig's %d lamps from output %d on need %d", has,
                        digital() ? "digital" : "analogue", lamps_, options_.first_output, needed));
  }
  RETURN_IF_ERROR(node_.WatchHeartbeat(options_.node.heartbeat));
  RETURN_IF_ERROR(node_.bus().AddHeartbeat(options_.node.heartbeat_id, Duration::zero(), this));
  const bool went_dark = goes_dark_;
  RETURN_IF_ERROR(SetErrorMode());
  if (identity_.has_value() && went_dark != goes_dark_) {
    return node_.Fault(absl::StatusCode::kFailedPrecondition, "DEVICE_UNSUITABLE",
                       "has another way to go dark by itself than before");
  }
  RETURN_IF_ERROR(Start());
  RETURN_IF_ERROR(WriteAll(std::vector<int>(outputs_.size())));
  if (time_to_dark_ > Duration::zero()) RETURN_IF_ERROR(WriteTimeToDark());
  identity_ = identity;
  RETURN_IF_ERROR(node_.Check());
  connected_ = true;
  return absl::OkStatus();
}

absl::Status CanopenLampsLink::SetErrorMode() {
  goes_dark_ = false;
  std::string lacks;
  ASSIGN_OR_RETURN(const bool watches, node_.WriteOptional(kConsumerHeartbeat, 0, 4));
  if (!watches) lacks = "a heartbeat consumer (1016h)";
  for (const Output& output : outputs_) {
    const ObjectAddress mode{digital() ? kDigitalErrorMode : kAnalogueErrorMode, output.sub};
    const ObjectAddress value{digital() ? kDigitalErrorValue : kAnalogueErrorValue, output.sub};
    ASSIGN_OR_RETURN(const bool has_value, node_.WriteOptional(value, 0, digital() ? 1 : 4));
    ASSIGN_OR_RETURN(const bool has_mode, node_.WriteOptional(mode, digital() ? 0xFF : 1, 1));
    if (!has_value || !has_mode) {
      lacks = absl::StrCat("an error ", has_mode ? "value" : "mode", " (",
                           ObjectText(has_mode ? value : mode), ")");
    }
  }
  // Without the object an error leads to pre-operational (CiA 301), which is what is wanted.
  RETURN_IF_ERROR(node_.WriteOptional(kErrorBehaviour, kToPreOperational, 1).status());
  goes_dark_ = lacks.empty();
  if (!goes_dark_) {
    spdlog::warn("{} has not {}: its lamps stay as they are if this daemon dies", node_.Where(),
                 lacks);
  }
  return absl::OkStatus();
}

LampsInfo CanopenLampsLink::info() const {
  LampsInfo info;
  if (identity_.has_value()) info.identity = Describe(*identity_);
  info.count = lamps_;
  info.steps = options_.full_scale;
  info.settle = options_.settle;
  if (goes_dark_) info.max_time_to_dark = kLongestTimeToDark;
  return info;
}

// ---- Light

std::vector<int> CanopenLampsLink::ValuesOf(const std::vector<float>& levels) const {
  std::vector<int> values(outputs_.size());
  for (int lamp = 0; lamp < lamps_; ++lamp) {
    const auto value =
        static_cast<int>(std::lround(levels[lamp] * static_cast<double>(options_.full_scale)));
    if (digital()) {
      const int bit = options_.first_output % 8 + lamp;
      values[bit / 8] |= value << bit % 8;
    } else {
      values[lamp] = value;
    }
  }
  return values;
}

std::vector<float> CanopenLampsLink::LevelsOf() const {
  std::vector<float> levels(lamps_);
  for (int lamp = 0; lamp < lamps_; ++lamp) {
    if (digital()) {
      const int bit = options_.first_output % 8 + lamp;
      levels[lamp] = static_cast<float>(*outputs_[bit / 8].value >> bit % 8 & 1);
    } else {
      levels[lamp] =
          static_cast<float>(*outputs_[lamp].value / static_cast<double>(options_.full_scale));
    }
  }
  return levels;
}

absl::Status CanopenLampsLink::WriteOutput(Output& output, int value) {
  if (output.value == value) return absl::OkStatus();
  // Many outputs on a slow bus take a while.
  if (time_to_dark_ > Duration::zero() && node_.clock().Now() - said_ > time_to_dark_ / 3) {
    RETURN_IF_ERROR(Say());
  }
  output.value.reset();
  const ObjectAddress object{digital() ? kDigitalOutputs : kAnalogueOutputs, output.sub};
  RETURN_IF_ERROR(node_.WriteInteger(object, value, digital() ? 1 : 2));
  RETURN_IF_ERROR(Confirm(object, value));
  output.value = value;
  return absl::OkStatus();
}

absl::Status CanopenLampsLink::Confirm(const ObjectAddress& object, int value) {
  ASSIGN_OR_RETURN(const uint32_t is, node_.ReadUnsigned(object));
  if (is == static_cast<uint32_t>(value)) return absl::OkStatus();
  return node_.Fault(
      absl::StatusCode::kFailedPrecondition, "LAMP_NOT_CONFIRMED",
      absl::StrFormat("was told %Xh for %s and says %Xh", value, ObjectText(object), is));
}

absl::Status CanopenLampsLink::WriteAll(const std::vector<int>& values) {
  // Darker first: never more lamps than before and after together, for the power supply's sake.
  for (size_t i = 0; i < outputs_.size(); ++i) {
    const int before = outputs_[i].value.value_or(0);
    const int darker = digital() ? before & values[i] : std::min(before, values[i]);
    RETURN_IF_ERROR(WriteOutput(outputs_[i], darker));
  }
  for (size_t i = 0; i < outputs_.size(); ++i) RETURN_IF_ERROR(WriteOutput(outputs_[i], values[i]));
  lit_ = std::any_of(values.begin(), values.end(), [](int value) { return value != 0; });
  return absl::OkStatus();
}

absl::StatusOr<std::vector<float>> CanopenLampsLink::Set(const std::vector<float>& levels) {
  RETURN_IF_ERROR(node_.Check());
  if (!connected_) {
    // It may be any device that answers there.
    return node_.Fault(absl::StatusCode::kUnavailable, "DEVICE_LOST", "is not connected");
  }
  if (time_to_dark_ > Duration::zero()) RETURN_IF_ERROR(Say());
  if (may_be_dark_ || node_.nmt_state() != NmtState::kOperational) {
    // It would take what is written without a light.
    for (Output& output : outputs_) output.value.reset();
    RETURN_IF_ERROR(Start());
  }
  RETURN_IF_ERROR(WriteAll(ValuesOf(levels)));
  RETURN_IF_ERROR(CheckLit());
  trouble_when_set_ = Trouble();
  return LevelsOf();
}

absl::Status CanopenLampsLink::Check() {
  for (const Output& output : outputs_) {
    if (!output.value) {
      return node_.Fault(absl::StatusCode::kFailedPrecondition, "LAMPS_DARK",
                         "went dark by itself since its lamps were set");
    }
    RETURN_IF_ERROR(
        Confirm({digital() ? kDigitalOutputs : kAnalogueOutputs, output.sub}, *output.value));
  }
  RETURN_IF_ERROR(CheckLit());
  // What it complained of before, and took its outputs all the same, does not count.
  if (const int trouble = Trouble(); trouble != 0 && trouble != trouble_when_set_) {
    return node_.Fault(absl::StatusCode::kFailedPrecondition, "DEVICE_FAULT",
                       "reported an error since its lamps were set");
  }
  return absl::OkStatus();
}

int CanopenLampsLink::Trouble() const {
  const std::optional<Emergency> emergency = node_.emergency();
  return emergency.has_value() ? emergency->code : 0;
}

absl::Status CanopenLampsLink::CheckLit() {
  RETURN_IF_ERROR(node_.Check());
  if (!may_be_dark_ && node_.nmt_state() == NmtState::kOperational) return absl::OkStatus();
  RETURN_IF_ERROR(node_.Check());  // it may have booted since
  return node_.Fault(absl::StatusCode::kFailedPrecondition, "LAMP_NOT_CONFIRMED",
                     "may have gone dark by itself");
}

absl::Status CanopenLampsLink::Start() {
  const Duration patience = options_.node.heartbeat * 2;
  if (time_to_dark_ == Duration::zero()) {
    RETURN_IF_ERROR(node_.Start(patience));
    may_be_dark_ = false;
    return absl::OkStatus();
  }
  // It is not to go dark again while its next heartbeat is waited for.
  const TimePoint deadline = node_.clock().Now() + patience;
  while (true) {
    RETURN_IF_ERROR(Say());
    absl::Status started = node_.Start(std::min(time_to_dark_ / 3, patience));
    if (started.ok()) may_be_dark_ = false;
    if (ErrorReason(started) != "DEVICE_SILENT" || node_.clock().Now() > deadline) return started;
  }
}

// ---- Time to dark

absl::Status CanopenLampsLink::Say() {
  RETURN_IF_ERROR(node_.bus().SayHeartbeat(options_.node.heartbeat_id));
  const TimePoint now = node_.clock().Now();
  // Its clock is not ours, and a frame takes a while.
  if (now - said_ > time_to_dark_ * 7 / 10) may_be_dark_ = true;
  said_ = now;
  return absl::OkStatus();
}

absl::Status CanopenLampsLink::WriteTimeToDark() {
  const auto time =
      static_cast<uint16_t>((time_to_dark_ + milliseconds(1) - Duration(1)) / milliseconds(1));
  const uint32_t entry = time == 0 ? 0 : ConsumerHeartbeat(options_.node.heartbeat_id, time);
  RETURN_IF_ERROR(node_.WriteInteger(kConsumerHeartbeat, entry, 4));
  // It watches from the first one on.
  said_ = node_.clock().Now();
  return time == 0 ? absl::OkStatus() : Say();
}

absl::Status CanopenLampsLink::SetTimeToDark(Duration time) {
  time_to_dark_ = time;
  if (!goes_dark_) return absl::OkStatus();
  return WriteTimeToDark();
}

absl::Status CanopenLampsLink::Refresh() {
  RETURN_IF_ERROR(node_.Check());
  if (time_to_dark_ == Duration::zero()) return absl::OkStatus();
  const bool late = node_.clock().Now() - said_ > time_to_dark_;
  RETURN_IF_ERROR(Say());
  if (!lit_) return absl::OkStatus();
  const auto state = node_.nmt_state();
  if (!late && state == NmtState::kOperational) return absl::OkStatus();
  RETURN_IF_ERROR(node_.Check());  // it may have booted since
  for (Output& output : outputs_) output.value.reset();
  lit_ = false;
  may_be_dark_ = true;
  return node_.Fault(absl::StatusCode::kFailedPrecondition, "LAMPS_DARK",
                     late ? "was refreshed too late: its lamps went dark by themselves"
                          : "left the state operational: its lamps went dark by themselves");
}

}  // namespace lightstage::canopen
