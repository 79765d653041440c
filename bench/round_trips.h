// Commands timed one after the other through a driver and through the bare wire below it, in turn, so that what else the machine does
// meets both alike.
#pragma once

#include <cstdio>
#include <functional>
#include <random>
#include <vector>

#include "base/clock.h"
#include "base/status.h"
#include "bench/percentiles.h"

namespace lightstage::bench {

// One command from its start until it is confirmed. It owns what it needs.
using Call = std::function<absl::Status()>;
using CallOpener = std::function<absl::StatusOr<Call>()>;

struct RoundTrip {
  const char* driver;
  const char* command;
  int calls = 300;  // a round
  CallOpener through_driver;
  CallOpener bare{};    // the same exchanges on the same wire; none: they take no time
  Duration line{};      // what the line or the device needs besides
  Duration exposure{};  // part of both, and taken from both
  Duration pause{};     // the driver's commands come at random, up to so long after one another
};

inline absl::Status Time(const CallOpener& open, const RoundTrip& trip, Duration pause,
                         Clock& clock, std::vector<double>* us) {
  constexpr int kWarmUp = 4;
  ASSIGN_OR_RETURN(const Call call, open());
  std::mt19937 random(1);
  std::uniform_real_distribution<double> share;
  for (int i = 0; i < trip.calls + kWarmUp; ++i) {
    if (pause > Duration::zero()) SleepFor(clock, FromSeconds(share(random) * Seconds(pause)));
    const TimePoint begin = clock.Now();
    RETURN_IF_ERROR(call());
    const Duration took = clock.Now() - begin - trip.exposure;
    if (i >= kWarmUp) us->push_back(Seconds(took) * 1e6);
  }
  return absl::OkStatus();
}

inline void PrintRoundTripHeader() {
  std::printf("%-20s %-24s %10s %10s %12s %8s %9s %8s\n", "driver", "command", "p50 us", "p99 us",
              "wire p50 us", "ratio", "own us", "/ hop");
}

// `own` is what the driver takes at the median beyond the wire, then in units of `hop`: a command that does nothing but go to a device's
// thread and back.
inline absl::Status PrintRoundTrip(const RoundTrip& trip, const CallOpener& hop, Clock& clock) {
  constexpr int kRounds = 3;
  std::vector<double> driver, wire, hops;
  for (int round = 0; round < kRounds; ++round) {
    RETURN_IF_ERROR(Time(trip.through_driver, trip, trip.pause, clock, &driver));
    if (trip.bare) RETURN_IF_ERROR(Time(trip.bare, trip, {}, clock, &wire));
    RETURN_IF_ERROR(Time(hop, {.calls = 300}, {}, clock, &hops));
  }
  const double p50 = Percentile(driver, 0.5);
  const double limit = (trip.bare ? Percentile(wire, 0.5) : 0) + Seconds(trip.line) * 1e6;
  const double own = p50 - limit;
  std::printf("%-20s %-24s %10.1f %10.1f %12.1f %8.2f %9.1f %8.1f\n", trip.driver, trip.command,
              p50, Percentile(driver, 0.99), limit, p50 / limit, own, own / Percentile(hops, 0.5));
  std::fflush(stdout);
  return absl::OkStatus();
}

}  // namespace lightstage::bench
