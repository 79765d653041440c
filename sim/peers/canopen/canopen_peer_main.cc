// canopen_peer INTERFACE: a simulated turntable drive (node 5) and a simulated output module (node 9) on a CAN interface of the kernel, for
// trying the canopen driver from another process. Ends with its standard input; says what really turns and shines whenever it changes.
#include <poll.h>
#include <unistd.h>

#include <cstdio>

#include "base/status.h"
#include "drivers/canopen/socket_can.h"
#include "sim/peers/canopen/drive.h"
#include "sim/peers/canopen/output_module.h"

namespace lightstage::sim {
namespace {

constexpr int kLamps = 8;

RigGeometry Geometry() {
  RigGeometry rig;
  rig.brace = {Meters(1), Meters(0.02), {}};
  for (int i = 0; i < kLamps; ++i) rig.brace.lamps.push_back({Degrees(0), Degrees(5 + 10 * i)});
  rig.camera = {Vec3(0, -1.1, 0.55), Vec3(0, 0, 0.07), Degrees(20)};
  return rig;
}

absl::Status Serve(const std::string& interface) {
  RealClock clock;
  const RigGeometry geometry = Geometry();
  WorldOptions options;
  options.samples = 1;
  ASSIGN_OR_RETURN(std::shared_ptr<World> world, World::Create(options, geometry, clock));
  ASSIGN_OR_RETURN(auto drive_port, canopen::OpenSocketCan(interface, clock));
  ASSIGN_OR_RETURN(auto outputs_port, canopen::OpenSocketCan(interface, clock));
  CanopenDrive drive(std::move(drive_port), {}, world);
  CanopenOutputModule outputs(std::move(outputs_port), {}, world);
  std::printf("nodes 5 and 9 on %s\n", interface.c_str());
  std::string before;
  while (true) {
    pollfd input{STDIN_FILENO, POLLIN, 0};
    char byte;
    if (poll(&input, 1, 20) > 0 && read(STDIN_FILENO, &byte, 1) <= 0) return absl::OkStatus();
    const AxisState axis = world->AxisAt(AxisRole::kTurntable, clock.Now());
    std::string now = absl::StrCat(axis.position.degrees(), axis.moving ? " moving" : " still");
    for (float level : world->LampLevels(clock.Now())) absl::StrAppend(&now, " ", level);
    if (now == before) continue;
    before = now;
    std::printf("%s\n", now.c_str());
    std::fflush(stdout);
  }
}

}  // namespace
}  // namespace lightstage::sim

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: %s INTERFACE\n", argv[0]);
    return 2;
  }
  const absl::Status served = lightstage::sim::Serve(argv[1]);
  if (!served.ok()) std::fprintf(stderr, "%s\n", lightstage::MessageOf(served).c_str());
  return served.ok() ? 0 : 1;
}
