// What a user asks to be captured, before it is expanded into shots. Plain values: daemon/rpc fills
// them from messages.
#pragma once

#include <optional>
#include <variant>
#include <vector>

#include "base/clock.h"
#include "base/units.h"
#include "optics/pattern.h"

namespace lightstage {

// What every kind of plan has.
//
// Dark and reference frames are extra shots beside the basis shots: one before the first basis
// shot, one after every N basis shots, and one after the last (not twice if the last is also an
// Nth): 1 + ceil(basis / N) of each kind. They need no motion: the ones before the first basis shot
// are taken at its pose, the others at the pose of the basis shot that they follow. Where both are
// due the dark one comes first. A reference frame lights every lamp of the plan at the plan's
// level, or the full pattern.
struct CommonPlan {
  std::vector<Duration> exposures;  // the bracket, ascending; empty: the rig file's
  int dark_every = 0;               // N basis shots; 0: none
  int reference_every = 0;          // N basis shots; 0: none
};

// Every lamp alone at every azimuth of the turntable (dissertation p. 46). Azimuths outside, lamps
// inside, both in the order given.
struct LightStagePlan {
  std::vector<Angle> azimuths;  // of the turntable
  std::vector<int> lamps;       // by index on the brace
  double level = 1;             // of the one lit lamp, (0, 1]
  // Where the projector's gantry stays; unset: as near to 0° as the rig's limits allow.
  std::optional<Angle> tilt;
};

// Which of the two axes moves least often.
enum class AxisOrder {
  kFastest,         // the order whose moves take less time on this rig
  kTiltOutside,     // all azimuths at one tilt, then the next tilt
  kAzimuthOutside,  // all tilts at one azimuth, then the next azimuth
};

// A set of patterns at every position (tilt × azimuth) of the projector around the object
// (dissertation ch. 4). The outer axis takes its angles in the order given; the inner one goes
// through its list forth and back, so that only one axis moves at a time.
struct Projector4dPlan {
  std::vector<Angle> tilts;     // of the projector's gantry
  std::vector<Angle> azimuths;  // of the turntable
  int grid = 16;                // m: the pattern has m × m squares
  // d: 2·m·(d+1) horizontal and vertical patterns; unset: the m² squares one by one.
  std::optional<int> influence;
  PatternProfile profile = PatternProfile::kBox;
  AxisOrder order = AxisOrder::kFastest;
};

struct Plan {
  CommonPlan common;
  std::variant<LightStagePlan, Projector4dPlan> kind;
};

// `count` azimuths from 0° in steps of span / count: EvenAzimuths(32, 180°) is 0, 5.625 … 174.375.
std::vector<Angle> EvenAzimuths(int count, Angle span);

// The centres of `count` equal cells from the zenith (0°) to the horizon (90°): no position is
// taken twice.
std::vector<Angle> CellCentredTilts(int count);

// Lamps 0 … count−1.
std::vector<int> AllLamps(int count);

}  // namespace lightstage
