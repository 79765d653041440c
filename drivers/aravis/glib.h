// What the driver needs of libaravis' ways: errors, units, references.
#pragma once

#include <arv.h>

#include <string>

#include "absl/base/thread_annotations.h"
#include "base/clock.h"
#include "base/mutex.h"

namespace lightstage {

// A GError on the stack that becomes a Status.
class GErrorSlot {
 public:
  GErrorSlot() = default;
  GErrorSlot(const GErrorSlot&) = delete;
  GErrorSlot& operator=(const GErrorSlot&) = delete;
  ~GErrorSlot() { g_clear_error(&error_); }
  GError** out() {
    g_clear_error(&error_);
    return &error_;
  }
  const GError* get() const { return error_; }
  std::string message() const { return error_ ? error_->message : "no answer"; }

 private:
  GError* error_ = nullptr;
};

// GenICam counts exposures in them.
inline Duration Microseconds(double us) { return FromSeconds(us * 1e-6); }

inline std::string OrEmpty(const char* text) { return text ? text : ""; }

// The last reference of a device. It has to be given back here: Aravis emits "control-lost" on the device's heartbeat thread, with a
// reference of its own, and the device's end joins that thread.
class LastReference {
 public:
  explicit LastReference(ArvDevice* device) : device_(G_OBJECT(device)) {
    g_object_add_toggle_ref(device_, OnChange, this);
  }
  // Waits for the others, and so for what is just being emitted.
  ~LastReference() {
    {
      MutexLock lock(&mutex_);
      while (!alone_) changed_.Wait(&mutex_);
    }
    g_object_remove_toggle_ref(device_, OnChange, this);
  }
  LastReference(const LastReference&) = delete;
  LastReference& operator=(const LastReference&) = delete;

 private:
  static void OnChange(gpointer self, GObject*, gboolean alone) {
    auto* reference = static_cast<LastReference*>(self);
    MutexLock lock(&reference->mutex_);
    reference->alone_ = alone != FALSE;
    reference->changed_.SignalAll();
  }

  GObject* const device_;
  Mutex mutex_;
  CondVar changed_;
  bool alone_ ABSL_GUARDED_BY(mutex_) = false;
};

}  // namespace lightstage
