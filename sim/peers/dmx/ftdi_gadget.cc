#include "sim/peers/dmx/ftdi_gadget.h"

#include <fcntl.h>
#include <linux/usb/functionfs.h>
#include <poll.h>
#include <sys/mount.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <utility>

#include "absl/strings/escaping.h"
#include "absl/strings/str_format.h"
#include "base/status.h"
#include "drivers/dmx/ftdi.h"
#include "spdlog/spdlog.h"

namespace lightstage::sim {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

const std::filesystem::path kGadget = "/sys/kernel/config/usb_gadget/lightstage_dmx";
constexpr char kMount[] = "/dev/lightstage_dmx_ffs";
constexpr char kInstance[] = "lightstage_dmx";
constexpr char kController[] = "dummy_udc.0";

// FTDI_SIO_SET_DATA and its break bit (ftdi_sio.h).
constexpr uint8_t kSetData = 4;
constexpr uint16_t kBreak = 0x4000;

absl::Status Failed(std::string_view doing, std::string_view what) {
  return Error(
      absl::StatusCode::kUnavailable, "PEER_NOT_STARTED",
      absl::StrCat("the simulated FTDI chip: ", doing, " ", what, ": ", std::strerror(errno)));
}

absl::Status Write(const std::string& name, std::string_view text) {
  const std::string path = (kGadget / name).string();
  const int fd = open(path.c_str(), O_WRONLY | O_CLOEXEC);
  if (fd < 0) return Failed("opening", path);
  const bool good = write(fd, text.data(), text.size()) == static_cast<ssize_t>(text.size());
  absl::Status failed = good ? absl::OkStatus() : Failed("writing", path);
  close(fd);
  return failed;
}

absl::Status MakeFolder(const std::filesystem::path& path) {
  if (mkdir(path.c_str(), 0755) == 0 || errno == EEXIST) return absl::OkStatus();
  return Failed("making", path.native());
}

// One interface, bulk in 0x81 and bulk out 0x02, full speed. Little-endian machines only, as the USB is.
struct __attribute__((packed)) {
  usb_functionfs_descs_head_v2 head;
  __le32 full_speed_count;
  usb_interface_descriptor interface;
  usb_endpoint_descriptor_no_audio in, out;
} const kDescriptors = {
    {FUNCTIONFS_DESCRIPTORS_MAGIC_V2, sizeof kDescriptors,
     FUNCTIONFS_HAS_FS_DESC | FUNCTIONFS_ALL_CTRL_RECIP},
    3,
    {USB_DT_INTERFACE_SIZE, USB_DT_INTERFACE, 0, 0, 2, 0xFF, 0xFF, 0xFF, 1},
    {USB_DT_ENDPOINT_SIZE, USB_DT_ENDPOINT, 0x81, USB_ENDPOINT_XFER_BULK, 64, 0},
    {USB_DT_ENDPOINT_SIZE, USB_DT_ENDPOINT, 0x02, USB_ENDPOINT_XFER_BULK, 64, 0},
};

struct __attribute__((packed)) {
  usb_functionfs_strings_head head;
  __le16 language;
  char interface[16];
} const kStrings = {{FUNCTIONFS_STRINGS_MAGIC, sizeof kStrings, 1, 1}, 0x0409, "FT232R USB UART"};

}  // namespace

absl::Status FtdiGadget::Describe(const std::string& serial) {
  RETURN_IF_ERROR(MakeFolder(kGadget));
  RETURN_IF_ERROR(Write("idVendor", "0x0403"));
  RETURN_IF_ERROR(Write("idProduct", "0x6001"));
  RETURN_IF_ERROR(Write("bcdDevice", "0x0600"));
  RETURN_IF_ERROR(MakeFolder(kGadget / "strings/0x409"));
  RETURN_IF_ERROR(Write("strings/0x409/manufacturer", "FTDI"));
  RETURN_IF_ERROR(Write("strings/0x409/product", "FT232R USB UART"));
  RETURN_IF_ERROR(Write("strings/0x409/serialnumber", serial));
  RETURN_IF_ERROR(MakeFolder(kGadget / "configs/c.1"));
  const std::filesystem::path function = kGadget / absl::StrCat("functions/ffs.", kInstance),
                              link = kGadget / absl::StrCat("configs/c.1/ffs.", kInstance);
  RETURN_IF_ERROR(MakeFolder(function));
  if (symlink(function.c_str(), link.c_str()) != 0 && errno != EEXIST) {
    return Failed("linking", link.native());
  }
  RETURN_IF_ERROR(MakeFolder(kMount));
  if (mount(kInstance, kMount, "functionfs", 0, nullptr) != 0 && errno != EBUSY) {
    return Failed("mounting functionfs on", kMount);
  }
  return absl::OkStatus();
}

absl::StatusOr<std::unique_ptr<FtdiGadget>> FtdiGadget::Plug(
    std::shared_ptr<SimUsbDevice> device, std::function<void(const std::string&)> log) {
  std::unique_ptr<FtdiGadget> gadget(new FtdiGadget);
  gadget->device_ = std::move(device);
  gadget->log_ = std::move(log);
  ASSIGN_OR_RETURN(gadget->chip_, gadget->device_->Open());
  RETURN_IF_ERROR(gadget->Describe(gadget->device_->identity().serial));
  const std::string ep0 = absl::StrCat(kMount, "/ep0"), out = absl::StrCat(kMount, "/ep2");
  gadget->ep0_ = open(ep0.c_str(), O_RDWR | O_CLOEXEC);
  if (gadget->ep0_ < 0) return Failed("opening", ep0);
  if (write(gadget->ep0_, &kDescriptors, sizeof kDescriptors) < 0 ||
      write(gadget->ep0_, &kStrings, sizeof kStrings) < 0) {
    return Failed("writing descriptors to", ep0);
  }
  // Not blocking while it is not plugged in; a read of one that is waits for bytes all the same.
  gadget->out_ = open(out.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (gadget->out_ < 0) return Failed("opening", out);
  gadget->requests_ = std::thread([g = gadget.get()] { g->Serve(); });
  gadget->bytes_ = std::thread([g = gadget.get()] { g->Receive(); });
  RETURN_IF_ERROR(gadget->Attach(true));
  RealClock clock;
  const TimePoint give_up = clock.Now() + seconds(10);
  while (!gadget->enabled_) {
    if (clock.Now() > give_up) {
      errno = ETIMEDOUT;
      return Failed("being taken by the host at", kController);
    }
    SleepFor(clock, milliseconds(10));
  }
  return gadget;
}

FtdiGadget::~FtdiGadget() {
  quit_ = true;
  if (requests_.joinable()) {
    if (absl::Status out = Attach(false); !out.ok()) spdlog::error("{}", MessageOf(out));
    requests_.join();
    bytes_.join();
  }
  if (out_ >= 0) close(out_);
  if (ep0_ >= 0) close(ep0_);
}

absl::Status FtdiGadget::Attach(bool in) { return Write("UDC", in ? kController : "\n"); }

// A host need not send any, so not for ever.
void FtdiGadget::AwaitBytes() {
  RealClock clock;
  const TimePoint give_up = clock.Now() + milliseconds(100);
  MutexLock lock(&mutex_);
  for (Duration left; awaited_ && (left = give_up - clock.Now()) > Duration::zero();) {
    arrived_.WaitFor(&mutex_, left);
  }
  awaited_ = false;
}

void FtdiGadget::Answer(const usb_ctrlrequest& setup) {
  AwaitBytes();
  if (log_) {
    log_(absl::StrFormat("request %02x %02x value %04x index %04x length %d", setup.bRequestType,
                         setup.bRequest, setup.wValue, setup.wIndex, setup.wLength));
  }
  const dmx::UsbRequest request{setup.bRequestType, setup.bRequest, setup.wValue, setup.wIndex};
  const bool in = (setup.bRequestType & USB_DIR_IN) != 0;
  std::array<uint8_t, 64> answer;
  ssize_t length = -1;  // refused
  if (in) {
    const size_t most = std::min<size_t>(setup.wLength, answer.size());
    const auto got = chip_->ControlIn(request, std::span(answer).first(most), seconds(1));
    if (got.ok()) length = static_cast<ssize_t>(*got);
  } else if (chip_->Control(request, seconds(1)).ok()) {
    length = 0;
    MutexLock lock(&mutex_);
    awaited_ = request.request == kSetData && (request.value & kBreak) == 0;
  }
  // Going the other way than the request stalls it.
  const ssize_t done =
      in == (length >= 0)
          ? write(ep0_, answer.data(), static_cast<size_t>(std::max<ssize_t>(length, 0)))
          : read(ep0_, answer.data(), 0);
  if (done < 0 && errno != EL2HLT && errno != EIDRM) {
    spdlog::warn("the simulated FTDI chip: answering: {}", std::strerror(errno));
  }
}

void FtdiGadget::Serve() {
  while (!quit_) {
    pollfd ready = {ep0_, POLLIN, 0};
    if (poll(&ready, 1, 50) <= 0) continue;
    std::array<usb_functionfs_event, 4> events;
    const ssize_t count = read(ep0_, events.data(), sizeof events);
    for (size_t i = 0; i < static_cast<size_t>(std::max<ssize_t>(count, 0)) / sizeof events[0];
         ++i) {
      switch (events[i].type) {
        case FUNCTIONFS_SETUP:
          Answer(events[i].u.setup);
          break;
        case FUNCTIONFS_ENABLE:
          enabled_ = true;
          break;
        case FUNCTIONFS_DISABLE:
          enabled_ = false;
          break;
        default:
          break;
      }
    }
  }
}

void FtdiGadget::Receive() {
  RealClock clock;
  while (!quit_) {
    std::array<uint8_t, dmx::kFtdiPacket> packet;
    const ssize_t count = read(out_, packet.data(), packet.size());
    if (count > 0) {
      if (log_) {
        const absl::string_view bytes(reinterpret_cast<const char*>(packet.data()),
                                      static_cast<size_t>(count));
        log_(absl::StrCat("bytes ", count, " ", absl::BytesToHexString(bytes)));
      }
      (void)chip_->BulkOut(std::span(packet).first(static_cast<size_t>(count)), seconds(1));
      if (static_cast<size_t>(count) == packet.size()) continue;
      MutexLock lock(&mutex_);  // a short packet ends a transfer
      awaited_ = false;
      arrived_.SignalAll();
    } else {
      SleepFor(clock, milliseconds(5));  // not plugged in
    }
  }
}

}  // namespace lightstage::sim
