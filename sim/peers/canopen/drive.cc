#include "sim/peers/canopen/drive.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace lightstage::sim {
namespace {

constexpr Duration kForEver = std::chrono::hours(1000);

}  // namespace

// Finite state machine and transitions as IEC 61800-7-201 numbers them.
class CanopenDrive::Profile final : public PeerProfile {
 public:
  Profile(const DriveOptions& options, std::shared_ptr<World> world)
      : options_(options), world_(std::move(world)) {}

  void SetNode(PeerNode* node) { node_ = node; }

  void Declare(ObjectDictionary& objects) override {
    objects_ = &objects;
    Stop();
    state_ = kSwitchOnDisabled;
    // Where it is it does not know any more.
    origin_deg_ = options_.home_deg + options_.lost_deg;
    mode_ = 0;
    control_ = 0;
    acknowledged_ = halted_ = following_error_ = fault_stays_ = false;
    homing_ = Homing::kNo;
    error_code_ = 0;
    target_.reset();
    if (options_.has_abort_option) objects.Variable(0x6007, 0, 2, 0);
    if (!options_.has_pdo) {
      objects.Remove(0x1800);
      objects.Remove(0x1A00);
    }
    objects.Live(0x603F, 0, 2, [this] { return uint32_t{error_code_}; });
    objects.Variable(0x6040, 0, 2, 0, [this](uint32_t word) -> uint32_t {
      Control(static_cast<uint16_t>(word));
      return 0;
    });
    objects.Live(0x6041, 0, 2, [this] { return uint32_t{Status()}; });
    objects.Variable(0x6060, 0, 1, 0, [this](uint32_t mode) -> uint32_t {
      if (mode != 1 && mode != 6 && !(mode == 3 && options_.has_velocity_mode)) return 0x06090030;
      mode_ = static_cast<int>(mode);
      // Where a velocity is to be kept it is kept from now on.
      if (mode_ == 3 && state_ == kEnabled && !halted_) Turn();
      return 0;
    });
    objects.Live(0x6061, 0, 1, [this] { return static_cast<uint32_t>(mode_); });
    objects.Live(0x6064, 0, 4, [this] {
      return static_cast<uint32_t>(static_cast<int32_t>(
          std::lround((Now().position.degrees() - origin_deg_) / 360 * options_.units_per_turn)));
    });
    objects.Variable(0x607A, 0, 4, 0);
    if (options_.software_limits.has_value()) {
      objects.Constant(0x607D, 0, 1, 2);
      objects.Variable(0x607D, 1, 4, static_cast<uint32_t>(options_.software_limits->first));
      objects.Variable(0x607D, 2, 4, static_cast<uint32_t>(options_.software_limits->second));
    }
    objects.Variable(0x6081, 0, 4, 0);
    objects.Variable(0x6083, 0, 4, 100);
    objects.Variable(0x6098, 0, 1, 0);
    objects.Constant(0x6099, 0, 1, 2);
    objects.Variable(0x6099, 1, 4, 0);
    objects.Variable(0x6099, 2, 4, 0);
    objects.Variable(0x609A, 0, 4, 100);
    objects.Constant(0x6502, 0, 4, options_.has_velocity_mode ? 0x25 : 0x21);
    if (!options_.has_velocity_mode) return;
    objects.Live(0x606C, 0, 4, [this] {
      return static_cast<uint32_t>(
          static_cast<int32_t>(std::lround(Now().velocity_dps / 360 * options_.units_per_turn)));
    });
    objects.Variable(0x6084, 0, 4, 100);
    objects.Variable(0x60FF, 0, 4, 0, [this](uint32_t velocity) -> uint32_t {
      if (mode_ == 3 && state_ == kEnabled && !halted_) Turn(static_cast<int32_t>(velocity));
      return 0;
    });
  }

  void Tick(TimePoint) override {
    const bool moving = Now().moving;
    if (state_ == kFaultReaction && !moving) state_ = kFault;
    if (homing_ == Homing::kRunning && !moving) {
      if (std::exchange(fail_homing_, false)) {
        homing_ = Homing::kFailed;
      } else {
        homing_ = Homing::kDone;
        origin_deg_ = options_.home_deg;
      }
    }
  }

  void MasterLost() override {
    if (state_ == kEnabled && options_.has_abort_option && objects_->Value(0x6007, 0) == 3) {
      QuickStop();
    }
  }

  void Fail(uint16_t code, bool stays) {
    error_code_ = code;
    fault_stays_ = stays;
    state_ = kFaultReaction;
    Brake();
    homing_ = Homing::kNo;
    node_->Emergency(code, 1);
  }

  void CutPower() {
    Stop();
    state_ = kSwitchOnDisabled;
  }

  void LoseSetpoints(int count) { lose_ = count; }
  void FailNextHoming() { fail_homing_ = true; }
  void SetFollowingError(bool error) { following_error_ = error; }
  void SetSlips(bool slips) { slips_ = slips; }
  void Jam() {
    jammed_ = true;
    Stop();
  }

  uint16_t Status() const {
    constexpr uint16_t kBits[] = {0x00, 0x40, 0x21, 0x23, 0x27, 0x07, 0x0F, 0x08};
    uint16_t status = kBits[state_] | 0x0210;  // remote, voltage enabled
    auto set = [&](int bit, bool on) {
      if (on) status = static_cast<uint16_t>(status | 1 << bit);
    };
    const bool moving = Now().moving;
    if (mode_ == 1) {
      set(10, !moving);
      set(12, acknowledged_);
      set(13, following_error_);
    } else if (mode_ == 3) {
      set(10, halted_ ? !moving : Now().velocity_dps == TargetDps());
      set(12, Now().velocity_dps == 0);
      set(13, slips_);
    } else if (mode_ == 6) {
      set(10, homing_ != Homing::kRunning && !moving);
      set(12, homing_ == Homing::kDone);
      set(13, homing_ == Homing::kFailed);
    }
    return status;
  }

 private:
  enum State {
    kNotReady,
    kSwitchOnDisabled,
    kReady,
    kSwitchedOn,
    kEnabled,
    kQuickStop,
    kFaultReaction,
    kFault
  };
  enum class Homing { kNo, kRunning, kDone, kFailed };

  AxisState Now() const { return world_->AxisAt(options_.role, world_->clock().Now()); }
  double Dps(uint16_t index, uint8_t sub) const {
    return std::max(1.0, static_cast<double>(objects_->Value(index, sub))) /
           std::abs(options_.units_per_turn) * 360;
  }

  void Control(uint16_t word) {
    const auto rising = static_cast<uint16_t>(word & ~control_);
    const uint16_t before = std::exchange(control_, word);
    if (state_ == kFault) {
      if ((rising & 0x80) != 0 && !fault_stays_) {
        state_ = kSwitchOnDisabled;  // transition 15
        error_code_ = 0;
        node_->Emergency(0, 0);
      }
      return;
    }
    if (state_ == kFaultReaction || state_ == kNotReady) return;
    const bool on = (word & 1) != 0, voltage = (word & 2) != 0, no_quick_stop = (word & 4) != 0,
               operate = (word & 8) != 0;
    if (!voltage) {
      if (state_ != kSwitchOnDisabled) CutPower();  // 7, 9, 10, 12
      return;
    }
    if (!no_quick_stop) {
      if (state_ == kReady || state_ == kSwitchedOn) state_ = kSwitchOnDisabled;  // 7, 10
      if (state_ == kEnabled) QuickStop();                                        // 11
      return;
    }
    if (!on) {
      if (state_ == kSwitchOnDisabled || state_ == kSwitchedOn) state_ = kReady;  // 2, 6
      if (state_ == kEnabled) {
        Stop();
        state_ = kReady;  // 8
      }
      return;
    }
    if (!operate) {
      if (state_ == kReady) state_ = kSwitchedOn;  // 3
      if (state_ == kEnabled) {
        Brake();
        state_ = kSwitchedOn;  // 5
      }
      return;
    }
    if (state_ == kReady || state_ == kSwitchedOn) {
      state_ = kEnabled;  // 3 + 4, 4
      target_.reset();
      halted_ = false;
      if (mode_ == 3) Turn();
      return;
    }
    if (state_ == kEnabled) Operate(word, before, rising);
  }

  void Operate(uint16_t word, uint16_t before, uint16_t rising) {
    const bool halt = (word & 0x100) != 0;
    if (halt && !halted_) {
      halted_ = true;
      if (homing_ == Homing::kRunning) homing_ = Homing::kNo;
      Brake();
    }
    const bool released = !halt && std::exchange(halted_, halt);
    if (mode_ == 6) {
      target_.reset();
      if ((rising & 0x10) != 0 && !halt) {
        homing_ = Homing::kRunning;
        Go(options_.home_deg, Dps(0x6099, 1), Dps(0x609A, 0));
      } else if ((before & 0x10) != 0 && (word & 0x10) == 0 && homing_ == Homing::kRunning) {
        homing_ = Homing::kNo;  // interrupted
        Brake();
      }
      return;
    }
    if (mode_ == 3 && released) Turn();
    if (mode_ != 1) return;
    if ((word & 0x10) == 0) acknowledged_ = false;
    if ((rising & 0x10) != 0) {
      if (lose_ > 0) {
        --lose_;
      } else {
        const auto units = static_cast<int32_t>(objects_->Value(0x607A, 0));
        target_ = origin_deg_ + units / options_.units_per_turn * 360;
        acknowledged_ = true;
        if (!halt) Go(*target_, Dps(0x6081, 0), Dps(0x6083, 0));
        return;
      }
    }
    // What a halt interrupted goes on (IEC 61800-7-201: "positioning shall be executed or continued").
    if (released && target_.has_value()) Go(*target_, Dps(0x6081, 0), Dps(0x6083, 0));
  }

  void QuickStop() {
    Brake();
    target_.reset();
    homing_ = Homing::kNo;
    state_ = kQuickStop;  // 605Ah = 6: stays there
  }

  AxisMechanics Mechanics(double ramp_dps2) const { return {.max_acceleration_dps2 = ramp_dps2}; }

  void Go(double to_deg, double dps, double ramp_dps2) {
    TimePoint now = world_->clock().Now();
    const AxisState state = world_->AxisAt(options_.role, now);
    double from = state.position.degrees();
    Motion motion;
    if (state.velocity_dps != 0) {
      motion = ::lightstage::sim::Brake(now, from, state.velocity_dps, Mechanics(ramp_dps2));
      now = motion.back().start;
      from = motion.back().position;
      motion.pop_back();
    }
    if (to_deg == from || jammed_) {
      motion.push_back({.start = now, .position = from});
    } else {
      const Motion travel = Travel(now, from, to_deg - from, to_deg, dps, Mechanics(ramp_dps2));
      motion.insert(motion.end(), travel.begin(), travel.end());
    }
    world_->SetMotion(options_.role, motion);
  }

  void Brake() {
    const TimePoint now = world_->clock().Now();
    const AxisState state = world_->AxisAt(options_.role, now);
    if (!state.moving) return;
    world_->SetMotion(options_.role,
                      ::lightstage::sim::Brake(now, state.position.degrees(), state.velocity_dps,
                                               Mechanics(Deceleration())));
  }

  double Deceleration() const {
    if (objects_ == nullptr) return 1000;
    return Dps(options_.has_velocity_mode ? 0x6084 : 0x6083, 0);
  }
  double TargetDps() const { return Degrees(static_cast<int32_t>(objects_->Value(0x60FF, 0))); }
  double Degrees(double units) const { return units / options_.units_per_turn * 360; }

  void Turn() { Turn(static_cast<int32_t>(objects_->Value(0x60FF, 0))); }
  // At so many units per second from now on.
  void Turn(int32_t units) {
    const double dps = Degrees(units);
    const TimePoint now = world_->clock().Now();
    const AxisState state = world_->AxisAt(options_.role, now);
    const double change = dps - state.velocity_dps;
    if (change == 0 || jammed_) return;
    const double ramp = std::copysign(Dps(0x6083, 0), change), time = change / ramp;
    const TimePoint reached = now + FromSeconds(time);
    const double from = state.position.degrees(),
                 to = from + (state.velocity_dps + change / 2) * time;
    Motion motion{
        {.start = now, .position = from, .velocity = state.velocity_dps, .acceleration = ramp},
        {.start = reached, .position = to, .velocity = dps}};
    // Motions end.
    if (dps != 0)
      motion.push_back({.start = reached + kForEver, .position = to + dps * Seconds(kForEver)});
    world_->SetMotion(options_.role, motion);
  }

  // Without power friction ends it at once.
  void Stop() {
    const TimePoint now = world_->clock().Now();
    const AxisState state = world_->AxisAt(options_.role, now);
    if (!state.moving) return;
    world_->SetMotion(options_.role, {{.start = now, .position = state.position.degrees()}});
  }

  const DriveOptions options_;
  const std::shared_ptr<World> world_;  // shared: with the rig's other simulated devices
  PeerNode* node_ = nullptr;
  ObjectDictionary* objects_ = nullptr;
  State state_ = kNotReady;
  int mode_ = 0;
  uint16_t control_ = 0, error_code_ = 0;
  bool acknowledged_ = false, halted_ = false, following_error_ = false, fault_stays_ = false,
       fail_homing_ = false, slips_ = false, jammed_ = false;
  Homing homing_ = Homing::kNo;
  int lose_ = 0;
  double origin_deg_ = 0;         // the world's angle at position 0
  std::optional<double> target_;  // of the set-point that was taken last, world
};

CanopenDrive::CanopenDrive(std::unique_ptr<canopen::CanPort> port, const DriveOptions& options,
                           const std::shared_ptr<World>& world)
    : profile_(std::make_unique<Profile>(options, world)),
      node_(std::make_unique<PeerNode>(std::move(port), options.identity, *profile_,
                                       world->clock())) {
  profile_->SetNode(node_.get());
  node_->Start();
}

CanopenDrive::~CanopenDrive() = default;

void CanopenDrive::LoseSetpoints(int count) {
  node_->Do([&](ObjectDictionary&) { profile_->LoseSetpoints(count); });
}
void CanopenDrive::Fail(uint16_t error_code, bool stays) {
  node_->Do([&](ObjectDictionary&) { profile_->Fail(error_code, stays); });
}
void CanopenDrive::FailNextHoming() {
  node_->Do([&](ObjectDictionary&) { profile_->FailNextHoming(); });
}
void CanopenDrive::SetFollowingError(bool error) {
  node_->Do([&](ObjectDictionary&) { profile_->SetFollowingError(error); });
}
void CanopenDrive::SetSlips(bool slips) {
  node_->Do([&](ObjectDictionary&) { profile_->SetSlips(slips); });
}
void CanopenDrive::Jam() {
  node_->Do([&](ObjectDictionary&) { profile_->Jam(); });
}
void CanopenDrive::CutPower() {
  node_->Do([&](ObjectDictionary&) { profile_->CutPower(); });
}
uint16_t CanopenDrive::statusword() { return static_cast<uint16_t>(node_->Value(0x6041, 0)); }

}  // namespace lightstage::sim
