// For tests: Aravis' own fake GigE Vision camera (arv-fake-gv-camera-0.8), a peer that nobody of this project wrote, at 127.0.0.1.
#pragma once

#include <sys/types.h>

#include <string>

#include "absl/status/statusor.h"
#include "base/clock.h"

namespace lightstage {

class FakeCameraProcess {
 public:
  static constexpr char kAddress[] = "127.0.0.1";

  // `lost_per_mille` packets of its stream get lost. Returns once it listens.
  static absl::StatusOr<FakeCameraProcess> Start(const std::string& serial, int lost_per_mille = 0);
  FakeCameraProcess(FakeCameraProcess&& other) noexcept : pid_(other.pid_) { other.pid_ = -1; }
  FakeCameraProcess& operator=(FakeCameraProcess&&) = delete;
  ~FakeCameraProcess() { Kill(); }

  void Kill();                // as pulling its plug
  void Suspend(bool asleep);  // it is there, but does not answer

 private:
  explicit FakeCameraProcess(pid_t pid) : pid_(pid) {}
  pid_t pid_;
};

}  // namespace lightstage
