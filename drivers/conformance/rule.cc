#include "drivers/conformance/rule.h"

namespace lightstage {

void ExpectError(const absl::Status& status, absl::StatusCode code, std::string_view reason,
                 const std::string& what) {
  EXPECT_EQ(status.code(), code) << what << ": " << status;
  if (!reason.empty()) {
    EXPECT_EQ(ErrorReason(status), reason) << what << ": " << status;
  }
}

}  // namespace lightstage
