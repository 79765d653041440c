#include "drivers/canopen/open.h"

#include "base/status.h"
#include "drivers/canopen/axis.h"
#include "drivers/canopen/lamps.h"
#include "drivers/link/device_thread.h"

namespace lightstage::canopen {

absl::StatusOr<std::unique_ptr<Axis>> OpenAxis(const DeviceContext& context,
                                               std::string_view driver, const AxisOptions& options,
                                               std::shared_ptr<CanBus> bus) {
  return OpenLinkedAxis(context, driver,
                        std::make_unique<CanopenAxisLink>(context.name, options, std::move(bus)),
                        options.poll);
}

absl::StatusOr<std::unique_ptr<Lamps>> OpenLamps(const DeviceContext& context,
                                                 std::string_view driver,
                                                 const LampsOptions& options,
                                                 std::shared_ptr<CanBus> bus) {
  const int lamps =
      context.geometry == nullptr ? 0 : static_cast<int>(context.geometry->brace.lamps.size());
  // Sub-indices 1 to 254, of eight digital outputs or one analogue.
  const int most = 254 * (options.output == LampOutput::kDigital ? 8 : 1);
  if (lamps < 1 || options.first_output + lamps > most) {
    return Error(absl::StatusCode::kInvalidArgument, "GEOMETRY",
                 absl::StrCat(context.name, ": the rig's geometry has ", lamps,
                              " lamps; from first_output = ", options.first_output,
                              " on it can be 1 to ", most - options.first_output),
                 {{"device", context.name}, {"lamps", absl::StrCat(lamps)}});
  }
  return OpenLinkedLamps(
      context, driver,
      std::make_unique<CanopenLampsLink>(context.name, options, lamps, std::move(bus)));
}

}  // namespace lightstage::canopen
