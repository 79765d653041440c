// A DLPC350 as a link for drivers/link/light_link.h.
#pragma once

#include <array>
#include <memory>

#include "drivers/dlpc350/controller.h"
#include "drivers/dlpc350/options.h"
#include "drivers/link/light_link.h"

namespace lightstage::dlpc350 {

// The mirrors of the DLP4500.
inline constexpr int kMirrorColumns = 912, kMirrorRows = 1140;

class Link final : public ProjectorLink {
 public:
  // `screen` shows the patterns in video mode; nothing in flash mode.
  Link(const DeviceContext& context, Options options, HidOpener open,
       std::unique_ptr<Projector> screen);

  absl::Status Connect() override;
  ProjectorInfo info() const override;
  // DEVICE_FAULT also if the mirrors are parked, the sequencer stands, or an error flag is up; FAILED_PRECONDITION / PATTERN_NOT_STORED if the
  // flash has no such pattern. Takes up to 3 s where stop and start come into force late; nothing is lit meanwhile.
  // After an error the LEDs are off, unless the controller is lost or silent; the log says if they may be on.
  absl::Status Show(const Pattern& pattern) override;
  absl::Status Check() override;

 private:
  std::array<uint8_t, 3> LedCurrents() const;  // as they are told
  absl::Status Configure();
  absl::Status WakeUp();
  // Whether it remembers what it was told on connecting: else it was switched off, or reset itself.
  absl::StatusOr<bool> IsConfigured();
  absl::Status Dark();
  void TryDark();  // as well as it still can
  absl::Status ShowStored(const Pattern& pattern);
  absl::Status ShowVideo(const Pattern& pattern);
  absl::Status ShowOnScreen(const Pattern& pattern);
  // That it works, and runs if `light`.
  absl::Status CheckHealth(bool light);
  absl::Status CheckHealthInTheDark();
  absl::Status AwaitRunning();
  absl::Status Named(const absl::Status& status) const;

  const std::string name_;
  Clock& clock_;
  const Options options_;
  const HidOpener open_;
  const std::unique_ptr<Projector> screen_;
  const int width_, height_;
  std::unique_ptr<Controller> controller_;  // nothing: not connected
  std::string serial_, version_;
  bool connected_once_ = false;
  bool lit_ = false;  // told to show light
};

}  // namespace lightstage::dlpc350
