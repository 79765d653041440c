// A camera's response curve g(Z) = ln E + ln Δt (dissertation §2.5.3): what maps a code value to the exposure that made it.
#pragma once

#include <vector>

#include "absl/status/statusor.h"

namespace lightstage {

class ResponseCurve {
 public:
  // Linear raw output: exposure is proportional to the code value above black; full scale maps to 1.
  ResponseCurve() = default;
  // `log_exposure[Z]` = g(Z) for every code 0 … 2^bits − 1, finite and non-decreasing; INVALID_ARGUMENT / RESPONSE_CURVE otherwise.
  static absl::StatusOr<ResponseCurve> FromTable(std::vector<double> log_exposure);

  bool is_linear() const { return table_.empty(); }
  // Codes a table covers; 0 if linear.
  int levels() const { return static_cast<int>(table_.size()); }
  // Exposure (E·Δt) of `code` where full scale of `full_scale` = 2^bits − 1; for a table, exp(g(code)) with g(mid) = 0 as given.
  double Exposure(double code, double full_scale) const;
  // g(code), linear between the integer codes, constant beyond the ends. Only for a table.
  double LogExposure(double code) const;

 private:
  std::vector<double> table_;
};

}  // namespace lightstage
