// One CAN interface as all devices on it share it: one thread receives and gives each frame to the node whose it is, and says
// heartbeats in time. Any thread, except where said.
#pragma once

#include <atomic>
#include <map>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "absl/base/thread_annotations.h"
#include "base/mutex.h"
#include "drivers/canopen/can_port.h"
#include "drivers/canopen/messages.h"

namespace lightstage::canopen {

// Who wants to hear one node. Called on the bus's thread with a lock of the bus held: must not call the bus.
class NodeListener {
 public:
  virtual ~NodeListener() = default;
  virtual void OnFrame(const CanFrame& frame, TimePoint time) = 0;
  // Nothing gets through any more; until the bus is connected anew.
  virtual void OnTrouble(const absl::Status& why) = 0;
};

class CanBus {
 public:
  // The bus of `name`, which all that ask with the same clock share while one of them holds it; `open` makes its port, now or
  // at Connect().
  static std::shared_ptr<CanBus> Shared(const std::string& name, Clock& clock, CanPortOpener open);
  // The bus that is held by somebody, or none.
  static std::shared_ptr<CanBus> Find(const std::string& name);

  CanBus(std::string name, Clock& clock, CanPortOpener open);
  ~CanBus();
  CanBus(const CanBus&) = delete;
  CanBus& operator=(const CanBus&) = delete;

  const std::string& name() const { return name_; }
  Clock& clock() const { return clock_; }

  // Opens the port if there is none or it is of no more use. UNAVAILABLE / DEVICE_LOST, also while the controller is bus-off.
  absl::Status Connect();
  absl::Status Send(const CanFrame& frame);
  // OK while frames can go through.
  absl::Status trouble() const;
  CanState state() const { return state_.load(); }

  // One listener a node; FAILED_PRECONDITION / NODE_TAKEN. After Remove() it is not called any more.
  absl::Status Add(int node, const std::string& device, NodeListener* listener);
  void Remove(int node, NodeListener* listener);

  // Our own heartbeat as node `id`: a period of 0 only claims the id, for SayHeartbeat(). Periodic and claimed ids exclude each other,
  // since a node that watches one must not be kept content by another's: FAILED_PRECONDITION / NODE_TAKEN. Ids that are periodic may be shared;
  // the shortest period holds.
  absl::Status AddHeartbeat(int id, Duration period, const void* owner);
  void RemoveHeartbeat(const void* owner);
  absl::Status SayHeartbeat(int id) { return Send(EncodeHeartbeat(id, NmtState::kOperational)); }

  // Up to when everything that was on the bus has been given to the listeners. Silence is to be judged by it, so that a machine
  // that was busy does not take its own lateness for a node's.
  TimePoint heard_until() const { return TimePoint(Duration(heard_until_.load())); }

 private:
  struct Heartbeat {
    const void* owner;
    int id;
    Duration period;
  };

  void Run(CanPort& port);
  // Says the heartbeats that are due; when the next one is.
  TimePoint SayDueHeartbeats(CanPort& port);
  void Dispatch(const CanEvent& event);
  void Fail(const absl::Status& why, bool useless);
  absl::Status BusOff() const;

  const std::string name_;
  Clock& clock_;
  std::atomic<int64_t> heard_until_{0};
  std::atomic<CanState> state_{CanState::kActive};
  std::atomic<bool> quit_{false};  // the thread is to end

  Mutex connecting_;  // before mutex_
  CanPortOpener open_ ABSL_GUARDED_BY(connecting_);
  std::thread thread_ ABSL_GUARDED_BY(connecting_);

  mutable Mutex mutex_;
  std::shared_ptr<CanPort> port_ ABSL_GUARDED_BY(mutex_);  // shared: with a Send in progress
  absl::Status trouble_ ABSL_GUARDED_BY(mutex_);
  bool useless_ ABSL_GUARDED_BY(mutex_) = false;  // the port: it is to be opened anew
  std::vector<Heartbeat> heartbeats_ ABSL_GUARDED_BY(mutex_);
  std::map<int, TimePoint> said_ ABSL_GUARDED_BY(mutex_);  // periodic heartbeats, by id

  Mutex listening_;  // held while listeners are called
  std::map<int, std::pair<NodeListener*, std::string>> listeners_ ABSL_GUARDED_BY(listening_);
};

}  // namespace lightstage::canopen
