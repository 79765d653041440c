#include "drivers/canopen/discovery.h"
#include "drivers/canopen/driver.h"
#include "drivers/canopen/open.h"
#include "drivers/canopen/socket_can.h"
#include "drivers/link/device_thread.h"

namespace lightstage {
namespace {

using namespace canopen;

constexpr char kName[] = "canopen";
constexpr Duration kScanTime = std::chrono::seconds(1);

// The clock is checked first: a bus lives on real time only.
absl::StatusOr<std::shared_ptr<CanBus>> BusOf(const DeviceContext& context,
                                              const NodeOptions& options) {
  RETURN_IF_ERROR(DeviceThread::CheckClock(context));
  Clock& clock = *context.clock;
  return CanBus::Shared(options.interface, clock, [interface = options.interface, &clock] {
    return OpenSocketCan(interface, clock);
  });
}

absl::StatusOr<std::vector<Discovered>> Discover() {
  ASSIGN_OR_RETURN(const std::vector<CanInterface> interfaces, ListCanInterfaces());
  std::vector<Discovered> all;
  RealClock clock;
  for (const CanInterface& interface : interfaces) {
    const std::string& name = interface.name;
    if (!interface.up) {
      all.push_back({absl::StrCat(name, ": a CAN interface that is down; ip link set ", name,
                                  " up type can bitrate 500000"),
                     ""});
      continue;
    }
    if (CanBus::Find(name) != nullptr) {
      all.push_back(
          {absl::StrCat(name, ": in use by this daemon's rig; its nodes are not asked"), ""});
      continue;
    }
    absl::StatusOr<std::vector<FoundNode>> nodes = std::vector<FoundNode>();
    absl::StatusOr<std::unique_ptr<CanPort>> port = OpenSocketCan(name, clock);
    if (port.ok()) {
      nodes = ScanNodes(**port, clock, kScanTime);
    } else {
      nodes = port.status();
    }
    if (!nodes.ok()) {
      all.push_back(
          {absl::StrCat(name, ": could not be searched: ", MessageOf(nodes.status())), ""});
      continue;
    }
    if (nodes->empty()) all.push_back({absl::StrCat(name, ": no node answers"), ""});
    for (const FoundNode& node : *nodes) all.push_back(DescribeNode(name, node));
  }
  return all;
}

}  // namespace

Driver<Axis> CanopenAxisDriver() {
  Driver<Axis> driver;
  driver.parse = [](const TomlTable& table) -> DeviceOpener<Axis> {
    AxisOptions options = ParseAxisOptions(table);
    return [options](const DeviceContext& context) -> absl::StatusOr<std::unique_ptr<Axis>> {
      ASSIGN_OR_RETURN(std::shared_ptr<CanBus> bus, BusOf(context, options.node));
      return OpenAxis(context, kName, options, std::move(bus));
    };
  };
  return driver;
}

Driver<Lamps> CanopenLampsDriver() {
  Driver<Lamps> driver;
  driver.parse = [](const TomlTable& table) -> DeviceOpener<Lamps> {
    LampsOptions options = ParseLampsOptions(table);
    return [options](const DeviceContext& context) -> absl::StatusOr<std::unique_ptr<Lamps>> {
      ASSIGN_OR_RETURN(std::shared_ptr<CanBus> bus, BusOf(context, options.node));
      return OpenLamps(context, kName, options, std::move(bus));
    };
  };
  return driver;
}

Discovery CanopenDiscovery() { return Discover; }

}  // namespace lightstage
