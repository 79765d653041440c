#include "sim/peers/uvc/descriptors.h"

#include <initializer_list>
#include <string_view>

namespace lightstage::sim {
namespace {

// Of chapter 9, and of the Video Class' tables.
constexpr uint8_t kDevice = 1, kConfiguration = 2, kString = 3, kInterface = 4, kEndpoint = 5,
                  kAssociation = 11, kClassInterface = 0x24;
constexpr uint8_t kVideo = 0x0E, kVideoControl = 1, kVideoStreaming = 2, kVideoCollection = 3;
constexpr uint8_t kVcHeader = 1, kVcInputTerminal = 2, kVcOutputTerminal = 3, kVcProcessingUnit = 5;
constexpr uint8_t kVsInputHeader = 1, kVsFormatUncompressed = 4, kVsFrameUncompressed = 5,
                  kVsColorFormat = 13;

constexpr uint16_t kVersion = 0x0110;      // of the Video Class
constexpr uint16_t kVendor = 0x1d6b;       // Linux Foundation …
constexpr uint16_t kProduct = 0x0102;      // … its gadgets' webcam
constexpr uint32_t kClockHz = 48'000'000;  // there are no time stamps of it
constexpr uint8_t kExposureControls =
    1 << 1 | 1 << 3;  // auto-exposure mode; exposure time, absolute
constexpr uint16_t kGainControl = 1 << 9;

class Bytes {
 public:
  Bytes& U8(std::initializer_list<int> values) {
    for (int value : values) bytes_.push_back(static_cast<uint8_t>(value));
    return *this;
  }
  Bytes& U16(uint32_t value) {
    return U8({static_cast<int>(value & 0xff), static_cast<int>(value >> 8 & 0xff)});
  }
  Bytes& U32(uint32_t value) { return U16(value & 0xffff).U16(value >> 16); }
  Bytes& Add(const Bytes& other) {
    bytes_.insert(bytes_.end(), other.bytes_.begin(), other.bytes_.end());
    return *this;
  }
  size_t size() const { return bytes_.size(); }
  // A descriptor's first byte is its length.
  Bytes Sized() const { return Bytes().U8({static_cast<int>(size() + 1)}).Add(*this); }
  const std::vector<uint8_t>& all() const { return bytes_; }

 private:
  std::vector<uint8_t> bytes_;
};

// Four letters and the rest that all of DirectShow's media types have.
Bytes Guid(std::string_view fourcc) {
  Bytes guid;
  for (char c : fourcc) guid.U8({c});
  return guid.U8({0, 0, 0x10, 0, 0x80, 0, 0, 0xaa, 0, 0x38, 0x9b, 0x71});
}

Bytes Interface(int number, int endpoints, int subclass) {
  return Bytes().U8({kInterface, number, 0, endpoints, kVideo, subclass, 0, 0}).Sized();
}

Bytes VideoControl() {
  const Bytes units =
      Bytes()
          .Add(Bytes()
                   .U8({kClassInterface, kVcInputTerminal, kCameraTerminal})
                   .U16(0x0201)  // a camera's sensor
                   .U8({0, 0})
                   .U16(0)  // of its lens nothing is known
                   .U16(0)
                   .U16(0)
                   .U8({3, kExposureControls, 0, 0})
                   .Sized())
          .Add(Bytes()
                   .U8({kClassInterface, kVcProcessingUnit, kProcessingUnit, kCameraTerminal})
                   .U16(0)
                   .U8({2})
                   .U16(kGainControl)
                   .U8({0, 0})
                   .Sized())
          .Add(Bytes()
                   .U8({kClassInterface, kVcOutputTerminal, kOutputTerminal})
                   .U16(0x0101)  // what is streamed
                   .U8({0, kProcessingUnit, 0})
                   .Sized());
  constexpr uint32_t kHeaderBytes = 13;
  return Bytes()
      .Add(Bytes()
               .U8({kClassInterface, kVcHeader})
               .U16(kVersion)
               .U16(kHeaderBytes + static_cast<uint32_t>(units.size()))
               .U32(kClockHz)
               .U8({1, kStreamInterface})
               .Sized())
      .Add(units);
}

Bytes VideoStreaming(const UvcDescription& description) {
  Bytes formats;
  int index = 0;
  for (PixelFormat format : kUvcFormats) {
    const bool deep = format == PixelFormat::kMono16;
    const auto bytes =
        static_cast<uint32_t>(UvcFrameBytes(format, description.width, description.height));
    // Bits a second: 8 a byte, 10⁷ intervals.
    const auto rate = static_cast<uint32_t>(
        std::min<uint64_t>(uint64_t{bytes} * 80'000'000 / description.frame_interval, UINT32_MAX));
    formats
        .Add(Bytes()
                 .U8({kClassInterface, kVsFormatUncompressed, ++index, 1})
                 .Add(Guid(deep ? "Y16 " : "Y8  "))
                 .U8({deep ? 16 : 8, 1, 0, 0, 0, 0})
                 .Sized())
        .Add(Bytes()
                 .U8({kClassInterface, kVsFrameUncompressed, 1, 0})
                 .U16(static_cast<uint32_t>(description.width))
                 .U16(static_cast<uint32_t>(description.height))
                 .U32(rate)
                 .U32(rate)
                 .U32(bytes)
                 .U32(description.frame_interval)
                 .U8({1})
                 .U32(description.frame_interval)
                 .Sized())
        .Add(Bytes().U8({kClassInterface, kVsColorFormat, 1, 1, 4}).Sized());
  }
  constexpr size_t kHeaderBytes = 13 + kUvcFormats.size();
  Bytes header;
  header.U8({kClassInterface, kVsInputHeader, static_cast<int>(kUvcFormats.size())})
      .U16(static_cast<uint32_t>(kHeaderBytes + formats.size()))
      .U8({0x80 | kStreamEndpoint, 0, kOutputTerminal, 0, 0, 0, 1});
  for (size_t i = 0; i < kUvcFormats.size(); ++i) header.U8({0});
  return Bytes().Add(header.Sized()).Add(formats);
}

}  // namespace

std::vector<uint8_t> UvcDeviceDescriptor() {
  return Bytes()
      .U8({kDevice})
      .U16(0x0200)
      .U8({0xEF, 2, 1, 64})  // its interfaces are associated
      .U16(kVendor)
      .U16(kProduct)
      .U16(0x0100)
      .U8({1, 2, 0, 1})
      .Sized()
      .all();
}

std::vector<uint8_t> UvcConfigurationDescriptor(const UvcDescription& description) {
  const Bytes interfaces =
      Bytes()
          .Add(Bytes()
                   .U8({kAssociation, kControlInterface, 2, kVideo, kVideoCollection, 0, 0})
                   .Sized())
          .Add(Interface(kControlInterface, 0, kVideoControl))
          .Add(VideoControl())
          .Add(Interface(kStreamInterface, 1, kVideoStreaming))
          .Add(VideoStreaming(description))
          .Add(Bytes()
                   .U8({kEndpoint, 0x80 | kStreamEndpoint, 2})  // bulk
                   .U16(512)
                   .U8({0})
                   .Sized());
  constexpr uint32_t kOwnBytes = 9;
  return Bytes()
      .Add(Bytes()
               .U8({kConfiguration})
               .U16(kOwnBytes + static_cast<uint32_t>(interfaces.size()))
               .U8({2, 1, 0, 0x80, 250})  // two interfaces; 500 mA from the bus
               .Sized())
      .Add(interfaces)
      .all();
}

std::vector<uint8_t> UvcStringDescriptor(const UvcDescription& description, int index) {
  Bytes text;
  text.U8({kString});
  switch (index) {
    case 0:
      return text.U16(0x0409).Sized().all();
    case 1:
    case 2:
      for (char c : index == 1 ? std::string("lightstaged") : description.product) text.U8({c, 0});
      return text.Sized().all();
    default:
      return {};
  }
}

}  // namespace lightstage::sim
