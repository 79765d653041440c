#include <hidapi/hidapi.h>

#include <algorithm>
#include <mutex>
#include <utility>

#include "absl/strings/str_cat.h"
#include "base/status.h"
#include "drivers/dlpc350/hid_port.h"

namespace lightstage::dlpc350 {
namespace {

std::string Narrow(const wchar_t* text) {
  std::string narrow;
  for (; text != nullptr && *text != 0; ++text) {
    narrow += *text >= 32 && *text < 127 && *text != '"' && *text != '\\' ? static_cast<char>(*text)
                                                                          : '?';
  }
  return narrow;
}

absl::Status Initialize() {
  static std::once_flag once;
  static int failed = 0;
  std::call_once(once, [] { failed = hid_init(); });
  if (failed == 0) return absl::OkStatus();
  return Error(absl::StatusCode::kInternal, "HIDAPI", "hidapi can not be initialised");
}

class HidapiPort final : public HidPort {
 public:
  HidapiPort(hid_device* device, HidDevice what) : device_(device), what_(std::move(what)) {}
  ~HidapiPort() override { hid_close(device_); }
  HidapiPort(const HidapiPort&) = delete;
  HidapiPort& operator=(const HidapiPort&) = delete;

  const std::string& serial() const override { return what_.serial; }

  absl::Status Write(const Report& report) override {
    // hidapi wants the report's number, 0, before it.
    std::array<unsigned char, kReportSize + 1> bytes{};
    std::copy(report.begin(), report.end(), bytes.begin() + 1);
    if (hid_write(device_, bytes.data(), bytes.size()) == static_cast<int>(bytes.size())) {
      return absl::OkStatus();
    }
    return Lost("writing");
  }

  absl::StatusOr<std::vector<uint8_t>> Read(Duration patience) override {
    std::vector<uint8_t> report(kReportSize);
    const auto ms = std::chrono::ceil<std::chrono::milliseconds>(patience).count();
    const int size = hid_read_timeout(device_, report.data(), report.size(),
                                      static_cast<int>(std::clamp<int64_t>(ms, 0, 10000)));
    if (size < 0) return Lost("reading");
    report.resize(static_cast<size_t>(size));
    return report;
  }

 private:
  absl::Status Lost(const char* doing) const {
    return Error(absl::StatusCode::kUnavailable, "DEVICE_LOST",
                 absl::StrCat("the projector at ", what_.path, " is gone: ", doing,
                              " failed: ", Narrow(hid_error(device_))),
                 {{"path", what_.path}});
  }

  hid_device* const device_;
  const HidDevice what_;
};

}  // namespace

absl::StatusOr<std::vector<HidDevice>> ListHidDevices() {
  RETURN_IF_ERROR(Initialize());
  std::vector<HidDevice> found;
  hid_device_info* all = hid_enumerate(kVendor, kProduct);
  for (const hid_device_info* device = all; device != nullptr; device = device->next) {
    // The controller's second interface is of no use here; what is no USB device has −1.
    if (device->interface_number > 0 || device->path == nullptr) continue;
    // One device is listed once for each of its usages.
    const bool known = std::any_of(found.begin(), found.end(),
                                   [&](const HidDevice& d) { return d.path == device->path; });
    if (known) continue;
    found.push_back({device->path, Narrow(device->manufacturer_string),
                     Narrow(device->product_string), Narrow(device->serial_number)});
  }
  hid_free_enumeration(all);
  return found;
}

absl::StatusOr<std::unique_ptr<HidPort>> OpenHidDevice(const std::string& path,
                                                       const std::string& serial) {
  ASSIGN_OR_RETURN(std::vector<HidDevice> all, ListHidDevices());
  std::vector<HidDevice> fitting;
  std::string there_are;
  for (const HidDevice& device : all) {
    absl::StrAppend(&there_are, there_are.empty() ? "" : ", ", device.path, " (serial \"",
                    device.serial, "\")");
    if ((path.empty() || device.path == path) && (serial.empty() || device.serial == serial)) {
      fitting.push_back(device);
    }
  }
  const std::string wanted =
      absl::StrCat("a DLPC350 (USB 0451:6401)", path.empty() ? "" : " at " + path,
                   serial.empty() ? "" : " with serial \"" + serial + "\"");
  if (fitting.empty()) {
    return Error(absl::StatusCode::kNotFound, "DEVICE_NOT_FOUND",
                 absl::StrCat("there is no ", wanted, "; there are ",
                              there_are.empty() ? "none" : there_are));
  }
  if (fitting.size() > 1) {
    return Error(
        absl::StatusCode::kFailedPrecondition, "DEVICE_UNSUITABLE",
        absl::StrCat("there is more than ", wanted, ": ", there_are, "; choose by serial or path"));
  }
  hid_device* device = hid_open_path(fitting.front().path.c_str());
  if (device == nullptr) {
    return Error(absl::StatusCode::kPermissionDenied, "DEVICE_NOT_FOUND",
                 absl::StrCat("the projector at ", fitting.front().path,
                              " can not be opened: ", Narrow(hid_error(nullptr)),
                              "; the daemon's user needs to read and write it"),
                 {{"path", fitting.front().path}});
  }
  return std::make_unique<HidapiPort>(device, fitting.front());
}

}  // namespace lightstage::dlpc350
