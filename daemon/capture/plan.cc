#include "daemon/capture/plan.h"

#include <numeric>

namespace lightstage {

std::vector<Angle> EvenAzimuths(int count, Angle span) {
  std::vector<Angle> azimuths;
  for (int i = 0; i < count; ++i) azimuths.push_back(Degrees(span.degrees() * i / count));
  return azimuths;
}

std::vector<Angle> CellCentredTilts(int count) {
  std::vector<Angle> tilts;
  for (int i = 0; i < count; ++i) tilts.push_back(Degrees(90.0 * (i + 0.5) / count));
  return tilts;
}

std::vector<int> AllLamps(int count) {
  std::vector<int> lamps(count);
  std::iota(lamps.begin(), lamps.end(), 0);
  return lamps;
}

}  // namespace lightstage
