// A DLPC350 as a state machine: it takes and gives raw reports of 64 bytes, and lights the simulated rig's projector. It has a codec
// of its own, so that the driver's is not checked against itself.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <tuple>
#include <vector>

#include "absl/base/thread_annotations.h"
#include "base/mutex.h"
#include "optics/pattern.h"
#include "sim/rig/world.h"

namespace lightstage::sim {

// Bit planes of a flash image: its index, pattern number and depth.
using FlashPlace = std::tuple<int, int, int>;

// Thread-safe.
class Dlpc350Device {
 public:
  static constexpr size_t kReportSize = 64;

  // Known field faults. They hold until they are cleared.
  struct Faults {
    int nack = -1;                   // this command, CMD2 · 256 + CMD3, is refused
    int ignored = -1;                // the setting of this command is acknowledged but not taken
    bool short_reports = false;      // replies lose their last bytes
    bool parked = false;             // the mirrors are parked
    bool sequencer_stopped = false;  // it never runs, whatever is said of start
    bool frozen = false;             // the video picture is held
    bool silent = false;             // nothing is answered
    bool late = false;               // answers come only when the next command does
    uint8_t hardware_errors = 0;     // bits of the hardware status
  };

  // What takes its time in a real one: so long after a new display mode, start or stop was acknowledged it comes into force, and until it is
  // awake from standby it answers nothing.
  void SetSlowness(Duration slow);

  // `world` is what it lights; may be null. `flash` is what its images show, by place.
  Dlpc350Device(std::shared_ptr<World> world, std::map<FlashPlace, Pattern> flash);
  ~Dlpc350Device();

  // One report from the host, of any length. False if it is unplugged.
  bool Receive(std::span<const uint8_t> report);
  // The next report to the host, if there is one by `patience`; nothing and `*unplugged` if it is or becomes so.
  std::optional<std::vector<uint8_t>> Send(Duration patience, bool* unplugged);

  void SetFaults(const Faults& faults);
  void Unplug(bool out);
  // It falls back to what it is after power-on; into standby if so.
  void PowerCycle(bool standby);
  // What is on the video input, which has a pixel for each mirror.
  void SetVideoInput(const Projection& picture);
  // A pulse on trigger in 1.
  void TriggerIn();

  // What is on the wall now; nothing: pixels of the video input.
  std::optional<Pattern> OnWall();
  // The LEDs' currents, 0 none to 255; none while they are off.
  std::array<int, 3> LedCurrents() const;
  // The value of a setting as it was last taken, for tests; empty if it never was.
  std::vector<uint8_t> Setting(int command) const;
  int woken() const;           // how often it was told to leave standby
  bool enabled_early() const;  // its LEDs were ever enabled while its sequencer stood

 private:
  using Bytes = std::vector<uint8_t>;

  void ComeIntoForceLocked() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void ResetLocked(bool standby) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void ExecuteLocked() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  bool WriteLocked(int command, const Bytes& data) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  std::optional<Bytes> ReadLocked(int command) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void ReplyLocked(uint8_t flags, uint8_t sequence, const Bytes& data)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  uint8_t ValidationLocked() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  bool RunningLocked() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  bool LitLocked() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  Projection ShownLocked() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void LightLocked() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  const std::shared_ptr<World> world_;  // shared with the rig's other devices
  const std::map<FlashPlace, Pattern> flash_;

  mutable Mutex mutex_;
  CondVar changed_;
  Faults faults_ ABSL_GUARDED_BY(mutex_);
  bool unplugged_ ABSL_GUARDED_BY(mutex_) = false;
  Bytes message_ ABSL_GUARDED_BY(mutex_);  // as far as it has come
  std::deque<Bytes> replies_ ABSL_GUARDED_BY(mutex_);
  std::deque<Bytes> held_back_ ABSL_GUARDED_BY(mutex_);
  std::map<int, Bytes> settings_ ABSL_GUARDED_BY(mutex_);                    // by command
  Bytes images_ ABSL_GUARDED_BY(mutex_), patterns_ ABSL_GUARDED_BY(mutex_);  // the mailboxes
  bool standby_ ABSL_GUARDED_BY(mutex_) = false;
  using Steady = std::chrono::steady_clock;
  Duration slow_ ABSL_GUARDED_BY(mutex_){};
  std::map<int, std::pair<Steady::time_point, Bytes>> to_come_
      ABSL_GUARDED_BY(mutex_);  // by command
  bool validated_ ABSL_GUARDED_BY(mutex_) = false;
  int validation_reads_ ABSL_GUARDED_BY(mutex_) = 0;  // still busy for so many
  bool triggered_ ABSL_GUARDED_BY(mutex_) = false;
  int woken_ ABSL_GUARDED_BY(mutex_) = 0;
  bool enabled_early_ ABSL_GUARDED_BY(mutex_) = false;
  Projection video_ ABSL_GUARDED_BY(mutex_);
  Projection on_wall_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace lightstage::sim
