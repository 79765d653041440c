// The libusb implementation against a mocked usbfs (umockdev), with a handwritten FT232R behind it. Runs under umockdev-wrapper: see
// CMakeLists.txt.
#include "drivers/dmx/libusb_bus.h"

#include <gtest/gtest.h>
#include <libusb.h>
#include <linux/usbdevice_fs.h>
#include <sys/ioctl.h>
#include <umockdev.h>

#include <array>
#include <cerrno>
#include <cstddef>
#include <cstring>
#include <deque>
#include <string>
#include <vector>

#include "absl/base/thread_annotations.h"
#include "absl/strings/str_cat.h"
#include "base/mutex.h"
#include "drivers/dmx/driver.h"
#include "drivers/dmx/ftdi.h"

namespace lightstage::dmx {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using Bytes = std::vector<uint8_t>;

constexpr char kPath[] = "/devices/pci0000:00/0000:00:14.0/usb1/1-2";
constexpr char kNode[] = "/dev/bus/usb/001/004";

// Device, configuration, interface and endpoint descriptors of an FT232R (lsusb -v; ftdi_sio.h "Descriptors returned by the device", with
// the endpoints of chips after the SIO).
constexpr char kDescriptors[] =
    "12010002000000080304016000060102030109022000010100A02D0904000002FFFFFF020705810240000007050202"
    "400000";

// A chip on usbfs. Its handler runs on a thread of umockdev.
class MockChip {
 public:
  MockChip() {
    handler_ = umockdev_ioctl_base_new();
    g_signal_connect(handler_, "handle-ioctl", G_CALLBACK(&MockChip::Handle), this);
    testbed_ = umockdev_testbed_new();
    const std::string device = absl::StrCat(
        "P: ", kPath,
        "\nN: bus/usb/001/004\nE: DEVTYPE=usb_device\nE: SUBSYSTEM=usb\nE: BUSNUM=001\n",
        "E: DEVNUM=004\nE: DEVNAME=", kNode, "\nE: PRODUCT=403/6001/600\n",
        "A: busnum=1\\n\nA: devnum=4\\n\nA: speed=12\\n\nA: bConfigurationValue=1\\n\n",
        "A: idVendor=0403\\n\nA: idProduct=6001\\n\nH: descriptors=", kDescriptors, "\n\n");
    GError* error = nullptr;
    EXPECT_TRUE(umockdev_testbed_add_from_string(testbed_, device.c_str(), &error))
        << (error != nullptr ? error->message : "");
    EXPECT_TRUE(umockdev_testbed_attach_ioctl(testbed_, kNode, handler_, &error))
        << (error != nullptr ? error->message : "");
  }
  ~MockChip() {
    umockdev_testbed_detach_ioctl(testbed_, kNode, nullptr);
    g_object_unref(testbed_);
    g_object_unref(handler_);
    // Its thread has ended. That is GLib's knowledge; who checks for races sees it by this.
    MutexLock lock(&mutex_);
  }

  enum class Mood { kGood, kGone, kMute, kStalls };
  void SetMood(Mood mood) {
    MutexLock lock(&mutex_);
    mood_ = mood;
  }
  std::string Log() {
    MutexLock lock(&mutex_);
    return std::exchange(log_, "");
  }
  Bytes sent() {
    MutexLock lock(&mutex_);
    return sent_;
  }

 private:
  struct Urb {
    UMockdevIoctlData* data = nullptr;
    bool done = false;
  };

  static gboolean Handle(UMockdevIoctlBase*, UMockdevIoctlClient* client, gpointer self) {
    return static_cast<MockChip*>(self)->Serve(client);
  }

  gboolean Serve(UMockdevIoctlClient* client) {
    MutexLock lock(&mutex_);
    UMockdevIoctlData* argument = umockdev_ioctl_client_get_arg(client);
    const gulong request = umockdev_ioctl_client_get_request(client);
    const bool gone = mood_ == Mood::kGone;
    int code = 0;
    switch (request) {
      case USBDEVFS_GET_CAPABILITIES: {
        UMockdevIoctlData* word =
            umockdev_ioctl_data_resolve(argument, 0, sizeof(uint32_t), nullptr);
        uint32_t capabilities = USBDEVFS_CAP_ZERO_PACKET | USBDEVFS_CAP_BULK_CONTINUATION |
                                USBDEVFS_CAP_NO_PACKET_SIZE_LIM;
        Write(word, 0, &capabilities, sizeof capabilities);
        break;
      }
      case USBDEVFS_DISCONNECT_CLAIM:
        absl::StrAppend(&log_, "detach+claim;");
        break;
      case USBDEVFS_CLAIMINTERFACE:
        absl::StrAppend(&log_, "claim;");
        break;
      case USBDEVFS_RELEASEINTERFACE:
        absl::StrAppend(&log_, "release;");
        break;
      case USBDEVFS_IOCTL: {
        UMockdevIoctlData* inner =
            umockdev_ioctl_data_resolve(argument, 0, sizeof(usbdevfs_ioctl), nullptr);
        usbdevfs_ioctl command;
        std::memcpy(&command, inner->data, sizeof command);
        absl::StrAppend(&log_, static_cast<unsigned>(command.ioctl_code) == USBDEVFS_CONNECT
                                   ? "attach;"
                                   : "ioctl;");
        break;
      }
      case USBDEVFS_SUBMITURB:
        code = gone ? ENODEV : Submit(argument);
        break;
      case USBDEVFS_DISCARDURB:
        code = Discard(argument);
        break;
      case USBDEVFS_REAPURB:
      case USBDEVFS_REAPURBNDELAY:
        code = Reap(argument);
        if (code == EAGAIN && gone) code = ENODEV;
        break;
      default:
        code = ENOTTY;
    }
    umockdev_ioctl_client_complete(client, code == 0 ? 0 : -1, code);
    return TRUE;
  }

  static void Write(UMockdevIoctlData* data, size_t offset, const void* from, size_t length) {
    umockdev_ioctl_data_update(data, offset, static_cast<guint8*>(const_cast<void*>(from)),
                               static_cast<gint>(length));
  }

  int Submit(UMockdevIoctlData* argument) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    Urb entry;
    entry.data = umockdev_ioctl_data_resolve(argument, 0, sizeof(usbdevfs_urb), nullptr);
    usbdevfs_urb urb;
    std::memcpy(&urb, entry.data->data, sizeof urb);
    UMockdevIoctlData* buffer = umockdev_ioctl_data_resolve(
        entry.data, offsetof(usbdevfs_urb, buffer), static_cast<gsize>(urb.buffer_length), nullptr);
    umockdev_ioctl_data_ref(entry.data);
    Bytes bytes(static_cast<size_t>(urb.buffer_length));
    if (buffer != nullptr && !bytes.empty()) std::memcpy(bytes.data(), buffer->data, bytes.size());
    if (mood_ == Mood::kStalls) {
      urb.status = -EPIPE;
      entry.done = true;
    } else if (mood_ != Mood::kMute) {
      entry.done = true;
      const Bytes answer = Answer(urb, bytes);
      urb.actual_length = static_cast<int>(answer.size());
      const bool in = urb.type == USBDEVFS_URB_TYPE_CONTROL ? (bytes[0] & 0x80) != 0
                                                            : (urb.endpoint & 0x80) != 0;
      const size_t at = urb.type == USBDEVFS_URB_TYPE_CONTROL ? 8 : 0;
      if (in && !answer.empty()) Write(buffer, at, answer.data(), answer.size());
    }
    Write(entry.data, offsetof(usbdevfs_urb, status), &urb.status, sizeof urb.status);
    Write(entry.data, offsetof(usbdevfs_urb, actual_length), &urb.actual_length,
          sizeof urb.actual_length);
    urbs_.push_back(entry);
    return 0;
  }

  // What comes, or as many bytes as were taken.
  Bytes Answer(const usbdevfs_urb& urb, const Bytes& bytes) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    if (urb.type == USBDEVFS_URB_TYPE_BULK) {
      if (urb.endpoint == kFtdiIn) return {0x01, 0x60, 'h', 'i'};
      absl::StrAppend(&log_, "out ", static_cast<int>(urb.endpoint), ";");
      sent_.insert(sent_.end(), bytes.begin(), bytes.end());
      return bytes;
    }
    const int type = bytes[0], request = bytes[1], value = bytes[2] | bytes[3] << 8,
              index = bytes[4] | bytes[5] << 8;
    const auto length = static_cast<size_t>(bytes[6] | bytes[7] << 8);
    Bytes answer;
    if (type == 0x80 && request == 6) {  // GET_DESCRIPTOR, strings
      constexpr const char* kStrings[] = {"", "FTDI", "FT232R USB UART", "AQ02FHLY"};
      answer = {0, 3};
      if ((value & 0xFF) == 0) {
        answer.insert(answer.end(), {0x09, 0x04});
      } else {
        for (const char* c = kStrings[value & 3]; *c != 0; ++c) {
          answer.insert(answer.end(), {static_cast<uint8_t>(*c), 0});
        }
      }
      answer[0] = static_cast<uint8_t>(answer.size());
    } else {
      absl::StrAppend(&log_, type, "/", request, "/", value, "/", index, ";");
      if (type == 0xC0) answer = {0x01, 0x60};
    }
    if (answer.size() > length) answer.resize(length);
    return answer;
  }

  int Discard(UMockdevIoctlData* argument) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    uint64_t address = 0;
    std::memcpy(&address, argument->data, sizeof address);
    for (Urb& urb : urbs_) {
      if (urb.done || urb.data->client_addr != address) continue;
      urb.done = true;
      const int status = -ENOENT;
      Write(urb.data, offsetof(usbdevfs_urb, status), &status, sizeof status);
      return 0;
    }
    return EINVAL;
  }

  int Reap(UMockdevIoctlData* argument) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    for (auto urb = urbs_.begin(); urb != urbs_.end(); ++urb) {
      if (!urb->done) continue;
      UMockdevIoctlData* pointer = umockdev_ioctl_data_resolve(argument, 0, sizeof(void*), nullptr);
      umockdev_ioctl_data_set_ptr(pointer, 0, urb->data);
      umockdev_ioctl_data_unref(urb->data);
      urbs_.erase(urb);
      return 0;
    }
    return EAGAIN;
  }

  UMockdevTestbed* testbed_ = nullptr;
  UMockdevIoctlBase* handler_ = nullptr;
  Mutex mutex_;
  Mood mood_ ABSL_GUARDED_BY(mutex_) = Mood::kGood;
  std::string log_ ABSL_GUARDED_BY(mutex_);
  Bytes sent_ ABSL_GUARDED_BY(mutex_);
  std::deque<Urb> urbs_ ABSL_GUARDED_BY(mutex_);
};

class LibusbBusTest : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_TRUE(umockdev_in_mock_environment()) << "to be run under umockdev-wrapper";
  }
  void Open() {
    absl::StatusOr<std::unique_ptr<UsbPort>> port = bus_->Open({"AQ02FHLY", ""});
    ASSERT_TRUE(port.ok()) << port.status();
    port_ = *std::move(port);
  }

  MockChip chip_;
  std::unique_ptr<UsbBus> bus_ = MakeLibusbBus();
  std::unique_ptr<UsbPort> port_;
};

TEST_F(LibusbBusTest, ListsWithoutTakingAnything) {
  absl::StatusOr<std::vector<UsbIdentity>> devices = bus_->List();
  ASSERT_TRUE(devices.ok()) << devices.status();
  ASSERT_EQ(devices->size(), 1u);
  EXPECT_EQ((*devices)[0].address, "1-2");
  EXPECT_EQ((*devices)[0].manufacturer, "FTDI");
  EXPECT_EQ((*devices)[0].product, "FT232R USB UART");
  EXPECT_EQ((*devices)[0].serial, "AQ02FHLY");
  EXPECT_EQ((*devices)[0].unreadable, "");
  EXPECT_EQ(chip_.Log(), "");

  absl::StatusOr<std::vector<Discovered>> found = DmxDiscovery()();
  ASSERT_TRUE(found.ok()) << found.status();
  ASSERT_EQ(found->size(), 1u);
  EXPECT_NE((*found)[0].toml.find("serial = \"AQ02FHLY\""), std::string::npos) << (*found)[0].toml;
}

TEST_F(LibusbBusTest, OpensBySerialOnly) {
  const absl::Status other = bus_->Open({"AQ02FHLX", ""}).status();
  EXPECT_EQ(ErrorReason(other), "DEVICE_LOST") << other;
  EXPECT_NE(other.message().find("AQ02FHLY"), std::string_view::npos) << other;
  EXPECT_EQ(chip_.Log(), "");
  Open();
  EXPECT_EQ(port_->identity().serial, "AQ02FHLY");
}

// ftdi_sio has it before and after.
TEST_F(LibusbBusTest, TakesFromTheKernelAndGivesBack) {
  Open();
  EXPECT_EQ(chip_.Log(), "detach+claim;");
  port_.reset();
  EXPECT_EQ(chip_.Log(), "release;attach;");
}

TEST_F(LibusbBusTest, TransfersReachTheChip) {
  Open();
  chip_.Log();
  ASSERT_TRUE(port_->Control(FtdiDataRequest(true), seconds(5)).ok());
  ASSERT_TRUE(port_->Control(*FtdiBaudRequest(184), seconds(5)).ok());
  EXPECT_EQ(chip_.Log(), "64/4/20488/0;64/3/16304/1;");
  Bytes frame(513, 0xA5);
  absl::StatusOr<size_t> taken = port_->BulkOut(frame, seconds(5));
  ASSERT_TRUE(taken.ok()) << taken.status();
  EXPECT_EQ(*taken, 513u);
  EXPECT_EQ(chip_.sent(), frame);
  EXPECT_EQ(chip_.Log(), "out 2;");
  std::array<uint8_t, 2> status{};
  absl::StatusOr<size_t> count = port_->ControlIn(FtdiStatusRequest(), status, seconds(5));
  ASSERT_TRUE(count.ok()) << count.status();
  EXPECT_EQ(*count, 2u);
  EXPECT_TRUE(DecodeFtdiStatus(status)->transmitter_empty());
  std::array<uint8_t, kFtdiPacket> packet{};
  count = port_->BulkIn(packet, seconds(5));
  ASSERT_TRUE(count.ok()) << count.status();
  EXPECT_EQ(FtdiPayload(std::span(packet).first(*count)), (Bytes{'h', 'i'}));
}

TEST_F(LibusbBusTest, NoAnswerIsSilenceInTime) {
  Open();
  chip_.SetMood(MockChip::Mood::kMute);
  EXPECT_EQ(ErrorReason(port_->Control(FtdiDataRequest(false), milliseconds(30))), "DEVICE_SILENT");
  EXPECT_EQ(ErrorReason(port_->BulkOut(Bytes(513), milliseconds(30)).status()), "DEVICE_SILENT");
  std::array<uint8_t, kFtdiPacket> packet{};
  absl::StatusOr<size_t> count = port_->BulkIn(packet, milliseconds(30));
  ASSERT_TRUE(count.ok()) << "nothing to read is no error: " << count.status();
  EXPECT_EQ(*count, 0u);
}

TEST_F(LibusbBusTest, ARefusedRequestIsAFault) {
  Open();
  chip_.SetMood(MockChip::Mood::kStalls);
  EXPECT_EQ(ErrorReason(port_->Control(FtdiDataRequest(false), seconds(5))), "DEVICE_FAULT");
  EXPECT_EQ(ErrorReason(port_->BulkOut(Bytes(3), seconds(5)).status()), "DEVICE_FAULT");
}

TEST_F(LibusbBusTest, UnpluggedIsLost) {
  Open();
  chip_.SetMood(MockChip::Mood::kGone);
  EXPECT_EQ(ErrorReason(port_->Control(FtdiDataRequest(false), seconds(5))), "DEVICE_LOST");
  EXPECT_EQ(ErrorReason(port_->BulkOut(Bytes(513), seconds(5)).status()), "DEVICE_LOST");
  std::array<uint8_t, kFtdiPacket> packet{};
  EXPECT_EQ(ErrorReason(port_->BulkIn(packet, seconds(5)).status()), "DEVICE_LOST");
  port_.reset();  // and closes
  chip_.SetMood(MockChip::Mood::kGood);
  Open();
  EXPECT_TRUE(port_->Control(FtdiDataRequest(false), seconds(5)).ok());
}

TEST(LibusbErrors, SayWhatToDo) {
  EXPECT_TRUE(LibusbError(0, "x").ok());
  EXPECT_TRUE(LibusbError(7, "x").ok());
  const absl::Status access = LibusbError(LIBUSB_ERROR_ACCESS, "opening");
  EXPECT_EQ(access.code(), absl::StatusCode::kPermissionDenied);
  EXPECT_NE(access.message().find("udev"), std::string_view::npos);
  EXPECT_EQ(ErrorReason(LibusbError(LIBUSB_ERROR_BUSY, "x")), "DEVICE_BUSY");
  EXPECT_EQ(ErrorReason(LibusbError(LIBUSB_ERROR_IO, "x")), "DEVICE_LOST");
  EXPECT_EQ(ErrorReason(LibusbError(LIBUSB_ERROR_OVERFLOW, "x")), "DEVICE_FAULT");
  EXPECT_FALSE(LibusbError(LIBUSB_ERROR_OTHER, "x").ok());
}

}  // namespace
}  // namespace lightstage::dmx
