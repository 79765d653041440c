// What the kernel says of the outputs of its graphics cards (KMS). For the screen process only: SDL has the outputs of one card, by number and
// as they were when it began, and only logs that a picture was refused (SDL 2.26, KMSDRM_GLES_SwapWindow).
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "absl/status/statusor.h"
#include "drivers/display/head.h"

namespace lightstage {

class KmsCard {
 public:
  // The connected outputs of all cards, by the names that the kernel has for them ("HDMI-A-1"). NOT_FOUND / DEVICE_NOT_FOUND if there are none.
  static absl::StatusOr<std::vector<Head>> Heads();

  // The one of `head`. Once SDL has it: who opens a card first is its master, and that must be SDL.
  static absl::StatusOr<std::unique_ptr<KmsCard>> Open(const Head& head);
  ~KmsCard();
  KmsCard(const KmsCard&) = delete;
  KmsCard& operator=(const KmsCard&) = delete;

  // That the output is as it was and takes codes as they are. UNAVAILABLE / DEVICE_LOST: unplugged, without link or off. FAILED_PRECONDITION:
  // DISPLAY_CHANGED naming both modes, DISPLAY_GAMMA if a table or matrix that another program left changes the codes.
  absl::Status Check() const;

  // The kernel's number for the picture that the output has been given last; 0: none.
  uint32_t Picture() const;

 private:
  KmsCard(int file, const Head& head);
  const int file_;
  const Head head_;
  // Some drivers have an output that SDL has lit still sleep.
  const bool tells_sleep_;
};

}  // namespace lightstage
