// The feature description (GenICam XML) of the served camera: Aravis' own fake camera's, with the sensor's formats and limits.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "sim/peers/gige/camera_server.h"

namespace lightstage::sim {

// INTERNAL / PEER_XML if `xml` does not look like Aravis 0.8's.
absl::StatusOr<std::string> AdaptGenicam(std::string xml, const GigeCameraOptions& options);

}  // namespace lightstage::sim
