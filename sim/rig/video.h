// A cable from an output of a graphics card, which a driver of outputs draws on, to whatever of the simulated rig hangs on it.
#pragma once

#include <functional>
#include <memory>

#include "absl/functional/any_invocable.h"
#include "absl/status/statusor.h"
#include "base/toml.h"
#include "drivers/api/projector.h"
#include "drivers/api/registry.h"
#include "sim/rig/world.h"

namespace lightstage::sim {

// Gets the picture on the cable whenever it is another one, by one thread at a time; null: there is no signal of the mode that is expected.
using VideoSink = std::function<void(const PixelCodes&)>;

// Opens what draws on the output, as a projector; it ends before what the sink refers to. The context has passed CheckProjector(). Errors
// as the driver of the output, and PEER_NOT_STARTED.
using VideoOutput =
    absl::AnyInvocable<absl::StatusOr<std::unique_ptr<Projector>>(const DeviceContext&, VideoSink)>;

// Reads a table of the rig file strictly; errors go into it.
using VideoOutputParser = std::function<VideoOutput(const TomlTable&)>;

}  // namespace lightstage::sim
