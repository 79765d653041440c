#include "drivers/canopen/node.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>

#include "absl/strings/str_format.h"
#include "base/own_copy.h"
#include "base/status.h"

namespace lightstage::canopen {
namespace {

constexpr size_t kMostAnswers = 64;
// While waiting, so often it is looked whether the node is lost.
constexpr Duration kLook = std::chrono::milliseconds(20);

double Milliseconds(Duration d) { return Seconds(d) * 1e3; }

constexpr ObjectAddress kDeviceType{0x1000, 0}, kErrorRegister{0x1001, 0}, kDeviceName{0x1008, 0},
    kProducerHeartbeat{0x1017, 0};

}  // namespace

bool IsObjectMissing(const absl::Status& status) { return ErrorReason(status) == "OBJECT_MISSING"; }

Node::Node(std::string device, std::shared_ptr<CanBus> bus, int id, Duration answer_time,
           std::shared_ptr<const Eds> eds)
    : device_(std::move(device)),
      bus_(std::move(bus)),
      id_(id),
      answer_time_(answer_time),
      eds_(std::move(eds)) {}

Node::~Node() { bus_->Remove(id_, this); }

absl::Status Node::Attach() {
  RETURN_IF_ERROR(bus_->Add(id_, device_, this));
  if (absl::Status connected = bus_->Connect(); !connected.ok()) {
    return Annotate(connected, device_);
  }
  MutexLock lock(&mutex_);
  told_ = kNever;
  lost_ = absl::OkStatus();
  watch_ = Duration::zero();
  nmt_state_.reset();
  emergency_.reset();
  pdo_.reset();
  return absl::OkStatus();
}

std::string Node::Where() const {
  return absl::StrCat(device_, ": node ", id_, " on ", bus_->name());
}

absl::Status Node::Fault(absl::StatusCode code, std::string_view reason,
                         const std::string& what) const {
  return WithEmergency(
      Error(code, reason, absl::StrCat(Where(), " ", what),
            {{"device", device_}, {"node", absl::StrCat(id_)}, {"interface", bus_->name()}}));
}

absl::Status Node::WithEmergency(absl::Status status) const {
  const std::optional<Emergency> in_force = emergency();
  if (status.ok() || !in_force.has_value()) return status;
  ErrorMetadata metadata = ErrorMetadataOf(status);
  metadata.emplace_back("emergency", absl::StrFormat("%04X", in_force->code));
  return Error(status.code(), ErrorReason(status),
               absl::StrCat(MessageOf(status), "; it reported ", EmergencyText(*in_force)),
               metadata);
}

// ---- The object dictionary

absl::Status Node::Request(const SdoBytes& bytes) {
  absl::Status sent = bus_->Send(MakeFrame(static_cast<uint16_t>(kSdoClient + id_), bytes));
  return sent.ok() ? sent : Annotate(sent, device_);
}

absl::Status Node::Begin() {
  RETURN_IF_ERROR(Check());
  if (unanswered_) {
    // A node answers in order: once this is answered, what is late will not come any more.
    RETURN_IF_ERROR(Request(EncodeUpload(kErrorRegister)));
    RETURN_IF_ERROR(
        Answer(kErrorRegister, SdoReply::Kind::kUpload, SdoReply::Kind::kUploadBegin, "a read")
            .status());
    unanswered_ = false;
  }
  MutexLock lock(&mutex_);
  answers_.clear();
  return absl::OkStatus();
}

absl::StatusOr<SdoReply> Node::Answer(ObjectAddress object, SdoReply::Kind kind,
                                      SdoReply::Kind or_kind, const char* doing) {
  const TimePoint deadline = clock().Now() + answer_time_;
  std::string other;
  MutexLock lock(&mutex_);
  while (true) {
    while (answers_.empty()) {
      RETURN_IF_ERROR(CheckLocked());
      // By what has been read from the bus: of a machine that stood still the answer may lie there unread.
      const Duration left = deadline - bus_->heard_until();
      if (left <= Duration::zero()) {
        unanswered_ = true;
        mutex_.Unlock();
        absl::Status silent =
            Fault(absl::StatusCode::kDeadlineExceeded, "DEVICE_SILENT",
                  absl::StrFormat("did not answer %s of %s within %g ms%s", doing,
                                  ObjectText(object), Milliseconds(answer_time_), other));
        mutex_.Lock();
        return silent;
      }
      changed_.WaitFor(&mutex_, std::clamp<Duration>(left, std::chrono::milliseconds(1), kLook));
    }
    const auto [frame, heard] = answers_.front();
    answers_.pop_front();
    const SdoReply reply = DecodeSdoReply(frame.bytes());
    const bool abort = reply.kind == SdoReply::Kind::kAbort;
    const bool segment = reply.kind == SdoReply::Kind::kUploadSegment ||
                         reply.kind == SdoReply::Kind::kDownloadSegment;
    if ((reply.kind != kind && reply.kind != or_kind && !abort) ||
        (!segment && reply.object != object)) {
      other = absl::StrCat("; it said ", FrameText(frame), " instead");
      continue;
    }
    if (reply.kind == SdoReply::Kind::kDownload || reply.kind == SdoReply::Kind::kDownloadSegment) {
      confirmed_ = heard;
    }
    if (!abort) return reply;
    mutex_.Unlock();
    const bool missing = reply.abort == kAbortNoObject || reply.abort == kAbortNoSubIndex;
    absl::Status refused =
        Fault(missing ? absl::StatusCode::kNotFound : absl::StatusCode::kFailedPrecondition,
              missing ? "OBJECT_MISSING" : "SDO_ABORTED",
              absl::StrFormat("refused %s of %s: %08Xh, %s", doing, ObjectText(object), reply.abort,
                              AbslView(SdoAbortName(reply.abort))));
    mutex_.Lock();
    return refused;
  }
}

absl::Status Node::Abandon(ObjectAddress object, uint32_t code, absl::Status why) {
  Request(EncodeAbort(object, code)).IgnoreError();  // `why` is what counts
  return why;
}

absl::StatusOr<std::vector<uint8_t>> Node::Read(ObjectAddress object) {
  using Kind = SdoReply::Kind;
  RETURN_IF_ERROR(Begin());
  RETURN_IF_ERROR(Request(EncodeUpload(object)));
  absl::StatusOr<SdoReply> reply = Answer(object, Kind::kUpload, Kind::kUploadBegin, "a read");
  if (ErrorReason(reply.status()) == "DEVICE_SILENT") {
    return Abandon(object, kAbortTimeout, reply.status());
  }
  RETURN_IF_ERROR(reply.status());
  if (reply->kind == Kind::kUpload) {
    return std::vector<uint8_t>(reply->bytes().begin(), reply->bytes().end());
  }
  auto too_long = [&](size_t bytes) {
    return Abandon(object, kAbortMemory,
                   Fault(absl::StatusCode::kInternal, "BAD_ANSWER",
                         absl::StrFormat("answered a read of %s with %d bytes, more than %d",
                                         ObjectText(object), bytes, kLongestValue)));
  };
  const uint32_t total = reply->total;
  if (total > kLongestValue) return too_long(total);
  std::vector<uint8_t> value;
  for (bool toggle = false;; toggle = !toggle) {
    RETURN_IF_ERROR(Request(EncodeUploadSegment(toggle)));
    absl::StatusOr<SdoReply> segment =
        Answer(object, Kind::kUploadSegment, Kind::kUploadSegment, "a read");
    if (ErrorReason(segment.status()) == "DEVICE_SILENT") {
      return Abandon(object, kAbortTimeout, segment.status());
    }
    RETURN_IF_ERROR(segment.status());
    if (segment->toggle != toggle) {
      return Abandon(object, kAbortToggle,
                     Fault(absl::StatusCode::kInternal, "BAD_ANSWER",
                           absl::StrCat("sent a piece of ", ObjectText(object),
                                        " twice or left one out (toggle bit)")));
    }
    value.insert(value.end(), segment->bytes().begin(), segment->bytes().end());
    if (value.size() > kLongestValue) return too_long(value.size());
    if (segment->last) break;
  }
  if (total != 0 && total != value.size()) {
    return Fault(absl::StatusCode::kInternal, "BAD_ANSWER",
                 absl::StrFormat("sent %d bytes of %s after it said %d", value.size(),
                                 ObjectText(object), total));
  }
  return value;
}

absl::Status Node::Transfer(ObjectAddress object, std::span<const uint8_t> value) {
  using Kind = SdoReply::Kind;
  RETURN_IF_ERROR(Request(EncodeDownload(object, value)));
  RETURN_IF_ERROR(Answer(object, Kind::kDownload, Kind::kDownload, "a write").status());
  if (value.size() <= 4 && !value.empty()) return absl::OkStatus();
  bool toggle = false;
  do {
    const size_t size = std::min<size_t>(value.size(), 7);
    RETURN_IF_ERROR(
        Request(EncodeDownloadSegment(toggle, value.first(size), /*last=*/size == value.size())));
    ASSIGN_OR_RETURN(const SdoReply taken,
                     Answer(object, Kind::kDownloadSegment, Kind::kDownloadSegment, "a write"));
    if (taken.toggle != toggle) {
      return Abandon(object, kAbortToggle,
                     Fault(absl::StatusCode::kInternal, "BAD_ANSWER",
                           absl::StrCat("confirmed another piece of ", ObjectText(object),
                                        " than was written (toggle bit)")));
    }
    value = value.subspan(size);
    toggle = !toggle;
  } while (!value.empty());
  return absl::OkStatus();
}

absl::Status Node::Write(ObjectAddress object, std::span<const uint8_t> value) {
  RETURN_IF_ERROR(Begin());
  {
    MutexLock lock(&mutex_);
    told_ = std::min(told_, clock().Now());
  }
  absl::Status written = Transfer(object, value);
  if (ErrorReason(written) != "DEVICE_SILENT") return written;
  return Abandon(object, kAbortTimeout, written);
}

absl::StatusOr<uint32_t> Node::ReadUnsigned(ObjectAddress object) {
  ASSIGN_OR_RETURN(const std::vector<uint8_t> value, Read(object));
  if (!value.empty() && value.size() <= 4) return LittleEndian(value);
  return Fault(absl::StatusCode::kInternal, "BAD_ANSWER",
               absl::StrFormat("answered a read of %s with %d bytes instead of 1 to 4",
                               ObjectText(object), value.size()));
}

absl::StatusOr<int32_t> Node::ReadSigned(ObjectAddress object) {
  ASSIGN_OR_RETURN(const std::vector<uint8_t> value, Read(object));
  if (!value.empty() && value.size() <= 4) return SignedLittleEndian(value);
  return Fault(absl::StatusCode::kInternal, "BAD_ANSWER",
               absl::StrFormat("answered a read of %s with %d bytes instead of 1 to 4",
                               ObjectText(object), value.size()));
}

absl::StatusOr<std::optional<uint32_t>> Node::ReadOptional(ObjectAddress object) {
  absl::StatusOr<uint32_t> value = ReadUnsigned(object);
  if (IsObjectMissing(value.status())) return std::optional<uint32_t>();
  RETURN_IF_ERROR(value.status());
  return std::optional<uint32_t>(*value);
}

absl::Status Node::WriteInteger(ObjectAddress object, int64_t value, int size) {
  if (eds_ != nullptr) {
    if (absl::Status allowed = eds_->CheckWrite(object, value); !allowed.ok()) {
      return Annotate(allowed, Where());
    }
  }
  std::array<uint8_t, 4> bytes{};
  for (int i = 0; i < size; ++i) bytes[i] = static_cast<uint8_t>(value >> (8 * i));
  return Write(object, std::span(bytes).first(size));
}

absl::StatusOr<bool> Node::WriteOptional(ObjectAddress object, int64_t value, int size) {
  absl::Status written = WriteInteger(object, value, size);
  if (IsObjectMissing(written)) return false;
  RETURN_IF_ERROR(written);
  return true;
}

absl::StatusOr<NodeIdentity> Node::ReadIdentity() {
  NodeIdentity identity;
  ASSIGN_OR_RETURN(identity.device_type, ReadUnsigned(kDeviceType));
  uint32_t* const parts[] = {&identity.vendor, &identity.product, &identity.revision,
                             &identity.serial};
  for (uint8_t sub = 1; sub <= 4; ++sub) {
    ASSIGN_OR_RETURN(const std::optional<uint32_t> part, ReadOptional({0x1018, sub}));
    *parts[sub - 1] = part.value_or(0);
  }
  absl::StatusOr<std::vector<uint8_t>> name = Read(kDeviceName);
  if (!name.ok() && ErrorReason(name.status()) != "OBJECT_MISSING" &&
      ErrorReason(name.status()) != "SDO_ABORTED") {
    return name.status();
  }
  if (name.ok()) {
    for (uint8_t c : *name) {
      if (c >= 0x20 && c < 0x7F) identity.name.push_back(static_cast<char>(c));
    }
  }
  return identity;
}

// ---- What it says by itself

absl::Status Node::WatchHeartbeat(Duration time) {
  heartbeat_period_ms_ = std::max<int64_t>(1, time / std::chrono::milliseconds(3));
  RETURN_IF_ERROR(WriteInteger(kProducerHeartbeat, heartbeat_period_ms_, 2));
  MutexLock lock(&mutex_);
  last_heartbeat_ = clock().Now();
  watch_ = time;
  return absl::OkStatus();
}

void Node::LoseLocked(const std::string& what) const {
  if (!lost_.ok()) return;
  const std::string emergency =
      emergency_.has_value() ? absl::StrCat("; it reported ", EmergencyText(*emergency_)) : "";
  lost_ = Error(absl::StatusCode::kUnavailable, "DEVICE_LOST",
                absl::StrCat(Where(), " ", what, emergency),
                {{"device", device_}, {"node", absl::StrCat(id_)}, {"interface", bus_->name()}});
  spdlog::warn("{}", MessageOf(lost_));
  changed_.SignalAll();
}

absl::Status Node::CheckLocked() const {
  if (lost_.ok() && watch_ > Duration::zero() && bus_->heard_until() - last_heartbeat_ > watch_) {
    LoseLocked(absl::StrFormat("has not been heard for %g ms", Milliseconds(watch_)));
  }
  return OwnCopy(lost_);
}

absl::Status Node::Check() const {
  MutexLock lock(&mutex_);
  return CheckLocked();
}

absl::Status Node::Start(Duration patience) {
  constexpr NmtState state = NmtState::kOperational;
  RETURN_IF_ERROR(Check());
  const TimePoint deadline = clock().Now() + patience;
  if (absl::Status sent = bus_->Send(EncodeNmt(NmtCommand::kStart, id_)); !sent.ok()) {
    return Annotate(sent, device_);
  }
  // A node does one after the other: once it has answered this, heartbeats from before the command have been heard.
  RETURN_IF_ERROR(Read(kErrorRegister).status());
  uint64_t before;
  {
    MutexLock lock(&mutex_);
    before = heartbeats_;
  }
  // When its period is set, it begins at once (CiA 301, 7.2.8.3.2), so that the next one need not be waited for.
  RETURN_IF_ERROR(WriteInteger(kProducerHeartbeat, heartbeat_period_ms_, 2));
  MutexLock lock(&mutex_);
  while (heartbeats_ == before || nmt_state_ != state) {
    RETURN_IF_ERROR(CheckLocked());
    const Duration left = deadline - clock().Now();
    if (left <= Duration::zero()) {
      const std::string is =
          nmt_state_.has_value() ? "is " + NmtStateName(*nmt_state_) : "gives no heartbeat";
      mutex_.Unlock();
      absl::Status silent = Fault(absl::StatusCode::kDeadlineExceeded, "DEVICE_SILENT",
                                  absl::StrFormat("%s %g ms after it was told to be %s", is,
                                                  Milliseconds(patience), NmtStateName(state)));
      mutex_.Lock();
      return silent;
    }
    changed_.WaitFor(&mutex_, std::min(left, kLook));
  }
  return absl::OkStatus();
}

std::optional<NmtState> Node::nmt_state() const {
  MutexLock lock(&mutex_);
  return nmt_state_;
}

std::optional<Node::Pdo> Node::FreshPdo(Duration age) const {
  MutexLock lock(&mutex_);
  if (!pdo_.has_value() || pdo_heard_ <= confirmed_ || clock().Now() - pdo_->time > age) {
    return std::nullopt;
  }
  return pdo_;
}

std::optional<Emergency> Node::emergency() const {
  MutexLock lock(&mutex_);
  return emergency_;
}

void Node::OnFrame(const CanFrame& frame, TimePoint time) {
  MutexLock lock(&mutex_);
  ++heard_;
  switch (frame.id & kFunctionMask) {
    case kSdoServer:
      if (answers_.size() == kMostAnswers) answers_.pop_front();
      answers_.emplace_back(frame, heard_);
      break;
    case kTpdo1:
      pdo_ = Pdo{frame, time};
      pdo_heard_ = heard_;
      break;
    case kEmergency:
      if (const std::optional<Emergency> emergency = DecodeEmergency(frame.bytes())) {
        if (emergency->code >> 8 == 0) {
          emergency_.reset();  // it says that all errors are gone
        } else {
          emergency_ = emergency;
          spdlog::warn("{} reports {}", Where(), EmergencyText(*emergency));
        }
      }
      break;
    case kHeartbeat:
      if (const std::optional<NmtState> state = DecodeHeartbeat(frame.bytes())) {
        // One that boots before it was told anything has forgotten nothing.
        if (*state == NmtState::kBootUp && time >= told_)
          LoseLocked("booted: it was switched on or reset");
        if (watch_ > Duration::zero() && time - last_heartbeat_ > watch_) {
          LoseLocked(absl::StrFormat("was not heard for %g ms, more than %g ms",
                                     Milliseconds(time - last_heartbeat_), Milliseconds(watch_)));
        }
        last_heartbeat_ = std::max(last_heartbeat_, time);
        nmt_state_ = state;
        ++heartbeats_;
      }
      break;
    default:
      return;
  }
  changed_.SignalAll();
}

void Node::OnTrouble(const absl::Status& why) {
  MutexLock lock(&mutex_);
  if (lost_.ok()) lost_ = Annotate(why, device_);
  changed_.SignalAll();
}

}  // namespace lightstage::canopen
