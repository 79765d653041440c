// Electronic data sheets (CiA 306-1): what a maker says about the objects of a device. Only what the driver checks is kept.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "drivers/canopen/sdo.h"

namespace lightstage::canopen {

struct EdsObject {
  std::string name;
  uint16_t type = 0;  // CiA 301 table 44; 0: not given
  bool writable = false;
  // Of integer types only; not given: not limited.
  std::optional<int64_t> low, high, standard;
};

class Eds {
 public:
  // Strict: a line that is no section, no "key=value", no comment and not empty is an error, and so are a number that is none, a section or
  // key given twice, and a file without [DeviceInfo] or objects. INVALID_ARGUMENT / EDS_INVALID with "file:line: ". `node` is what
  // $NODEID stands for. What the driver does not look at is not checked beyond the lines' form.
  static absl::StatusOr<Eds> Parse(std::string_view text, const std::string& file, int node);

  const std::string& file() const { return file_; }
  // [DeviceInfo] VendorNumber and ProductNumber; nothing if not given or 0.
  std::optional<uint32_t> vendor() const { return vendor_; }
  std::optional<uint32_t> product() const { return product_; }

  const EdsObject* Find(ObjectAddress object) const;
  // Whether `value` may be written. NOT_FOUND / OBJECT_MISSING, FAILED_PRECONDITION / OBJECT_READ_ONLY, OUT_OF_RANGE / OBJECT_LIMIT.
  absl::Status CheckWrite(ObjectAddress object, int64_t value) const;

 private:
  std::string file_;
  std::optional<uint32_t> vendor_, product_;
  std::map<ObjectAddress, EdsObject> objects_;
};

}  // namespace lightstage::canopen
