#include "drivers/dmx/libusb_bus.h"

#include <libusb.h>

#include <algorithm>
#include <limits>
#include <utility>

#include "absl/strings/str_cat.h"
#include "drivers/dmx/ftdi.h"

namespace lightstage::dmx {
namespace {

constexpr int kInterface = 0;

// Its own for every look at the bus: without udev's daemon a context does not hear of what was plugged in after it was made.
using Context = std::shared_ptr<libusb_context>;  // shared by the handles that need it
using Device = std::shared_ptr<libusb_device>;    // libusb counts its references itself
using Handle = std::unique_ptr<libusb_device_handle, void (*)(libusb_device_handle*)>;

absl::StatusOr<Context> MakeContext() {
  libusb_context* context = nullptr;
  RETURN_IF_ERROR(LibusbError(libusb_init(&context), "looking at the USB"));
  return Context(context, libusb_exit);
}

// libusb takes 0 as for ever.
unsigned int Milliseconds(Duration timeout) {
  const auto ms = std::chrono::ceil<std::chrono::milliseconds>(timeout).count();
  return static_cast<unsigned int>(std::clamp<int64_t>(ms, 1, std::numeric_limits<int>::max()));
}

int Length(size_t bytes) {
  return static_cast<int>(std::min<size_t>(bytes, std::numeric_limits<int>::max()));
}

std::string AddressOf(libusb_device* device) {
  std::string address = absl::StrCat(libusb_get_bus_number(device));
  uint8_t ports[7];  // as deep as USB goes
  const int depth = libusb_get_port_numbers(device, ports, sizeof ports);
  for (int i = 0; i < depth; ++i) absl::StrAppend(&address, i == 0 ? "-" : ".", ports[i]);
  return address;
}

absl::StatusOr<Handle> OpenHandle(libusb_device* device) {
  libusb_device_handle* handle = nullptr;
  RETURN_IF_ERROR(LibusbError(libusb_open(device, &handle),
                              absl::StrCat("opening the USB device at ", AddressOf(device))));
  return Handle(handle, libusb_close);
}

absl::StatusOr<std::string> ReadString(libusb_device_handle* handle, uint8_t index) {
  if (index == 0) return std::string();
  unsigned char text[256];
  const int length = libusb_get_string_descriptor_ascii(handle, index, text, sizeof text);
  RETURN_IF_ERROR(LibusbError(length, "reading its names"));
  return std::string(text, text + length);
}

absl::Status ReadStrings(libusb_device* device, UsbIdentity* identity) {
  libusb_device_descriptor descriptor;
  RETURN_IF_ERROR(LibusbError(libusb_get_device_descriptor(device, &descriptor), "its descriptor"));
  ASSIGN_OR_RETURN(Handle handle, OpenHandle(device));
  ASSIGN_OR_RETURN(identity->manufacturer, ReadString(handle.get(), descriptor.iManufacturer));
  ASSIGN_OR_RETURN(identity->product, ReadString(handle.get(), descriptor.iProduct));
  ASSIGN_OR_RETURN(identity->serial, ReadString(handle.get(), descriptor.iSerialNumber));
  return absl::OkStatus();
}

struct Found {
  Context context;  // outlives `devices`
  std::vector<Device> devices;
  std::vector<UsbIdentity> identities;
};

absl::StatusOr<Found> Look() {
  Found found;
  ASSIGN_OR_RETURN(found.context, MakeContext());
  libusb_device** list = nullptr;
  const ssize_t count = libusb_get_device_list(found.context.get(), &list);
  RETURN_IF_ERROR(LibusbError(static_cast<int>(std::min<ssize_t>(count, 0)), "listing the USB"));
  for (ssize_t i = 0; i < count; ++i) {
    libusb_device_descriptor descriptor;
    if (libusb_get_device_descriptor(list[i], &descriptor) != 0) continue;
    if (descriptor.idVendor != kFtdiVendor || descriptor.idProduct != kFtdiProduct) continue;
    UsbIdentity identity;
    identity.address = AddressOf(list[i]);
    if (absl::Status read = ReadStrings(list[i], &identity); !read.ok()) {
      identity.unreadable = MessageOf(read);
    }
    found.devices.emplace_back(libusb_ref_device(list[i]), libusb_unref_device);
    found.identities.push_back(std::move(identity));
  }
  libusb_free_device_list(list, /*unref_devices=*/1);
  return found;
}

class LibusbPort final : public UsbPort {
 public:
  LibusbPort(Context context, Handle handle, UsbIdentity identity)
      : context_(std::move(context)), handle_(std::move(handle)), identity_(std::move(identity)) {}
  // Gives it back to the kernel's driver; if the device is gone there is nothing to give.
  ~LibusbPort() override { libusb_release_interface(handle_.get(), kInterface); }

  const UsbIdentity& identity() const override { return identity_; }

  absl::Status Control(const UsbRequest& request, Duration timeout) override {
    return Transfer(request, nullptr, 0, timeout).status();
  }

  absl::StatusOr<size_t> ControlIn(const UsbRequest& request, std::span<uint8_t> data,
                                   Duration timeout) override {
    return Transfer(request, data.data(), std::min<size_t>(data.size(), 0xFFFF), timeout);
  }

  absl::StatusOr<size_t> BulkOut(std::span<const uint8_t> data, Duration timeout) override {
    int taken = 0;
    // libusb only reads what goes out.
    const int code =
        libusb_bulk_transfer(handle_.get(), kFtdiOut, const_cast<uint8_t*>(data.data()),
                             Length(data.size()), &taken, Milliseconds(timeout));
    if (code == LIBUSB_ERROR_TIMEOUT && taken > 0) return static_cast<size_t>(taken);
    RETURN_IF_ERROR(LibusbError(code, "bulk transfer out"));
    return static_cast<size_t>(taken);
  }

  absl::StatusOr<size_t> BulkIn(std::span<uint8_t> data, Duration timeout) override {
    int came = 0;
    const int code = libusb_bulk_transfer(handle_.get(), kFtdiIn, data.data(), Length(data.size()),
                                          &came, Milliseconds(timeout));
    if (code != LIBUSB_ERROR_TIMEOUT) RETURN_IF_ERROR(LibusbError(code, "bulk transfer in"));
    return static_cast<size_t>(came);
  }

 private:
  absl::StatusOr<size_t> Transfer(const UsbRequest& request, uint8_t* data, size_t length,
                                  Duration timeout) {
    const int count = libusb_control_transfer(handle_.get(), request.type, request.request,
                                              request.value, request.index, data,
                                              static_cast<uint16_t>(length), Milliseconds(timeout));
    RETURN_IF_ERROR(LibusbError(count, absl::StrCat("request ", request.request)));
    return static_cast<size_t>(count);
  }

  const Context context_;  // outlives the handle
  const Handle handle_;
  const UsbIdentity identity_;
};

class LibusbBus final : public UsbBus {
 public:
  absl::StatusOr<std::vector<UsbIdentity>> List() override {
    ASSIGN_OR_RETURN(Found found, Look());
    return std::move(found.identities);
  }

  absl::StatusOr<std::unique_ptr<UsbPort>> Open(const UsbSelector& selector) override {
    ASSIGN_OR_RETURN(Found found, Look());
    ASSIGN_OR_RETURN(const size_t which, SelectDevice(found.identities, selector));
    ASSIGN_OR_RETURN(Handle handle, OpenHandle(found.devices[which].get()));
    // Detaches ftdi_sio on claiming, attaches it again on releasing. Where the kernel cannot, claiming says whether that matters.
    libusb_set_auto_detach_kernel_driver(handle.get(), 1);
    RETURN_IF_ERROR(
        LibusbError(libusb_claim_interface(handle.get(), kInterface),
                    absl::StrCat("taking the USB device at ", found.identities[which].address)));
    return std::make_unique<LibusbPort>(std::move(found.context), std::move(handle),
                                        std::move(found.identities[which]));
  }
};

}  // namespace

absl::Status LibusbError(int code, std::string_view what) {
  if (code >= 0) return absl::OkStatus();
  const auto make = [&](absl::StatusCode status, std::string_view reason, std::string_view hint) {
    return Error(status, reason, absl::StrCat(what, ": ", libusb_error_name(code), hint),
                 {{"libusb_error", libusb_error_name(code)}});
  };
  switch (code) {
    case LIBUSB_ERROR_NO_DEVICE:
    case LIBUSB_ERROR_NOT_FOUND:  // of an interface or a node that was there before
      return make(absl::StatusCode::kUnavailable, "DEVICE_LOST", ", it is unplugged");
    case LIBUSB_ERROR_IO:  // what an unplugged device shows until the hub has told
      return make(absl::StatusCode::kUnavailable, "DEVICE_LOST", ", unplugged or a broken link");
    case LIBUSB_ERROR_TIMEOUT:
      return make(absl::StatusCode::kDeadlineExceeded, "DEVICE_SILENT", ", no answer");
    case LIBUSB_ERROR_ACCESS:
      return make(absl::StatusCode::kPermissionDenied, "DEVICE_ACCESS",
                  ", this user may not: a udev rule must give access to 0403:6001 (README.md of "
                  "the driver)");
    case LIBUSB_ERROR_BUSY:
      return make(absl::StatusCode::kFailedPrecondition, "DEVICE_BUSY", ", another program has it");
    case LIBUSB_ERROR_PIPE:
      return make(absl::StatusCode::kFailedPrecondition, "DEVICE_FAULT", ", the device refuses it");
    case LIBUSB_ERROR_OVERFLOW:
      return make(absl::StatusCode::kFailedPrecondition, "DEVICE_FAULT",
                  ", the device sent more than it may");
    default:
      return make(absl::StatusCode::kInternal, "USB_FAILED", "");
  }
}

std::unique_ptr<UsbBus> MakeLibusbBus() { return std::make_unique<LibusbBus>(); }

}  // namespace lightstage::dmx
