#include "drivers/link/light_link.h"

#include <spdlog/spdlog.h>

#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "drivers/link/device_thread.h"

namespace lightstage {
namespace {

// What lamps and projectors have in common: one thing at a time is applied by the link and settles; going dark interrupts it.
template <class Link, class State>
class Light {
 public:
  using Apply = absl::AnyInvocable<absl::StatusOr<State>()>;

  Light(const DeviceContext& context, std::unique_ptr<Link> link, const char* busy_reason)
      : link_(std::move(link)), busy_reason_(busy_reason), thread_(context.name, *context.clock) {}

  template <class Info>
  absl::Status Connect(std::string_view driver, Info* info) {
    return thread_.Call([&]() -> absl::Status {
      RETURN_IF_ERROR(link_->Connect());
      *info = link_->info();
      info->identity.name = thread_.name();
      info->identity.driver = driver;
      settle_ = info->settle;
      connected_ = confirmed_ = true;
      return absl::OkStatus();
    });
  }

  // One at a time.
  void Start(const char* what, TimePoint deadline, Completion<State> done, Apply apply) {
    auto operation = std::make_shared<Operation<State>>(std::move(done));
    bool busy;
    {
      MutexLock lock(&mutex_);
      busy = interrupting_ > 0 || (latest_ != nullptr && !latest_->finished());
      if (!busy) {
        latest_ = operation;
        thread_.Track(operation, deadline, what);
      }
    }
    if (busy) {
      operation->Fail(
          Error(absl::StatusCode::kFailedPrecondition, busy_reason_,
                absl::StrCat(thread_.name(), ": still busy with what it was told before"),
                {{"device", thread_.name()}, {"operation", what}}));
      return;
    }
    Run(std::move(operation), std::move(apply), nullptr);
  }

  void Interrupt(const char* what, TimePoint deadline, Completion<State> done, Apply apply) {
    std::shared_ptr<Operation<State>> interrupted;
    {
      MutexLock lock(&mutex_);
      ++interrupting_;
      interrupted = latest_;
    }
    if (interrupted != nullptr) {
      interrupted->Fail(Error(absl::StatusCode::kCancelled, "INTERRUPTED",
                              absl::StrCat(thread_.name(), ": went dark meanwhile"),
                              {{"device", thread_.name()}}));
    }
    Run(thread_.Start(std::move(done), deadline, what), std::move(apply), [this] {
      MutexLock lock(&mutex_);
      --interrupting_;
    });
  }

  // LIGHT_UNKNOWN unless the link has confirmed what it was told last.
  void Check(TimePoint deadline, Completion<std::monostate> done) {
    auto operation = thread_.Start(std::move(done), deadline, "saying whether it shines as told");
    thread_.Post([this, operation] {
      absl::Status as_told = AsTold();
      confirmed_ = as_told.ok();
      if (as_told.ok()) {
        operation->Complete(std::monostate());
      } else {
        operation->Fail(as_told);
      }
    });
  }

  // `apply` makes it dark. Before what it uses is gone. What was never connected is not touched.
  void Close(Apply apply) {
    {
      MutexLock lock(&mutex_);
      ++interrupting_;  // what was told to go dark before, and is not waited for, is done by this
    }
    thread_.Post([this, apply = std::move(apply)]() mutable {
      if (!connected_) return;
      if (absl::Status dark = Do(apply).status(); !dark.ok()) {
        spdlog::error("{}: may be lit after closing: {}", thread_.name(), MessageOf(dark));
      }
    });
    thread_.Close();
  }

  // Notes the loss, if it is one.
  absl::Status Noted(absl::Status status) {
    if (ErrorReason(status) == "DEVICE_LOST") lost_ = true;
    return status;
  }

  DeviceThread& thread() { return thread_; }
  Link& link() { return *link_; }  // on the device's thread

 private:
  absl::Status AsTold() {
    if (confirmed_) return Noted(link_->Check());
    return Error(absl::StatusCode::kFailedPrecondition, "LIGHT_UNKNOWN",
                 absl::StrCat(thread_.name(), ": has not confirmed what it was told last"),
                 {{"device", thread_.name()}});
  }

  // `applied` is called on the device's thread, once, when the link has done its part.
  void Run(std::shared_ptr<Operation<State>> operation, Apply apply,
           absl::AnyInvocable<void()> applied) {
    thread_.Post(
        [this, operation, apply = std::move(apply), applied = std::move(applied)]() mutable {
          // Going dark is done even if nobody waits for it any more, but once: a link that hangs does so each time.
          const bool dark = applied != nullptr;
          if (operation->finished() && (!dark || AnotherInterrupts())) {
            if (dark) applied();
            return;
          }
          absl::StatusOr<State> state = Do(apply);
          // Of a device that was unplugged and is there again that is the first to notice.
          if (dark && lost_) state = Do(apply);
          if (dark) applied();
          if (!state.ok() || settle_ <= Duration::zero()) {
            operation->Complete(std::move(state));
            return;
          }
          thread_.PostAt(thread_.clock().Now() + settle_,
                         [operation, state = *std::move(state)]() mutable {
                           operation->Complete(std::move(state));
                         });
        });
  }

  bool AnotherInterrupts() {
    MutexLock lock(&mutex_);
    return interrupting_ > 1;
  }

  absl::StatusOr<State> Do(Apply& apply) {
    if (lost_) {
      RETURN_IF_ERROR(link_->Connect());
      lost_ = false;
      spdlog::info("{}: connected anew", thread_.name());
    }
    absl::StatusOr<State> state = apply();
    confirmed_ = Noted(state.status()).ok();
    return state;
  }

  const std::unique_ptr<Link> link_;
  const char* const busy_reason_;
  Duration settle_{};  // the device's thread only, like this
  bool lost_ = false;
  bool connected_ = false;  // ever
  bool confirmed_ = false;  // what it was told last

  Mutex mutex_;
  int interrupting_ ABSL_GUARDED_BY(mutex_) = 0;  // told to go dark, and not yet
  std::shared_ptr<Operation<State>> latest_ ABSL_GUARDED_BY(mutex_);
  DeviceThread thread_;  // last: its tasks use all of this
};

class LinkedLamps final : public Lamps {
 public:
  LinkedLamps(const DeviceContext& context, std::unique_ptr<LampsLink> link)
      : light_(context, std::move(link), "LAMPS_BUSY") {}
  ~LinkedLamps() override { light_.Close(Setting(AllDark())); }

  absl::Status Connect(std::string_view driver) { return light_.Connect(driver, &info_); }
  const LampsInfo& info() const override { return info_; }

  void Set(const std::vector<float>& levels, TimePoint deadline,
           Completion<LampsState> done) override {
    if (absl::Status right = CheckLevels(info_, levels); !right.ok()) return std::move(done)(right);
    light_.Start("setting the lamps", deadline, std::move(done), Setting(levels));
  }

  void Dark(TimePoint deadline, Completion<LampsState> done) override {
    light_.Interrupt("darkening the lamps", deadline, std::move(done), Setting(AllDark()));
  }

  void Check(TimePoint deadline, Completion<std::monostate> done) override {
    light_.Check(deadline, std::move(done));
  }

  absl::Status SetTimeToDark(Duration time) override {
    if (time < Duration::zero() || time > info_.max_time_to_dark) {
      return Error(absl::StatusCode::kOutOfRange, "TIME_TO_DARK",
                   absl::StrCat(info_.identity.name, ": time to dark of ", Seconds(time),
                                " s, must be from 0 to ", Seconds(info_.max_time_to_dark), " s"),
                   {{"device", info_.identity.name}, {"time_s", absl::StrCat(Seconds(time))}});
    }
    return light_.thread().Call([&] { return light_.link().SetTimeToDark(time); });
  }

  absl::Status Refresh() override {
    // Also of lamps without a timer: their link may know that they are no longer told their levels.
    MutexLock lock(&mutex_);
    if (!refreshing_) {
      refreshing_ = true;
      light_.thread().Post([this] {
        absl::Status refreshed = light_.Noted(light_.link().Refresh());
        MutexLock inner(&mutex_);
        refreshing_ = false;
        refreshed_ = std::move(refreshed);
      });
    }
    return refreshed_;
  }

 private:
  std::vector<float> AllDark() const { return std::vector<float>(info_.count, 0.0f); }
  Light<LampsLink, LampsState>::Apply Setting(std::vector<float> levels) {
    return [this, levels = std::move(levels)]() -> absl::StatusOr<LampsState> {
      ASSIGN_OR_RETURN(std::vector<float> taken, light_.link().Set(levels));
      return LampsState{std::move(taken)};
    };
  }

  LampsInfo info_;
  Mutex mutex_;
  bool refreshing_ ABSL_GUARDED_BY(mutex_) = false;
  absl::Status refreshed_ ABSL_GUARDED_BY(mutex_);  // how the last one went
  Light<LampsLink, LampsState> light_;
};

class LinkedProjector final : public Projector {
 public:
  LinkedProjector(const DeviceContext& context, std::unique_ptr<ProjectorLink> link)
      : light_(context, std::move(link), "PROJECTOR_BUSY") {}
  ~LinkedProjector() override { light_.Close(Showing(Pattern{})); }

  absl::Status Connect(std::string_view driver) { return light_.Connect(driver, &info_); }
  const ProjectorInfo& info() const override { return info_; }

  void Show(const Pattern& pattern, TimePoint deadline, Completion<ProjectorState> done) override {
    light_.Start("showing the pattern", deadline, std::move(done), Showing(pattern));
  }
  void Black(TimePoint deadline, Completion<ProjectorState> done) override {
    light_.Interrupt("going black", deadline, std::move(done), Showing(Pattern{}));
  }
  void Check(TimePoint deadline, Completion<std::monostate> done) override {
    light_.Check(deadline, std::move(done));
  }

 private:
  Light<ProjectorLink, ProjectorState>::Apply Showing(const Pattern& pattern) {
    return [this, pattern]() -> absl::StatusOr<ProjectorState> {
      RETURN_IF_ERROR(light_.link().Show(pattern));
      return ProjectorState{pattern};
    };
  }

  ProjectorInfo info_;
  Light<ProjectorLink, ProjectorState> light_;
};

template <class Device, class Linked, class Link>
absl::StatusOr<std::unique_ptr<Device>> OpenLinked(const DeviceContext& context,
                                                   std::string_view driver,
                                                   std::unique_ptr<Link> link) {
  RETURN_IF_ERROR(DeviceThread::CheckClock(context));
  auto device = std::make_unique<Linked>(context, std::move(link));
  RETURN_IF_ERROR(device->Connect(driver));
  spdlog::info("{}: {} {} opened", context.name, device->info().identity.model,
               device->info().identity.serial);
  return std::unique_ptr<Device>(std::move(device));
}

}  // namespace

absl::StatusOr<std::unique_ptr<Lamps>> OpenLinkedLamps(const DeviceContext& context,
                                                       std::string_view driver,
                                                       std::unique_ptr<LampsLink> link) {
  return OpenLinked<Lamps, LinkedLamps>(context, driver, std::move(link));
}

absl::StatusOr<std::unique_ptr<Projector>> OpenLinkedProjector(
    const DeviceContext& context, std::string_view driver, std::unique_ptr<ProjectorLink> link) {
  return OpenLinked<Projector, LinkedProjector>(context, driver, std::move(link));
}

}  // namespace lightstage
