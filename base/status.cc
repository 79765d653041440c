#include "base/status.h"

#include <cerrno>
#include <cstring>

#include "absl/strings/cord.h"
#include "absl/strings/str_split.h"

namespace lightstage {
namespace {

// One payload, "reason\0key\0value\0key\0value": values may hold anything but NUL.
constexpr char kPayloadUrl[] = "lightstage/error-info";

std::vector<std::string> Payload(const absl::Status& status) {
  auto payload = status.GetPayload(kPayloadUrl);
  if (!payload) return {};
  return absl::StrSplit(std::string(*payload), '\0');
}

}  // namespace

absl::Status Error(absl::StatusCode code, std::string_view reason, std::string_view message,
                   const ErrorMetadata& metadata) {
  absl::Status status(code, AbslView(message));
  std::string payload(reason);
  for (const auto& [key, value] : metadata) {
    payload += '\0';
    payload += key;
    payload += '\0';
    payload += value;
  }
  status.SetPayload(kPayloadUrl, absl::Cord(payload));
  return status;
}

std::string ErrorReason(const absl::Status& status) {
  auto parts = Payload(status);
  return parts.empty() ? absl::StatusCodeToString(status.code()) : parts[0];
}

ErrorMetadata ErrorMetadataOf(const absl::Status& status) {
  auto parts = Payload(status);
  ErrorMetadata metadata;
  for (size_t i = 1; i + 1 < parts.size(); i += 2) metadata.emplace_back(parts[i], parts[i + 1]);
  return metadata;
}

std::string MessageOf(const absl::Status& status) { return std::string(status.message()); }

absl::Status Annotate(const absl::Status& status, std::string_view context) {
  if (status.ok()) return status;
  absl::Status annotated(status.code(), absl::StrCat(context, ": ", status.message()));
  status.ForEachPayload([&](absl::string_view url, const absl::Cord& payload) {
    annotated.SetPayload(url, payload);
  });
  return annotated;
}

absl::Status ErrnoError(int error_number, std::string_view operation, std::string_view path) {
  absl::StatusCode code;
  std::string_view reason;
  switch (error_number) {
    case ENOENT:
      code = absl::StatusCode::kNotFound, reason = "FILE_NOT_FOUND";
      break;
    case EEXIST:
      code = absl::StatusCode::kAlreadyExists, reason = "FILE_EXISTS";
      break;
    case ENOSPC:
    case EDQUOT:
      code = absl::StatusCode::kResourceExhausted, reason = "DISK_FULL";
      break;
    case EACCES:
    case EPERM:
    case EROFS:
      code = absl::StatusCode::kPermissionDenied, reason = "FILE_PERMISSION";
      break;
    default:
      code = absl::StatusCode::kInternal, reason = "FILE_IO";
  }
  return Error(code, reason, absl::StrCat(operation, " ", path, ": ", std::strerror(error_number)),
               {{"operation", std::string(operation)}, {"path", std::string(path)}});
}

}  // namespace lightstage
