#pragma once

#include <algorithm>
#include <vector>

namespace lightstage::bench {

// The value below which `share` of the samples lie.
inline double Percentile(std::vector<double> samples, double share) {
  size_t at = std::min(samples.size() - 1, static_cast<size_t>(share * samples.size()));
  std::nth_element(samples.begin(), samples.begin() + at, samples.end());
  return samples[at];
}

}  // namespace lightstage::bench
