#include "client/cpp/canceller.h"

namespace lightstage::client {

void Canceller::Cancel() {
  {
    MutexLock lock(&mutex_);
    cancelled_.store(true, std::memory_order_release);
    for (grpc::ClientContext* context : calls_) context->TryCancel();
  }
  clock_.Notify();
}

bool Canceller::SleepUntil(TimePoint deadline) {
  return clock_.WaitUntil(deadline, [this] { return cancelled(); });
}

Canceller::CallScope::CallScope(Canceller& canceller, grpc::ClientContext& context)
    : canceller_(canceller), context_(context) {
  MutexLock lock(&canceller_.mutex_);
  canceller_.calls_.insert(&context_);
  if (canceller_.cancelled()) context_.TryCancel();
}

Canceller::CallScope::~CallScope() {
  MutexLock lock(&canceller_.mutex_);
  canceller_.calls_.erase(&context_);
}

}  // namespace lightstage::client
