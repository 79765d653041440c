#include "sim/rig/device_timers.h"

namespace lightstage::sim {

DeviceTimers::DeviceTimers(Clock& clock) : clock_(clock) {}

uint64_t DeviceTimers::At(TimePoint t, Clock::Callback fn) {
  MutexLock lock(&state_->mutex);
  if (state_->closed) return 0;
  const uint64_t id = state_->next_id++;
  state_->pending[id] = clock_.At(t, [state = state_, id, fn = std::move(fn)]() mutable {
    {
      MutexLock lock(&state->mutex);
      if (state->pending.erase(id) == 0) return;
      ++state->running;
    }
    std::move(fn)();
    MutexLock lock(&state->mutex);
    if (--state->running == 0) state->idle.SignalAll();
  });
  return id;
}

void DeviceTimers::Cancel(uint64_t id) {
  MutexLock lock(&state_->mutex);
  auto it = state_->pending.find(id);
  if (it == state_->pending.end()) return;
  clock_.Cancel(it->second);
  state_->pending.erase(it);
}

void DeviceTimers::Close() {
  MutexLock lock(&state_->mutex);
  state_->closed = true;
  for (const auto& [id, timer] : state_->pending) clock_.Cancel(timer);
  state_->pending.clear();
  while (state_->running > 0) state_->idle.Wait(&state_->mutex);
}

}  // namespace lightstage::sim
