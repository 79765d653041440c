// A simulated CANopen node (CiA 301): boot-up, NMT, SDO server, heartbeat said and watched, emergencies and one TPDO. What it is for is
// its profile's. One thread; faults may be put in from any.
#pragma once

#include <atomic>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "absl/base/thread_annotations.h"
#include "absl/functional/function_ref.h"
#include "base/mutex.h"
#include "drivers/canopen/can_port.h"
#include "sim/peers/canopen/object_dictionary.h"

namespace lightstage::sim {

struct PeerIdentity {
  int node = 1;
  uint32_t device_type = 0;
  uint32_t vendor = 0x0000017F, product = 1, revision = 0x00010000, serial = 4711;
  std::string name;
};

// What a node does beside communicating. All calls come with the node's lock held.
class PeerProfile {
 public:
  virtual ~PeerProfile() = default;
  // Adds its objects; again after every reset.
  virtual void Declare(ObjectDictionary& objects) = 0;
  virtual void Tick(TimePoint /*now*/) {}
  virtual void NmtChanged(bool /*operational*/) {}
  // The heartbeat that it watches stayed away.
  virtual void MasterLost() {}
};

class PeerNode {
 public:
  // The profile outlives the node. Boots at Start().
  PeerNode(std::unique_ptr<canopen::CanPort> port, const PeerIdentity& identity,
           PeerProfile& profile, Clock& clock);
  ~PeerNode();
  void Start();

  // Runs `change` with the lock held, as the profile's calls are.
  void Do(absl::FunctionRef<void(ObjectDictionary&)> change);
  bool operational() const;
  uint32_t Value(uint16_t index, uint8_t sub) const;
  std::string TextOf(uint16_t index, uint8_t sub) const;

  // ---- Faults

  // Hears nothing and says nothing, as if its cable were off.
  void SetSilent(bool silent);
  // Every SDO answer comes so much later.
  void DelayAnswers(Duration delay);
  // As after a power failure: boots and has its defaults.
  void Reboot();
  // From within the profile too.
  void Emergency(uint16_t code, uint8_t error_register);

  canopen::CanPort& port() { return *port_; }

 private:
  void Run();
  void Hear(const canopen::CanFrame& frame, TimePoint now) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void Boot() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void DeclareCommunication() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void SetState(uint8_t state) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void SayWhatIsDue(TimePoint now) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void SayPdo(TimePoint now) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void Say(uint16_t id, std::vector<uint8_t> bytes);

  const std::unique_ptr<canopen::CanPort> port_;
  const PeerIdentity identity_;
  PeerProfile& profile_;
  Clock& clock_;
  std::atomic<bool> quit_{false}, silent_{false};
  std::atomic<int64_t> delay_ns_{0};

  mutable Mutex mutex_;
  ObjectDictionary objects_ ABSL_GUARDED_BY(mutex_);
  SdoServer server_ ABSL_GUARDED_BY(mutex_){objects_};
  uint8_t state_ ABSL_GUARDED_BY(mutex_) = 0;
  TimePoint said_ ABSL_GUARDED_BY(mutex_){};  // its last heartbeat
  std::optional<TimePoint> master_heard_ ABSL_GUARDED_BY(mutex_);
  bool master_lost_ ABSL_GUARDED_BY(mutex_) = false;
  std::vector<uint8_t> pdo_ ABSL_GUARDED_BY(mutex_);  // as last said
  TimePoint pdo_said_ ABSL_GUARDED_BY(mutex_){};
  std::thread thread_;
};

}  // namespace lightstage::sim
