#include "base/own_copy.h"

#include "base/status.h"

namespace lightstage {

absl::Status OwnCopy(const absl::Status& status) {
  if (status.ok()) return status;
  return Error(status.code(), ErrorReason(status), MessageOf(status), ErrorMetadataOf(status));
}

}  // namespace lightstage
