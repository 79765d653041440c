// The object dictionary of a simulated node and the SDO server in front of it (CiA 301). Written for itself: it shares nothing with the
// driver that it is to test but the frames of the bus. Not thread-safe.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "drivers/canopen/can_port.h"

namespace lightstage::sim {

class ObjectDictionary {
 public:
  // What writing a value does; the abort code that it is refused with, or 0, or kNotTaken: confirmed, but not done.
  using OnWrite = std::function<uint32_t(uint32_t)>;
  static constexpr uint32_t kNotTaken = 1;
  using OnRead = std::function<uint32_t()>;

  // Integers of `size` bytes, 1 to 4, and texts. The last one added counts.
  void Constant(uint16_t index, uint8_t sub, int size, uint32_t value);
  void Variable(uint16_t index, uint8_t sub, int size, uint32_t value, OnWrite on_write = {});
  void Live(uint16_t index, uint8_t sub, int size, OnRead on_read);
  void Text(uint16_t index, uint8_t sub, std::string text, bool writable = false);
  void Remove(uint16_t index);
  void Clear() { entries_.clear(); }

  bool Has(uint16_t index, uint8_t sub) const { return entries_.contains({index, sub}); }
  bool HasIndex(uint16_t index) const;
  uint32_t Value(uint16_t index, uint8_t sub) const;  // 0 if there is none
  void Put(uint16_t index, uint8_t sub, uint32_t value);
  std::string TextOf(uint16_t index, uint8_t sub) const;

  // As a client reads and writes; an abort code in place of 0.
  uint32_t Read(uint16_t index, uint8_t sub, std::vector<uint8_t>* bytes) const;
  uint32_t Write(uint16_t index, uint8_t sub, const std::vector<uint8_t>& bytes);

 private:
  struct Entry {
    int size = 0;  // 0: a text
    bool writable = false;
    uint32_t value = 0;
    std::string text;
    OnWrite on_write;
    OnRead on_read;
  };
  std::map<std::pair<uint16_t, uint8_t>, Entry> entries_;
};

class SdoServer {
 public:
  explicit SdoServer(ObjectDictionary& objects) : objects_(objects) {}

  // The eight bytes to be answered, or nothing.
  std::optional<std::vector<uint8_t>> Handle(std::span<const uint8_t> request);
  // Forgets a transfer that is under way.
  void Reset() { busy_ = Busy::kNo; }

 private:
  enum class Busy { kNo, kUploading, kDownloading };

  std::vector<uint8_t> Aborted(uint32_t code);
  std::vector<uint8_t> Upload();
  std::vector<uint8_t> UploadPiece(uint8_t command);
  std::vector<uint8_t> Download(std::span<const uint8_t> request);
  std::vector<uint8_t> DownloadPiece(std::span<const uint8_t> request);

  ObjectDictionary& objects_;
  Busy busy_ = Busy::kNo;
  uint16_t index_ = 0;
  uint8_t sub_ = 0;
  bool toggle_ = false;
  std::vector<uint8_t> bytes_;
  size_t done_ = 0, announced_ = 0;
};

}  // namespace lightstage::sim
