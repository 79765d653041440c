#include "sim/peers/dlpc350/in_process_port.h"

#include <utility>

#include "base/status.h"

namespace lightstage::sim {
namespace {

class InProcessPort final : public dlpc350::HidPort {
 public:
  InProcessPort(Dlpc350Device& device, std::string serial)
      : device_(device), serial_(std::move(serial)) {}

  const std::string& serial() const override { return serial_; }
  absl::Status Write(const dlpc350::Report& report) override {
    return device_.Receive(report) ? absl::OkStatus() : Lost();
  }
  absl::StatusOr<std::vector<uint8_t>> Read(Duration patience) override {
    bool unplugged = false;
    std::optional<std::vector<uint8_t>> report = device_.Send(patience, &unplugged);
    if (unplugged) return Lost();
    if (!report) return std::vector<uint8_t>{};
    return *std::move(report);
  }

 private:
  static absl::Status Lost() {
    return Error(absl::StatusCode::kUnavailable, "DEVICE_LOST", "the projector is unplugged");
  }

  Dlpc350Device& device_;
  const std::string serial_;
};

}  // namespace

dlpc350::HidOpener InProcessHid(Dlpc350Device& device, std::string serial) {
  return
      [&device, serial = std::move(serial)]() -> absl::StatusOr<std::unique_ptr<dlpc350::HidPort>> {
        bool unplugged = false;
        device.Send(Duration::zero(), &unplugged);
        if (unplugged) {
          return Error(absl::StatusCode::kNotFound, "DEVICE_NOT_FOUND", "there is no DLPC350");
        }
        return std::make_unique<InProcessPort>(device, serial);
      };
}

}  // namespace lightstage::sim
