#include "drivers/canopen/identity.h"

#include "absl/strings/str_format.h"
#include "base/status.h"
#include "drivers/canopen/cia402.h"

namespace lightstage::canopen {

std::string IdentityText(const NodeIdentity& identity) {
  std::string text = ProfileText(identity.device_type);
  if (!identity.name.empty()) absl::StrAppend(&text, " '", identity.name, "'");
  text += absl::StrFormat(" of vendor %08Xh, product %08Xh, serial number %d", identity.vendor,
                          identity.product, identity.serial);
  return text;
}

DeviceIdentity Describe(const NodeIdentity& identity) {
  DeviceIdentity described;
  described.model =
      absl::StrFormat("%s (CANopen vendor %08Xh, product %08Xh)",
                      identity.name.empty() ? ProfileText(identity.device_type) : identity.name,
                      identity.vendor, identity.product);
  if (identity.serial != 0) described.serial = absl::StrCat(identity.serial);
  return described;
}

absl::Status CheckIdentity(const Node& node, const NodeOptions& options,
                           const NodeIdentity& identity, uint16_t profile,
                           const std::optional<NodeIdentity>& before) {
  auto unsuitable = [&](const std::string& wanted) {
    return node.Fault(absl::StatusCode::kFailedPrecondition, "DEVICE_UNSUITABLE",
                      absl::StrCat("is ", IdentityText(identity), "; ", wanted));
  };
  if ((identity.device_type & 0xFFFF) != profile) {
    return unsuitable(absl::StrCat("must be ",
                                   ProfileText(profile).substr(0, ProfileText(profile).find(" (")),
                                   ": is 'node' the right one?"));
  }
  auto differs = [](const std::optional<uint32_t>& wanted, uint32_t is) {
    return wanted.has_value() && *wanted != is;
  };
  if (differs(options.vendor, identity.vendor)) {
    return unsuitable(absl::StrFormat("the rig file wants vendor_id = 0x%08X", *options.vendor));
  }
  if (differs(options.product, identity.product)) {
    return unsuitable(
        absl::StrFormat("the rig file wants product_code = 0x%08X", *options.product));
  }
  if (differs(options.serial, identity.serial)) {
    return unsuitable(absl::StrCat("the rig file wants serial_number = ", *options.serial));
  }
  if (options.eds != nullptr) {
    const Eds& eds = *options.eds;
    const EdsObject* type = eds.Find({0x1000, 0});
    const bool other_type = type != nullptr && type->standard.has_value() &&
                            static_cast<uint32_t>(*type->standard) != identity.device_type;
    if (other_type || differs(eds.vendor(), identity.vendor) ||
        differs(eds.product(), identity.product)) {
      return unsuitable(absl::StrCat(eds.file(), " is the data sheet of another product"));
    }
  }
  if (before.has_value() &&
      (before->device_type != identity.device_type || before->vendor != identity.vendor ||
       before->product != identity.product || before->serial != identity.serial)) {
    return unsuitable(absl::StrCat("before it was ", IdentityText(*before),
                                   "; start the daemon anew if that is meant"));
  }
  return absl::OkStatus();
}

}  // namespace lightstage::canopen
