// Errors as values. Every error that leaves a room carries a reason (UPPER_SNAKE, stable, what programs switch on) and the
// values its message mentions, so that daemon/rpc can send them as one google.rpc.ErrorInfo (AIP-193).
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "base/strings.h"  // so that messages can be put together from any kind of string

namespace lightstage {

using ErrorMetadata = std::vector<std::pair<std::string, std::string>>;

// Builds an error. `reason` is UPPER_SNAKE_CASE; `metadata` holds every value that `message` mentions.
absl::Status Error(absl::StatusCode code, std::string_view reason, std::string_view message,
                   const ErrorMetadata& metadata = {});

// The reason given to Error(), or the status code's own name if there is none.
std::string ErrorReason(const absl::Status& status);
ErrorMetadata ErrorMetadataOf(const absl::Status& status);
// The message as a std::string, which loggers take (Debian's absl::string_view is not std::string_view).
std::string MessageOf(const absl::Status& status);

// The same error with `context` and ": " put before its message; reason and metadata are kept. OK stays OK.
absl::Status Annotate(const absl::Status& status, std::string_view context);

// An error from errno with the operation and the path that it concerns.
absl::Status ErrnoError(int error_number, std::string_view operation, std::string_view path);

}  // namespace lightstage

#define LS_CONCAT_INNER(a, b) a##b
#define LS_CONCAT(a, b) LS_CONCAT_INNER(a, b)

#define RETURN_IF_ERROR(expr)                                               \
  do {                                                                      \
    if (absl::Status ls_status = (expr); !ls_status.ok()) return ls_status; \
  } while (false)

#define ASSIGN_OR_RETURN(lhs, expr) ASSIGN_OR_RETURN_IMPL(LS_CONCAT(ls_or_, __LINE__), lhs, expr)
#define ASSIGN_OR_RETURN_IMPL(tmp, lhs, expr) \
  auto tmp = (expr);                          \
  if (!tmp.ok()) return tmp.status();         \
  lhs = *std::move(tmp)
