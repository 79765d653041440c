// A projector that is an output of this machine's graphics card, as a link for drivers/link/light_link.h.
#pragma once

#include <memory>

#include "drivers/display/options.h"
#include "drivers/link/light_link.h"

namespace lightstage {

class DisplayLink final : public ProjectorLink {
 public:
  // `context` as the device gets it: the geometry says how many pixels the projector has.
  DisplayLink(const DeviceContext& context, const DisplayOptions& options);

  absl::Status Connect() override;
  ProjectorInfo info() const override;
  // Its errors are Screen::Show()'s.
  absl::Status Show(const Pattern& pattern) override;
  absl::Status Check() override;

 private:
  absl::Status Named(const absl::Status& status) const;

  const std::string name_;
  const DisplayOptions options_;
  const int width_, height_;
  std::unique_ptr<Screen> screen_;  // nothing: not connected
  std::string output_;
  bool opened_ = false;  // was connected once; what is odd about the output was logged
};

}  // namespace lightstage
