// A node of the bus as its master sees it: its object dictionary, and what it says by itself – heartbeat, boot-up, emergencies,
// TPDO 1. Calls that talk to it block, come from one thread, and wait at most `answer_time` for each frame of an answer.
//
// Errors: UNAVAILABLE / DEVICE_LOST, kept until Attach(): the bus failed, the node booted after it was written to, or its heartbeat stayed away.
// DEADLINE_EXCEEDED / DEVICE_SILENT: no answer. NOT_FOUND / OBJECT_MISSING and FAILED_PRECONDITION / SDO_ABORTED: what it refused, and
// why. INTERNAL / BAD_ANSWER: an answer that is none. All name device, node and object, and an emergency that is in force.
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/base/thread_annotations.h"
#include "absl/status/statusor.h"
#include "base/mutex.h"
#include "drivers/canopen/can_bus.h"
#include "drivers/canopen/eds.h"
#include "drivers/canopen/messages.h"
#include "drivers/canopen/sdo.h"

namespace lightstage::canopen {

// An answer to a read that takes more is refused.
constexpr size_t kLongestValue = 4096;

struct NodeIdentity {
  uint32_t device_type = 0;                                    // 1000h
  uint32_t vendor = 0, product = 0, revision = 0, serial = 0;  // 1018h; 0: not given
  std::string name;                                            // 1008h; empty: not given
};

class Node final : public NodeListener {
 public:
  struct Pdo {
    CanFrame frame;
    TimePoint time{};
  };

  // `eds` may be none; it outlives the node, as the bus does. `device` is the device's name, for messages.
  Node(std::string device, std::shared_ptr<CanBus> bus, int id, Duration answer_time,
       std::shared_ptr<const Eds> eds);
  ~Node() override;

  // Connects the bus, listens, and forgets what was lost.
  absl::Status Attach();

  // ---- The object dictionary

  absl::StatusOr<std::vector<uint8_t>> Read(ObjectAddress object);
  // An integer of 1 to 4 bytes; BAD_ANSWER otherwise.
  absl::StatusOr<uint32_t> ReadUnsigned(ObjectAddress object);
  absl::StatusOr<int32_t> ReadSigned(ObjectAddress object);
  // Objects that a node need not have: nothing if it does not.
  absl::StatusOr<std::optional<uint32_t>> ReadOptional(ObjectAddress object);

  absl::Status Write(ObjectAddress object, std::span<const uint8_t> value);
  // The lowest `size` bytes of `value`. Checked against the EDS first: OUT_OF_RANGE / OBJECT_LIMIT, FAILED_PRECONDITION / OBJECT_READ_ONLY.
  absl::Status WriteInteger(ObjectAddress object, int64_t value, int size);
  // False if the node does not have the object.
  absl::StatusOr<bool> WriteOptional(ObjectAddress object, int64_t value, int size);

  absl::StatusOr<NodeIdentity> ReadIdentity();

  // ---- What it says by itself

  // Has it say a heartbeat every third of `time`, and takes it for lost when none comes for `time`.
  absl::Status WatchHeartbeat(Duration time);
  absl::Status Check() const;
  // Makes it operational, as its heartbeat then confirms. After WatchHeartbeat(). DEVICE_SILENT after `patience`.
  absl::Status Start(Duration patience);
  // As its last heartbeat said; nothing before the first.
  std::optional<NmtState> nmt_state() const;
  // The last TPDO 1 that came after the last answer to a write and is not older than `age`.
  std::optional<Pdo> FreshPdo(Duration age) const;
  std::optional<Emergency> emergency() const;
  // The same error, with the emergency that is in force named.
  absl::Status WithEmergency(absl::Status status) const;

  int id() const { return id_; }
  CanBus& bus() { return *bus_; }
  Clock& clock() const { return bus_->clock(); }
  std::string Where() const;  // "turntable: node 5 on can0"
  absl::Status Fault(absl::StatusCode code, std::string_view reason, const std::string& what) const;

 private:
  void OnFrame(const CanFrame& frame, TimePoint time) override;
  void OnTrouble(const absl::Status& why) override;

  absl::Status CheckLocked() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void LoseLocked(const std::string& what) const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  absl::Status Request(const SdoBytes& bytes);
  // The next answer of kind `kind`, which for all but segments is about `object`; an abort is an error.
  absl::StatusOr<SdoReply> Answer(ObjectAddress object, SdoReply::Kind kind, SdoReply::Kind or_kind,
                                  const char* doing);
  // Before a transfer: after an answer that came too late or never, makes sure that it is not taken for the next one's.
  absl::Status Begin();
  absl::Status Abandon(ObjectAddress object, uint32_t code, absl::Status why);
  absl::Status Transfer(ObjectAddress object, std::span<const uint8_t> value);

  const std::string device_;
  const std::shared_ptr<CanBus> bus_;  // shared: by all devices on it
  const int id_;
  const Duration answer_time_;
  const std::shared_ptr<const Eds> eds_;  // shared: with the options it was read with
  int64_t heartbeat_period_ms_ = 0;       // the caller's thread, like this
  bool unanswered_ = false;               // the caller's thread: an answer may still come

  mutable Mutex mutex_;
  mutable CondVar changed_;
  TimePoint told_
      ABSL_GUARDED_BY(mutex_){};  // when it was first written to since Attach(); kNever: not yet
  mutable absl::Status lost_ ABSL_GUARDED_BY(mutex_);
  std::deque<std::pair<CanFrame, uint64_t>> answers_ ABSL_GUARDED_BY(mutex_);
  uint64_t heard_ ABSL_GUARDED_BY(mutex_) = 0;      // frames of this node so far
  uint64_t confirmed_ ABSL_GUARDED_BY(mutex_) = 0;  // `heard_` at the last answer to a write
  Duration watch_ ABSL_GUARDED_BY(mutex_){};
  TimePoint last_heartbeat_ ABSL_GUARDED_BY(mutex_){};
  uint64_t heartbeats_ ABSL_GUARDED_BY(mutex_) = 0;
  std::optional<NmtState> nmt_state_ ABSL_GUARDED_BY(mutex_);
  std::optional<Emergency> emergency_ ABSL_GUARDED_BY(mutex_);
  std::optional<Pdo> pdo_ ABSL_GUARDED_BY(mutex_);
  uint64_t pdo_heard_ ABSL_GUARDED_BY(mutex_) = 0;
};

// Whether `status` says that the node does not have the object.
bool IsObjectMissing(const absl::Status& status);

}  // namespace lightstage::canopen
