#include "client/cli/options.h"

namespace lightstage::client {

void RefuseValue(const std::string& name, const absl::Status& status) {
  throw CLI::ValidationError(name, MessageOf(status));
}

}  // namespace lightstage::client
