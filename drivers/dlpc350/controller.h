// One DLPC350 that is asked and told: every setting is read back.
#pragma once

#include <initializer_list>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "drivers/dlpc350/hid_port.h"

namespace lightstage::dlpc350 {

// Errors of all methods: UNAVAILABLE / DEVICE_LOST unplugged; DEADLINE_EXCEEDED / DEVICE_SILENT no reply; FAILED_PRECONDITION / DEVICE_FAULT
// refused, answered with something else than what was set, or answered with something that is no reply. One thread at a time.
class Controller {
 public:
  static constexpr Duration kPatience = std::chrono::milliseconds(500);  // for a reply
  // For a slow command to come into force: TI's own program looks for it every tenth of a second, a few times.
  static constexpr Duration kSlow = std::chrono::seconds(1);

  explicit Controller(std::unique_ptr<HidPort> port) : port_(std::move(port)) {}

  const std::string& serial() const { return port_->serial(); }

  absl::Status Write(const Command& command, std::span<const uint8_t> data);
  // At least `least` bytes.
  absl::StatusOr<std::vector<uint8_t>> Read(const Command& command, size_t least);
  // Write, read back, compare; a slow command is read back until it agrees or kSlow is over.
  absl::Status Set(const Command& command, std::span<const uint8_t> data);
  absl::Status Set(const Command& command, std::initializer_list<uint8_t> data) {
    return Set(command, std::span(data.begin(), data.size()));
  }

  absl::StatusOr<StatusBits> ReadStatus();

  // Puts one flash image and one step in the tables of the pattern sequence, reads them back and has them validated. The sequence must be stopped.
  absl::Status SetSequence(uint8_t image, const LutEntry& entry);

 private:
  absl::StatusOr<std::vector<uint8_t>> Ask(const Command& command,
                                           const std::vector<Report>& message, bool read);
  // Fills a mailbox from its start, and compares.
  absl::Status SetMailbox(uint8_t mailbox, std::span<const uint8_t> data);

  std::unique_ptr<HidPort> port_;
  uint8_t sequence_ = 0;
};

}  // namespace lightstage::dlpc350
