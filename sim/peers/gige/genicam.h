// The feature description (GenICam XML) of the served camera: Aravis' own fake camera's, with the sensor's formats and limits.
#pragma once

#include <cstdint>
#include <string>

#include "absl/status/statusor.h"
#include "sim/peers/gige/camera_server.h"

namespace lightstage::sim {

// Registers that the fake camera does not know and only keeps; those of lines every 16 bytes, Line1 first.
constexpr uint32_t kTriggerSourceRegister = 0x4000;  // 0: Line1, 1: Software
constexpr uint32_t kLineSelectorRegister = 0x4010;
constexpr uint32_t kLineModeRegister = 0x4020;    // 1: output
constexpr uint32_t kLineSourceRegister = 0x4040;  // 1: exposure active

// Of cameras with chunk data: switches (0 or 1), and where the client wants the stream.
constexpr uint32_t kChunkModeRegister = 0x4060;
constexpr uint32_t kChunkSelectorRegister = 0x4064;
constexpr uint32_t kChunkEnableRegister = 0x4070;  // ExposureTime, 16 bytes further Gain
constexpr uint32_t kClientPortRegister = 0x4090;
constexpr uint32_t kClientAddressRegister = 0x4094;
constexpr uint32_t kStartRegister = 0x4098, kStopRegister = 0x409c;  // of the acquisition
// Of cameras that tell the ends of exposures.
constexpr uint32_t kEventSelectorRegister = 0x40a0, kEventNotificationRegister = 0x40a4;  // 1: on
constexpr uint16_t kExposureEndEvent = 0x9003;

constexpr uint32_t kExposureChunk = 0x101, kGainChunk = 0x102;  // ids: a big-endian double each

// INTERNAL / PEER_XML if `xml` does not look like Aravis 0.8's.
absl::StatusOr<std::string> AdaptGenicam(std::string xml, const GigeCameraOptions& options);

}  // namespace lightstage::sim
