#include "drivers/link/outstanding.h"

namespace lightstage {

void CameraShot::EndExposure(TimePoint time) {
  MutexLock lock(&mutex_);
  if (finished_ || exposure_over_) return;
  exposure_over_ = true;
  SetDelivering(true);
  mutex_.Unlock();
  std::move(ended_)(ExposureEnd{time});
  mutex_.Lock();
  SetDelivering(false);
  if (frame_) DeliverFrame();  // finished meanwhile by somebody else
}

bool CameraShot::Finish(absl::StatusOr<Frame> frame) {
  MutexLock lock(&mutex_);
  if (finished_) return false;
  finished_ = true;
  frame_ = std::move(frame);
  if (!delivering_) DeliverFrame();
  return true;
}

void CameraShot::DeliverFrame() {
  absl::StatusOr<Frame> frame = *std::move(frame_);
  frame_.reset();
  bool end_exposure = !exposure_over_;
  exposure_over_ = true;
  SetDelivering(true);
  mutex_.Unlock();
  if (end_exposure) {
    if (frame.ok()) {
      std::move(ended_)(ExposureEnd{frame->exposure_end});
    } else {
      std::move(ended_)(frame.status());
    }
  }
  std::move(ready_)(std::move(frame));
  mutex_.Lock();
  SetDelivering(false);
}

}  // namespace lightstage
