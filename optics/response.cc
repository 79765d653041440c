#include "optics/response.h"

#include <algorithm>
#include <cmath>

#include "base/status.h"

namespace lightstage {
namespace {

absl::Status Bad(const std::string& message, const ErrorMetadata& metadata) {
  return Error(absl::StatusCode::kInvalidArgument, "RESPONSE_CURVE", message, metadata);
}

}  // namespace

absl::StatusOr<ResponseCurve> ResponseCurve::FromTable(std::vector<double> log_exposure) {
  const size_t n = log_exposure.size();
  if (n < 2 || n > 65536 || (n & (n - 1)) != 0) {
    return Bad(absl::StrCat("response table has ", n,
                            " entries; it must have one per code: a power of two from 2 to 65536"),
               {{"entries", absl::StrCat(n)}});
  }
  for (size_t z = 0; z < n; ++z) {
    if (!std::isfinite(log_exposure[z])) {
      return Bad(absl::StrCat("response table entry ", z, " is ", log_exposure[z],
                              "; every entry must be finite"),
                 {{"entry", absl::StrCat(z)}, {"value", absl::StrCat(log_exposure[z])}});
    }
    if (z > 0 && log_exposure[z] < log_exposure[z - 1]) {
      return Bad(absl::StrCat("response table falls from ", log_exposure[z - 1], " to ",
                              log_exposure[z], " at entry ", z, "; it must not decrease"),
                 {{"entry", absl::StrCat(z)},
                  {"previous", absl::StrCat(log_exposure[z - 1])},
                  {"value", absl::StrCat(log_exposure[z])}});
    }
  }
  ResponseCurve curve;
  curve.table_ = std::move(log_exposure);
  return curve;
}

double ResponseCurve::Exposure(double code, double full_scale) const {
  if (is_linear()) return code / full_scale;
  return std::exp(LogExposure(code));
}

double ResponseCurve::LogExposure(double code) const {
  const double last = static_cast<double>(table_.size() - 1);
  const double z = std::clamp(code, 0.0, last);
  const size_t below = static_cast<size_t>(z);
  if (below == table_.size() - 1) return table_.back();
  const double t = z - static_cast<double>(below);
  return (1 - t) * table_[below] + t * table_[below + 1];
}

}  // namespace lightstage
