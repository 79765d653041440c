#include "sim/peers/canopen/object_dictionary.h"

#include <algorithm>

namespace lightstage::sim {
namespace {

constexpr size_t kLongest = 1024;

}  // namespace

void ObjectDictionary::Constant(uint16_t index, uint8_t sub, int size, uint32_t value) {
  entries_[{index, sub}] = {.size = size, .value = value};
}

void ObjectDictionary::Variable(uint16_t index, uint8_t sub, int size, uint32_t value,
                                OnWrite on_write) {
  entries_[{index, sub}] = {
      .size = size, .writable = true, .value = value, .on_write = std::move(on_write)};
}

void ObjectDictionary::Live(uint16_t index, uint8_t sub, int size, OnRead on_read) {
  entries_[{index, sub}] = {.size = size, .on_read = std::move(on_read)};
}

void ObjectDictionary::Text(uint16_t index, uint8_t sub, std::string text, bool writable) {
  entries_[{index, sub}] = {.writable = writable, .text = std::move(text)};
}

void ObjectDictionary::Remove(uint16_t index) {
  std::erase_if(entries_, [&](const auto& entry) { return entry.first.first == index; });
}

bool ObjectDictionary::HasIndex(uint16_t index) const {
  auto at = entries_.lower_bound({index, 0});
  return at != entries_.end() && at->first.first == index;
}

uint32_t ObjectDictionary::Value(uint16_t index, uint8_t sub) const {
  auto at = entries_.find({index, sub});
  if (at == entries_.end()) return 0;
  return at->second.on_read ? at->second.on_read() : at->second.value;
}

void ObjectDictionary::Put(uint16_t index, uint8_t sub, uint32_t value) {
  auto at = entries_.find({index, sub});
  if (at != entries_.end()) at->second.value = value;
}

std::string ObjectDictionary::TextOf(uint16_t index, uint8_t sub) const {
  auto at = entries_.find({index, sub});
  return at == entries_.end() ? "" : at->second.text;
}

uint32_t ObjectDictionary::Read(uint16_t index, uint8_t sub, std::vector<uint8_t>* bytes) const {
  auto at = entries_.find({index, sub});
  if (at == entries_.end()) return HasIndex(index) ? 0x06090011 : 0x06020000;
  const Entry& entry = at->second;
  bytes->clear();
  if (entry.size == 0) {
    bytes->assign(entry.text.begin(), entry.text.end());
    return 0;
  }
  uint32_t value = entry.on_read ? entry.on_read() : entry.value;
  for (int i = 0; i < entry.size; ++i, value >>= 8) {
    bytes->push_back(static_cast<uint8_t>(value & 0xFF));
  }
  return 0;
}

uint32_t ObjectDictionary::Write(uint16_t index, uint8_t sub, const std::vector<uint8_t>& bytes) {
  auto at = entries_.find({index, sub});
  if (at == entries_.end()) return HasIndex(index) ? 0x06090011 : 0x06020000;
  if (!at->second.writable) return 0x06010002;
  if (at->second.size == 0) {
    at->second.text.assign(bytes.begin(), bytes.end());
    return 0;
  }
  const auto size = static_cast<size_t>(at->second.size);
  if (bytes.size() > size) return 0x06070012;
  if (bytes.size() < size) return 0x06070013;
  uint32_t value = 0;
  for (size_t i = size; i-- > 0;) value = value << 8 | bytes[i];
  // Before the value is there, so that the handler can see what it was.
  if (at->second.on_write) {
    const uint32_t refused = at->second.on_write(value);
    if (refused == kNotTaken) return 0;
    if (refused != 0) return refused;
  }
  Put(index, sub, value);
  return 0;
}

// ---- The server

std::vector<uint8_t> SdoServer::Aborted(uint32_t code) {
  busy_ = Busy::kNo;
  return {0x80,
          static_cast<uint8_t>(index_ & 0xFF),
          static_cast<uint8_t>(index_ >> 8),
          sub_,
          static_cast<uint8_t>(code & 0xFF),
          static_cast<uint8_t>(code >> 8 & 0xFF),
          static_cast<uint8_t>(code >> 16 & 0xFF),
          static_cast<uint8_t>(code >> 24)};
}

std::optional<std::vector<uint8_t>> SdoServer::Handle(std::span<const uint8_t> request) {
  if (request.size() != 8) return std::nullopt;
  const uint8_t command = request[0];
  const bool piece = command < 0x20 || (command & 0xE0) == 0x60;
  if (command == 0x80) {
    busy_ = Busy::kNo;
    return std::nullopt;
  }
  if (!piece) {
    index_ = static_cast<uint16_t>(request[1] + 256 * request[2]);
    sub_ = request[3];
  }
  if (command == 0x40) return Upload();
  if ((command & 0xE0) == 0x20) return Download(request);
  if ((command & 0xE0) == 0x60) return UploadPiece(command);
  if (command < 0x20) return DownloadPiece(request);
  return Aborted(0x05040001);
}

std::vector<uint8_t> SdoServer::Upload() {
  std::vector<uint8_t> bytes;
  if (const uint32_t refused = objects_.Read(index_, sub_, &bytes); refused != 0) {
    return Aborted(refused);
  }
  const auto low = static_cast<uint8_t>(index_ & 0xFF), high = static_cast<uint8_t>(index_ >> 8);
  if (bytes.size() >= 1 && bytes.size() <= 4) {
    constexpr uint8_t kCommand[] = {0, 0x4F, 0x4B, 0x47, 0x43};
    std::vector<uint8_t> answer = {kCommand[bytes.size()], low, high, sub_};
    answer.insert(answer.end(), bytes.begin(), bytes.end());
    answer.resize(8);
    busy_ = Busy::kNo;
    return answer;
  }
  bytes_ = bytes;
  done_ = 0;
  toggle_ = false;
  busy_ = Busy::kUploading;
  return {0x41,
          low,
          high,
          sub_,
          static_cast<uint8_t>(bytes_.size() & 0xFF),
          static_cast<uint8_t>(bytes_.size() >> 8),
          0,
          0};
}

std::vector<uint8_t> SdoServer::UploadPiece(uint8_t command) {
  if (busy_ != Busy::kUploading) return Aborted(0x05040001);
  if (((command & 0x10) != 0) != toggle_) return Aborted(0x05030000);
  const size_t size = std::min<size_t>(7, bytes_.size() - done_);
  const bool last = done_ + size == bytes_.size();
  std::vector<uint8_t> answer = {
      static_cast<uint8_t>((toggle_ ? 0x10 : 0) + 2 * (7 - size) + (last ? 1 : 0))};
  answer.insert(answer.end(), bytes_.begin() + static_cast<std::ptrdiff_t>(done_),
                bytes_.begin() + static_cast<std::ptrdiff_t>(done_ + size));
  answer.resize(8);
  done_ += size;
  toggle_ = !toggle_;
  if (last) busy_ = Busy::kNo;
  return answer;
}

std::vector<uint8_t> SdoServer::Download(std::span<const uint8_t> request) {
  const uint8_t command = request[0];
  std::vector<uint8_t> taken = {0x60, request[1], request[2], request[3], 0, 0, 0, 0};
  if ((command & 2) != 0) {
    const int size = (command & 1) != 0 ? 4 - (command >> 2 & 3) : 4;
    const std::vector<uint8_t> bytes(request.begin() + 4, request.begin() + 4 + size);
    if (const uint32_t refused = objects_.Write(index_, sub_, bytes); refused != 0) {
      return Aborted(refused);
    }
    busy_ = Busy::kNo;
    return taken;
  }
  std::vector<uint8_t> there;
  if (const uint32_t refused = objects_.Read(index_, sub_, &there); refused != 0) {
    return Aborted(refused);
  }
  announced_ = request[4] + 256u * request[5] + 65536u * request[6] + 16777216u * request[7];
  if (announced_ > kLongest) return Aborted(0x05040005);
  bytes_.clear();
  toggle_ = false;
  busy_ = Busy::kDownloading;
  return taken;
}

std::vector<uint8_t> SdoServer::DownloadPiece(std::span<const uint8_t> request) {
  const uint8_t command = request[0];
  if (busy_ != Busy::kDownloading) return Aborted(0x05040001);
  if (((command & 0x10) != 0) != toggle_) return Aborted(0x05030000);
  const int size = 7 - (command >> 1 & 7);
  bytes_.insert(bytes_.end(), request.begin() + 1, request.begin() + 1 + size);
  if (bytes_.size() > kLongest) return Aborted(0x05040005);
  const auto answer = static_cast<uint8_t>(toggle_ ? 0x30 : 0x20);
  toggle_ = !toggle_;
  if ((command & 1) != 0) {
    busy_ = Busy::kNo;
    if (bytes_.size() != announced_) return Aborted(0x06070010);
    if (const uint32_t refused = objects_.Write(index_, sub_, bytes_); refused != 0) {
      return Aborted(refused);
    }
  }
  return {answer, 0, 0, 0, 0, 0, 0, 0};
}

}  // namespace lightstage::sim
