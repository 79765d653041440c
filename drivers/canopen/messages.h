// CANopen's other services: who says what under which identifier. CiA 301 (4.2): identifiers 7.3.5, NMT and heartbeat 7.2.8,
// emergencies 7.2.7, SYNC 7.2.5, PDOs 7.2.2. Pure functions.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "drivers/canopen/can_port.h"
#include "drivers/canopen/sdo.h"

namespace lightstage::canopen {

constexpr int kMaxNode = 127;

// The predefined connection set: the identifier's upper four bits say what it is, the lower seven which node.
constexpr uint16_t kFunctionMask = 0x780, kNodeMask = 0x07F;
constexpr uint16_t kNmt = 0x000, kSync = 0x080, kEmergency = 0x080, kTpdo1 = 0x180,
                   kSdoServer = 0x580, kSdoClient = 0x600, kHeartbeat = 0x700;

enum class NmtCommand : uint8_t {
  kStart = 0x01,
  kStop = 0x02,
  kPreOperational = 0x80,
  kReset = 0x81,
  kResetCommunication = 0x82
};

enum class NmtState : uint8_t {
  kBootUp = 0x00,
  kStopped = 0x04,
  kOperational = 0x05,
  kPreOperational = 0x7F
};
std::string NmtStateName(NmtState state);

CanFrame EncodeNmt(NmtCommand command, int node);  // node 0: all
CanFrame EncodeHeartbeat(int node, NmtState state);
CanFrame EncodeSync();

// Bit 7 belongs to node guarding and is not looked at. Nothing if the frame is empty or the state is none that there is.
std::optional<NmtState> DecodeHeartbeat(std::span<const uint8_t> bytes);

// Object 1016h: `producer` must be heard every `time`; 0 ms: not watched.
uint32_t ConsumerHeartbeat(int producer, uint16_t time_ms);

struct Emergency {
  uint16_t code = 0;           // 0: the error is gone
  uint8_t error_register = 0;  // object 1001h
  std::array<uint8_t, 5> vendor{};
};
std::optional<Emergency> DecodeEmergency(std::span<const uint8_t> bytes);  // nothing if not 8 bytes
std::string_view EmergencyName(uint16_t code);  // by CiA 301 table 26, its classes and its codes
std::string EmergencyText(const Emergency& emergency);

// One object of a PDO mapping, 1600h and 1A00h: index, sub-index, bits.
struct MappedObject {
  ObjectAddress object;
  uint8_t bits = 0;
  bool operator==(const MappedObject&) const = default;
};
uint32_t EncodeMapping(const MappedObject& mapped);
MappedObject DecodeMapping(uint32_t entry);

// The values of a PDO by its mapping, as unsigned bit patterns; objects lie one behind the other from the first byte's lowest bit
// on. Nothing if the frame is shorter than the mapping, or an object has more than 32 bits or none.
std::optional<std::vector<uint32_t>> UnpackPdo(std::span<const uint8_t> bytes,
                                               std::span<const MappedObject> mapping);
// The other way. Nothing if there are not as many values as objects, one has bits beyond its own, or they do not fit into a frame.
std::optional<std::vector<uint8_t>> PackPdo(std::span<const uint32_t> values,
                                            std::span<const MappedObject> mapping);

}  // namespace lightstage::canopen
