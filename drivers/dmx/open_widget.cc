#include <spdlog/spdlog.h>

#include <array>
#include <thread>
#include <utility>
#include <vector>

#include "absl/base/thread_annotations.h"
#include "absl/strings/str_cat.h"
#include "base/mutex.h"
#include "drivers/dmx/ftdi.h"
#include "drivers/dmx/widget.h"

namespace lightstage::dmx {
namespace {

using std::chrono::milliseconds;

// So long the device may take beyond what the line needs.
constexpr Duration kPatience = milliseconds(250);
// From one look at the transmitter to the next; a full-speed control transfer takes about as long.
constexpr Duration kPoll = milliseconds(1);

class OpenWidget final : public DmxWidget {
 public:
  OpenWidget(std::unique_ptr<UsbPort> port, Clock& clock, size_t slots, double frame_hz)
      : clock_(clock),
        period_(FromSeconds(1 / frame_hz)),
        line_time_(LineTime(slots + 1)),
        identity_(port->identity()),
        slots_(slots, 0),
        port_(std::move(port)) {}

  ~OpenWidget() override {
    {
      MutexLock lock(&mutex_);
      quit_ = true;
      changed_.SignalAll();
    }
    if (thread_.joinable()) thread_.join();
  }

  absl::Status Start() {
    RETURN_IF_ERROR(Prepare());
    thread_ = std::thread([this] { Run(); });
    return absl::OkStatus();
  }

  std::string model() const override {
    return absl::StrCat("Open DMX (", identity_.manufacturer, " ", identity_.product, ")");
  }
  std::string serial() const override { return identity_.serial; }

  absl::Status Show(std::span<const uint8_t> slots) override {
    MutexLock lock(&mutex_);
    slots_.assign(slots.begin(), slots.end());
    const uint64_t wanted = ++wanted_;
    changed_.SignalAll();
    // The thread's own limits are far shorter.
    const TimePoint deadline = clock_.Now() + std::chrono::seconds(2);
    while (failure_.ok() && shown_ < wanted) {
      const Duration left = deadline - clock_.Now();
      if (left <= Duration::zero()) {
        return Error(absl::StatusCode::kDeadlineExceeded, "DEVICE_SILENT",
                     "no whole frame was sent within 2 s");
      }
      changed_.WaitFor(&mutex_, left);
    }
    return failure_;
  }

  absl::Status Check() override {
    MutexLock lock(&mutex_);
    return failure_;
  }

 private:
  // The chip in a known state, nothing in its buffers, the line at rest. RTS low (not asserted) switches the line driver on: QLC+ and
  // others do the same.
  absl::Status Prepare() {
    const std::optional<UsbRequest> baud = FtdiBaudRequest(250000);
    for (const UsbRequest& request :
         {FtdiResetRequest(FtdiReset::kAll), FtdiResetRequest(FtdiReset::kPurgeRx),
          FtdiResetRequest(FtdiReset::kPurgeTx), *baud, FtdiDataRequest(false),
          FtdiNoFlowControlRequest(), FtdiDtrRequest(false), FtdiRtsRequest(false),
          FtdiLatencyRequest(1)}) {
      RETURN_IF_ERROR(port_->Control(request, kPatience));
    }
    return absl::OkStatus();
  }

  // ---- The frame thread.

  void Run() {
    TimePoint next = clock_.Now();
    MutexLock lock(&mutex_);
    while (!quit_) {
      // New slots do not wait for their turn.
      const TimePoint now = clock_.Now();
      if (now < next && begun_ == wanted_) {
        changed_.WaitFor(&mutex_, next - now);
        continue;
      }
      begun_ = wanted_;
      std::vector<uint8_t> frame = {kStartCode};
      frame.insert(frame.end(), slots_.begin(), slots_.end());
      mutex_.Unlock();
      next = now + period_;
      absl::Status sent = SendFrame(frame);
      if (sent.ok() && clock_.Now() - now < kBreakToBreak) SleepFor(clock_, kBreakToBreak);
      mutex_.Lock();
      if (!sent.ok()) {
        failure_ = Annotate(sent, "frames are no longer sent");
        spdlog::error("dmx: widget {}: {}", identity_.serial, MessageOf(failure_));
        break;
      }
      shown_ = begun_;
      changed_.SignalAll();
    }
    if (failure_.ok()) {
      failure_ = Error(absl::StatusCode::kUnavailable, "DEVICE_LOST", "closed");
    }
    port_.reset();  // what failed is given back at once, so that it can be opened anew
    changed_.SignalAll();
  }

  // Returns when all of it is on the line: the chip has taken every byte, had the time to send them, and says that it has none left.
  absl::Status SendFrame(std::span<const uint8_t> frame) {
    RETURN_IF_ERROR(Annotate(port_->Control(FtdiDataRequest(true), kPatience), "break"));
    SleepFor(clock_, kBreak);
    RETURN_IF_ERROR(Annotate(port_->Control(FtdiDataRequest(false), kPatience), "end of break"));
    SleepFor(clock_, kMark);
    const TimePoint begin = clock_.Now();
    absl::StatusOr<size_t> taken = port_->BulkOut(frame, line_time_ + kPatience);
    if (!taken.ok()) return Annotate(taken.status(), "frame");
    if (*taken != frame.size()) {
      return Error(
          absl::StatusCode::kDeadlineExceeded, "DEVICE_SILENT",
          absl::StrCat("the device took ", *taken, " of a frame's ", frame.size(), " bytes"),
          {{"bytes", absl::StrCat(*taken)}, {"frame_bytes", absl::StrCat(frame.size())}});
    }
    return Drain(begin);
  }

  absl::Status Drain(TimePoint begin) {
    const TimePoint give_up = clock_.Now() + line_time_ + kPatience;
    while (true) {
      // The status request is answered at once; packets on the IN endpoint may have been made before the frame.
      std::array<uint8_t, 2> bytes{};
      absl::StatusOr<size_t> count = port_->ControlIn(FtdiStatusRequest(), bytes, kPatience);
      if (!count.ok()) return Annotate(count.status(), "line status");
      const std::optional<FtdiStatus> status = DecodeFtdiStatus(std::span(bytes).first(*count));
      if (!status.has_value()) {
        return Error(absl::StatusCode::kFailedPrecondition, "DEVICE_FAULT",
                     absl::StrCat("the line status has ", *count, " bytes, not 2"),
                     {{"bytes", absl::StrCat(*count)}});
      }
      const TimePoint now = clock_.Now();
      if (status->transmitter_empty() && now >= begin + line_time_) return absl::OkStatus();
      if (now >= give_up) {
        return Error(absl::StatusCode::kDeadlineExceeded, "DEVICE_SILENT",
                     "the device still holds bytes of a frame that should be on the line");
      }
      SleepFor(clock_, kPoll);
    }
  }

  Clock& clock_;
  const Duration period_, line_time_;
  const UsbIdentity identity_;

  Mutex mutex_;
  CondVar changed_;
  bool quit_ ABSL_GUARDED_BY(mutex_) = false;
  std::vector<uint8_t> slots_ ABSL_GUARDED_BY(mutex_);
  // Counts of Show(): asked for, in the frame that was begun last, in one that is out.
  uint64_t wanted_ ABSL_GUARDED_BY(mutex_) = 0, begun_ ABSL_GUARDED_BY(mutex_) = 0,
                   shown_ ABSL_GUARDED_BY(mutex_) = 0;
  absl::Status failure_ ABSL_GUARDED_BY(mutex_);  // why the thread has ended

  std::unique_ptr<UsbPort> port_;  // the thread's, once there is one
  std::thread thread_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<DmxWidget>> StartOpenWidget(std::unique_ptr<UsbPort> port,
                                                           Clock& clock, size_t slots,
                                                           double frame_hz) {
  auto widget = std::make_unique<OpenWidget>(std::move(port), clock, slots, frame_hz);
  RETURN_IF_ERROR(widget->Start());
  return std::unique_ptr<DmxWidget>(std::move(widget));
}

}  // namespace lightstage::dmx
