// What the wires' benchmarks stand on: a clock, a rig, a world, and commands of the devices' contracts as calls.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "bench/round_trips.h"
#include "drivers/api/registry.h"
#include "drivers/dlpc350/link.h"
#include "drivers/link/device_thread.h"
#include "sim/rig/world.h"

namespace lightstage::bench {

inline constexpr int kLamps = 40;

struct Stage {
  Stage() {
    for (int i = 0; i < kLamps; ++i) geometry.brace.lamps.push_back({Degrees(0), Degrees(2 * i)});
    geometry.brace.radius = Meters(1);
    geometry.brace.lamp_radius = Meters(0.02);
    geometry.projector = {
        true, Meters(1.5), Degrees(0), Degrees(20), dlpc350::kMirrorColumns, dlpc350::kMirrorRows};
    geometry.camera = {Vec3(0, -1.1, 0.55), Vec3(0, 0, 0.07), Degrees(20)};
  }
  absl::Status Build() {
    sim::WorldOptions options;
    options.scene = "balls";
    options.samples = 1;
    ASSIGN_OR_RETURN(world, sim::World::Create(options, geometry, clock));
    return absl::OkStatus();
  }
  // What every command of a device whose calls block takes at least.
  absl::StatusOr<Call> Hop() {
    auto thread = std::make_shared<DeviceThread>("none", clock);
    return [this, thread] {
      Pending<std::monostate> done(clock);
      auto operation = thread->Start(done.sink(), Soon(), "nothing");
      thread->Post([operation] { operation->Complete(std::monostate()); });
      return done.Wait(kNever, "nothing").status();
    };
  }
  absl::Status Print(const RoundTrip& trip) {
    return PrintRoundTrip(
        trip, [this] { return Hop(); }, clock);
  }
  DeviceContext Context(const char* name) { return {name, &clock, &geometry}; }
  TimePoint Soon() { return clock.Now() + std::chrono::seconds(30); }

  RealClock clock;
  RigGeometry geometry;
  std::shared_ptr<sim::World> world;
};

// ---- Commands of the contracts

template <class State, class Start>
absl::Status Await(Stage& stage, Start start) {
  Pending<State> done(stage.clock);
  start(stage.Soon(), done.sink());
  return done.Wait(kNever, "the command").status();
}

inline Call ReadsAxis(Stage& stage, std::shared_ptr<Axis> axis) {
  return [&stage, axis = std::move(axis)] {
    return Await<AxisState>(stage, [&](TimePoint deadline, Completion<AxisState> done) {
      axis->Read(deadline, std::move(done));
    });
  };
}

// All on, all off.
inline Call SetsLamps(Stage& stage, std::shared_ptr<Lamps> lamps) {
  return [&stage, lamps = std::move(lamps), on = false]() mutable {
    on = !on;
    return Await<LampsState>(stage, [&](TimePoint deadline, Completion<LampsState> done) {
      lamps->Set(std::vector<float>(kLamps, on ? 1.0f : 0.0f), deadline, std::move(done));
    });
  };
}

template <class Device>
Call Checks(Stage& stage, std::shared_ptr<Device> device) {
  return [&stage, device = std::move(device)] {
    return Await<std::monostate>(stage, [&](TimePoint deadline, Completion<std::monostate> done) {
      device->Check(deadline, std::move(done));
    });
  };
}

inline Call Shows(Stage& stage, std::shared_ptr<Projector> projector) {
  return [&stage, projector = std::move(projector)] {
    Pattern full;
    full.arrangement = PatternArrangement::kFull;
    return Await<ProjectorState>(stage, [&](TimePoint deadline, Completion<ProjectorState> done) {
      projector->Show(full, deadline, std::move(done));
    });
  };
}

// As a rig file opens it.
template <class Device>
absl::StatusOr<std::shared_ptr<Device>> Open(Stage& stage, const Driver<Device>& driver,
                                             const char* name, const std::string& table) {
  ASSIGN_OR_RETURN(TomlDocument document,
                   TomlDocument::Parse(absl::StrCat("[", name, "]\n", table), "rig.toml"));
  DeviceOpener<Device> open = driver.parse(document.root().Table(name));
  RETURN_IF_ERROR(document.Finish());
  ASSIGN_OR_RETURN(std::unique_ptr<Device> device, open(stage.Context(name)));
  return std::shared_ptr<Device>(std::move(device));
}

// `call` with what it stands on, which goes after it.
inline Call Keeping(std::shared_ptr<void> kept, Call call) {
  auto both =
      std::make_shared<std::pair<std::shared_ptr<void>, Call>>(std::move(kept), std::move(call));
  return [both] { return both->second(); };
}

}  // namespace lightstage::bench
