#include "drivers/link/axis_link.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "absl/strings/str_format.h"

namespace lightstage {
namespace {

// So long after its command a drive may still say that it stands where it was.
constexpr Duration kStartGrace = std::chrono::milliseconds(500);
// No turn is to be longer.
constexpr Duration kLongestTurn = std::chrono::hours(24);
// A halt that was not confirmed is commanded again so often.
constexpr Duration kHaltAgain = std::chrono::milliseconds(500);

class LinkedAxis final : public Axis {
 public:
  LinkedAxis(const DeviceContext& context, std::unique_ptr<AxisLink> link, Duration poll)
      : name_(context.name),
        clock_(*context.clock),
        link_(std::move(link)),
        poll_(poll),
        thread_(context.name, *context.clock) {}

  ~LinkedAxis() override {
    thread_.Post([this] {
      if (motion_ == nullptr && stops_.empty()) return;
      if (absl::Status halted = link_->Halt(); !halted.ok()) {
        spdlog::error("{}: could not be stopped on closing: {}", name_, MessageOf(halted));
      }
    });
    thread_.Close();
  }

  absl::Status Connect(std::string_view driver) {
    return thread_.Call([&]() -> absl::Status {
      RETURN_IF_ERROR(link_->Connect());
      info_ = link_->info();
      info_.identity.name = name_;
      info_.identity.driver = driver;
      return absl::OkStatus();
    });
  }

  const AxisInfo& info() const override { return info_; }

  void Home(TimePoint deadline, Completion<AxisState> done) override {
    Begin({.kind = Motion::kHome}, "homing", deadline, std::move(done));
  }

  void Move(Angle target, double velocity_dps, TimePoint deadline,
            Completion<AxisState> done) override {
    if (absl::Status inside = CheckTarget(info_, target); !inside.ok()) {
      return std::move(done)(inside);
    }
    const double velocity =
        velocity_dps > 0 ? std::min(velocity_dps, info_.max_velocity_dps) : info_.max_velocity_dps;
    Begin({.kind = Motion::kMove, .target = target, .velocity_dps = velocity},
          absl::StrFormat("the move to %g deg", target.degrees()), deadline, std::move(done));
  }

  void Turn(double velocity_dps, TimePoint deadline, Completion<AxisState> done) override {
    if (absl::Status good = CheckTurn(info_, velocity_dps); !good.ok()) {
      return std::move(done)(good);
    }
    Begin({.kind = Motion::kTurn, .velocity_dps = velocity_dps},
          absl::StrFormat("turning at %g deg/s", velocity_dps), deadline, std::move(done));
  }

  void Read(TimePoint deadline, Completion<AxisState> done) override {
    auto operation = thread_.Start(std::move(done), deadline, "reading the position");
    thread_.Post([this, operation] {
      if (operation->finished()) return;
      // What the drive says of a motion, that it failed above all, is for whoever waits for that too.
      std::optional<absl::StatusOr<AxisReading>> said = Step();
      const absl::StatusOr<AxisReading> reading = said ? *std::move(said) : Ask();
      if (reading.ok()) {
        operation->Complete(StateOf(*reading));
      } else {
        operation->Fail(reading.status());
      }
    });
  }

  void Stop(TimePoint deadline, Completion<AxisState> done) override {
    std::shared_ptr<Operation<AxisState>> interrupted;
    {
      MutexLock lock(&mutex_);
      interrupted = latest_;
    }
    if (interrupted != nullptr) {
      interrupted->Fail(Error(absl::StatusCode::kCancelled, "STOPPED",
                              absl::StrCat(name_, " was stopped"), {{"axis", name_}}));
    }
    auto operation = thread_.Start(std::move(done), deadline, "the stop");
    thread_.Post([this, operation] {
      const bool commanded = Commanded();
      motion_.reset();
      // Even if nothing seems to move: a stop is to be trusted. Connecting anew leaves it at rest.
      absl::Status halted = Note(link_->Halt());
      if (!halted.ok() && lost_) halted = Note(Reconnect());
      if (!halted.ok()) {
        operation->Fail(halted);
        if (commanded) KeepHalting();
        return;
      }
      must_halt_ = false;
      stops_.push_back(operation);
      Poll();
    });
  }

 private:
  struct Motion {
    enum Kind { kHome, kMove, kTurn } kind;
    Angle target;
    double velocity_dps = 0;  // of a turn it has a sign
    std::shared_ptr<Operation<AxisState>> operation{};
    enum { kWaiting, kUnderWay, kSettling } stage = kWaiting;
    Angle goal{};  // the target on the way that is taken; of a turn: where it was last seen to move
    TimePoint deadline{};
    bool reconnected = false;
    TimePoint since{};  // this stage began; of a turn: it was last seen to move
  };

  // ---- The caller's thread.

  void Begin(Motion told, const std::string& what, TimePoint deadline, Completion<AxisState> done) {
    auto motion = std::make_shared<Motion>(std::move(told));
    motion->deadline = deadline;
    motion->operation = std::make_shared<Operation<AxisState>>(std::move(done));
    bool busy;
    {
      MutexLock lock(&mutex_);
      busy = latest_ != nullptr && !latest_->finished();
      if (!busy) {
        latest_ = motion->operation;
        thread_.Track(motion->operation, deadline, what);
      }
    }
    if (busy) {
      motion->operation->Fail(Error(absl::StatusCode::kFailedPrecondition, "AXIS_BUSY",
                                    absl::StrCat(name_, " is still moving; wait for it or stop it"),
                                    {{"axis", name_}}));
      return;
    }
    thread_.Post([this, motion] {
      if (motion_ != nullptr) HaltIt();  // the last one was too late
      motion_ = motion;
      Poll();
    });
  }

  // ---- The device's thread.

  AxisState StateOf(const AxisReading& reading) const {
    return {.position = reading.position,
            .velocity_dps = reading.velocity_dps,
            .homed = reading.homed,
            .moving = reading.moving || motion_ != nullptr};
  }

  // Notes whether the link is gone.
  absl::Status Note(absl::Status status) {
    if (ErrorReason(status) == "DEVICE_LOST") lost_ = true;
    return status;
  }

  // What the drive says, but homed only as far as that can be believed: many drives do not say that their count begins anew after a power
  // cut. One that stands where nobody moved it, or that failed to arrive, has to be homed.
  absl::StatusOr<AxisReading> Ask() {
    absl::StatusOr<AxisReading> reading = link_->Read();
    Note(reading.status()).IgnoreError();
    if (!reading.ok()) return reading;
    if (Commanded() || reading->moving) {
      rest_.reset();
    } else if (!rest_) {
      rest_ = reading->position;
    } else if (const Angle way = reading->position - *rest_; !doubtful_ && IsOff(way)) {
      Doubt(absl::StrFormat("it stands at %g deg, where it stood at %g deg and nobody moved it",
                            reading->position.degrees(), rest_->degrees()));
    }
    if (doubtful_) reading->homed = false;
    return reading;
  }

  // The drive was told to move, and it is not over.
  bool Commanded() const { return motion_ != nullptr && motion_->stage != Motion::kWaiting; }

  bool IsOff(Angle way) const { return std::abs(way.degrees()) > info_.tolerance.degrees(); }

  void Doubt(std::string_view why) {
    doubtful_ = true;
    spdlog::warn("{} has to be homed: {}", name_, why);
  }

  // Moves on with what is in progress, and comes back after a while if it is not over.
  void Poll() {
    Step();
    if (polling_ || (motion_ == nullptr && stops_.empty())) return;
    polling_ = true;
    thread_.PostAt(clock_.Now() + poll_, [this] {
      polling_ = false;
      Poll();
    });
  }

  // One step on; what the drive said, if it was asked.
  std::optional<absl::StatusOr<AxisReading>> Step() {
    if (motion_ != nullptr && motion_->operation->finished()) {
      // Too late: what nobody waits for is not to go on.
      motion_.reset();
      HaltIt();  // who moves it next finds it moving
    }
    if (motion_ == nullptr && stops_.empty()) return std::nullopt;
    if (motion_ != nullptr && lost_) {
      // Where it is now nobody knows: only homing goes on from here.
      absl::Status connected = motion_->kind == Motion::kHome ? Note(Reconnect()) : Lost();
      if (!connected.ok()) {
        End(connected);
        return connected;
      }
    }
    absl::StatusOr<AxisReading> reading = Ask();
    if (reading.ok()) {
      GoOn(*reading);
    } else {
      GoOnFrom(reading.status());
    }
    return reading;
  }

  void GoOnFrom(const absl::Status& error) {
    FailStops(error);
    if (motion_ == nullptr) return;
    // That the link was lost may only show now: homing connects anew in the next step, and begins again.
    if (lost_ && motion_->kind == Motion::kHome && !std::exchange(motion_->reconnected, true)) {
      if (Commanded()) HaltIt();
      motion_->stage = Motion::kWaiting;
      return;
    }
    // Homing is what clears a fault.
    const bool fault = ErrorReason(error) == "DEVICE_FAULT";
    if (fault && motion_->kind == Motion::kHome && motion_->stage == Motion::kWaiting) {
      return StartMotion({});
    }
    // Told first: to a drive that does not answer a halt takes its time.
    const bool commanded = Commanded();
    End(error);
    if (commanded) HaltIt();
  }

  void GoOn(const AxisReading& reading) {
    if (!reading.moving) {
      for (const auto& stop : std::exchange(stops_, {})) stop->Complete(StateOf(reading));
    }
    if (motion_ == nullptr) return;
    const Duration taken = clock_.Now() - motion_->since;
    switch (motion_->stage) {
      case Motion::kWaiting:
        if (!reading.moving) StartMotion(reading);  // else it still brakes
        return;
      case Motion::kUnderWay:
        if (motion_->kind == Motion::kTurn) {
          if (reading.moving || IsOff(reading.position - motion_->goal)) {
            motion_->goal = reading.position;
            motion_->since = clock_.Now();
          } else if (taken > StallPatience()) {
            End(Stalled(reading));
            HaltIt();
          }
          return;
        }
        if (reading.moving) return;
        if (Arrived(reading)) {
          motion_->stage = Motion::kSettling;
          motion_->since = clock_.Now();
          if (info_.settle <= Duration::zero()) EndAt(reading);
        } else if (taken > kStartGrace) {
          End(OffTarget(reading));
        }
        return;
      case Motion::kSettling:
        if (taken < info_.settle) return;
        if (Arrived(reading) && !reading.moving) return EndAt(reading);
        return End(OffTarget(reading));
    }
  }

  void StartMotion(const AxisReading& from) {
    absl::Status started;
    must_halt_ = false;  // it stands
    rest_.reset();
    if (motion_->kind == Motion::kHome) {
      started = link_->StartHome();
      doubtful_ = false;
    } else if (!from.homed) {
      started = Error(absl::StatusCode::kFailedPrecondition, "NOT_HOMED",
                      absl::StrCat(name_, " must be homed first"), {{"axis", name_}});
    } else {
      if (motion_->kind == Motion::kTurn) {
        motion_->goal = from.position;
        started =
            link_->StartTurn(motion_->velocity_dps,
                             std::min<Duration>(motion_->deadline - clock_.Now(), kLongestTurn));
      } else {
        motion_->goal = info_.continuous
                            ? from.position + MoveDistance(info_, from.position, motion_->target)
                            : motion_->target;
        started = link_->StartMove(motion_->goal, motion_->velocity_dps);
      }
      if (!started.ok() && !RefusedAtRest(started)) Doubt(MessageOf(started));
    }
    if (!Note(started).ok()) {
      End(started);
      if (!RefusedAtRest(started)) HaltIt();  // a part of it may have gone through
      return;
    }
    motion_->stage = Motion::kUnderWay;
    motion_->since = clock_.Now();
  }

  // Of what was commanded. If it can not be confirmed nobody knows whether it moves: it is commanded again until it is.
  void HaltIt() {
    if (Note(link_->Halt()).ok()) {
      must_halt_ = false;
    } else {
      KeepHalting();
    }
  }

  void KeepHalting() {
    must_halt_ = true;
    if (std::exchange(halting_, true)) return;
    thread_.PostAt(clock_.Now() + kHaltAgain, [this] {
      halting_ = false;
      if (!must_halt_) return;
      const absl::Status halted = Note(lost_ ? Reconnect() : link_->Halt());
      if (!halted.ok()) return KeepHalting();
      must_halt_ = false;
      spdlog::warn("{}: halted, after that could not be confirmed before", name_);
    });
  }

  // A slow turn needs a while to get beyond what counts as standing.
  Duration StallPatience() const {
    const double far_enough = 3 * info_.tolerance.degrees() / std::abs(motion_->velocity_dps);
    return std::max<Duration>(kStartGrace, FromSeconds(std::min(far_enough, 3600.0)));
  }

  // What is out of range, or not possible at all, is refused before anything moves.
  static bool RefusedAtRest(const absl::Status& started) {
    return absl::IsOutOfRange(started) || absl::IsUnimplemented(started);
  }

  bool Arrived(const AxisReading& reading) const {
    if (!reading.homed) return false;
    return motion_->kind == Motion::kHome || !IsOff(reading.position - motion_->goal);
  }

  void EndAt(const AxisReading& reading) {
    const std::shared_ptr<Motion> motion = std::exchange(motion_, nullptr);
    rest_ = reading.position;
    motion->operation->Complete(StateOf(reading));
  }
  void End(const absl::Status& why) {
    const std::shared_ptr<Motion> motion = std::exchange(motion_, nullptr);
    if (motion->kind != Motion::kHome && motion->stage != Motion::kWaiting) Doubt(MessageOf(why));
    motion->operation->Fail(why);
  }
  void FailStops(const absl::Status& why) {
    for (const auto& stop : std::exchange(stops_, {})) stop->Fail(why);
  }

  absl::Status Reconnect() {
    RETURN_IF_ERROR(link_->Connect());
    lost_ = must_halt_ = false;
    spdlog::info("{}: connected anew", name_);
    return absl::OkStatus();
  }

  absl::Status Lost() const {
    return Error(absl::StatusCode::kUnavailable, "DEVICE_LOST",
                 absl::StrCat(name_, ": the link to the drive was lost; home it to connect anew"),
                 {{"device", name_}});
  }

  absl::Status Stalled(const AxisReading& reading) const {
    const double at = reading.position.degrees();
    return Error(absl::StatusCode::kFailedPrecondition, "AXIS_STALLED",
                 absl::StrFormat("%s stands at %g deg, though it is to turn at %g deg/s", name_, at,
                                 motion_->velocity_dps),
                 {{"axis", name_},
                  {"at_deg", absl::StrCat(at)},
                  {"velocity_dps", absl::StrCat(motion_->velocity_dps)}});
  }

  absl::Status OffTarget(const AxisReading& reading) const {
    const double at = reading.position.degrees();
    if (motion_->kind == Motion::kHome) {
      return Error(absl::StatusCode::kFailedPrecondition, "AXIS_OFF_TARGET",
                   absl::StrFormat("%s stands at %g deg and says that it is not homed", name_, at),
                   {{"axis", name_}, {"at_deg", absl::StrCat(at)}});
    }
    return Error(absl::StatusCode::kFailedPrecondition, "AXIS_OFF_TARGET",
                 absl::StrFormat("%s stands at %g deg instead of %g deg, more than %g deg away",
                                 name_, at, motion_->goal.degrees(), info_.tolerance.degrees()),
                 {{"axis", name_},
                  {"at_deg", absl::StrCat(at)},
                  {"target_deg", absl::StrCat(motion_->goal.degrees())},
                  {"tolerance_deg", absl::StrCat(info_.tolerance.degrees())}});
  }

  const std::string name_;
  Clock& clock_;
  AxisInfo info_;

  // The device's thread only.
  const std::unique_ptr<AxisLink> link_;
  const Duration poll_;
  bool lost_ = false;
  bool doubtful_ = false;      // whether it is still homed
  std::optional<Angle> rest_;  // where it stands and has stood since it was last asked
  bool polling_ = false;
  bool must_halt_ = false;  // a halt of what was commanded is not confirmed
  bool halting_ = false;    // it is going to be commanded again
  std::shared_ptr<Motion> motion_;
  std::vector<std::shared_ptr<Operation<AxisState>>> stops_;

  Mutex mutex_;
  // The last motion that was asked for.
  std::shared_ptr<Operation<AxisState>> latest_ ABSL_GUARDED_BY(mutex_);
  DeviceThread thread_;  // last: its tasks use all of this
};

}  // namespace

absl::StatusOr<std::unique_ptr<Axis>> OpenLinkedAxis(const DeviceContext& context,
                                                     std::string_view driver,
                                                     std::unique_ptr<AxisLink> link,
                                                     Duration poll) {
  RETURN_IF_ERROR(DeviceThread::CheckClock(context));
  auto axis = std::make_unique<LinkedAxis>(context, std::move(link), poll);
  RETURN_IF_ERROR(axis->Connect(driver));
  spdlog::info("{}: {} {} opened", context.name, axis->info().identity.model,
               axis->info().identity.serial);
  return std::unique_ptr<Axis>(std::move(axis));
}

}  // namespace lightstage
