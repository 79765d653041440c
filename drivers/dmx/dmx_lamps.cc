#include "drivers/dmx/dmx_lamps.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "drivers/dmx/discovery.h"
#include "drivers/dmx/widget.h"

namespace lightstage::dmx {
namespace {

class DmxLink final : public LampsLink {
 public:
  DmxLink(const DmxOptions& options, const DeviceContext& context, std::unique_ptr<UsbBus> bus)
      : name_(context.name), options_(options), clock_(*context.clock), bus_(std::move(bus)) {}

  absl::Status Connect() override { return Annotate(ConnectWidget(), name_); }

  LampsInfo info() const override {
    LampsInfo info;
    info.identity.model = model_;
    info.identity.serial = serial_;
    info.count = static_cast<int>(options_.channels.first.size());
    info.steps = options_.channels.steps();
    info.settle = options_.settle;
    // A widget has no timer, and what fixtures do without signal is theirs.
    info.max_time_to_dark = Duration::zero();
    return info;
  }

  absl::StatusOr<std::vector<float>> Set(const std::vector<float>& levels) override {
    if (widget_ == nullptr) RETURN_IF_ERROR(Connect());
    absl::Status shown = widget_->Show(SlotsOf(options_.channels, levels));
    if (!shown.ok()) {
      widget_.reset();
      if (IsDark(levels)) DarkenAnew();
      return Annotate(shown, name_);
    }
    return Quantised(options_.channels, levels);
  }

  absl::Status Check() override {
    absl::Status sending = widget_->Check();
    if (!sending.ok()) widget_.reset();
    return Annotate(sending, name_);
  }

 private:
  absl::Status ConnectWidget() {
    widget_.reset();
    ASSIGN_OR_RETURN(std::unique_ptr<UsbPort> port, bus_->Open(options_.device));
    const UsbIdentity usb = port->identity();
    if (options_.widget == WidgetKind::kOpen && LooksLike(usb) == WidgetKind::kPro) {
      return Error(absl::StatusCode::kFailedPrecondition, "DEVICE_UNSUITABLE",
                   absl::StrCat("the device at ", usb.address, " is a ", usb.product,
                                ": it wants widget = \"pro\""),
                   {{"address", usb.address}, {"product", usb.product}});
    }
    absl::StatusOr<std::unique_ptr<DmxWidget>> widget =
        options_.widget == WidgetKind::kPro
            ? StartProWidget(std::move(port), clock_)
            : StartOpenWidget(std::move(port), clock_, static_cast<size_t>(options_.channels.slots),
                              options_.frame_hz);
    if (!widget.ok()) return widget.status();
    const std::string serial = (*widget)->serial();
    if (connected_ && serial != serial_) {
      return Error(absl::StatusCode::kFailedPrecondition, "DEVICE_UNSUITABLE",
                   absl::StrCat("at ", usb.address, " there is now another widget, with serial \"",
                                serial, "\" and not \"", serial_, "\""),
                   {{"serial", serial}, {"expected", serial_}, {"address", usb.address}});
    }
    RETURN_IF_ERROR((*widget)->Show(SlotsOf(options_.channels, Dark())));
    widget_ = *std::move(widget);
    model_ = widget_->model();
    serial_ = serial;
    connected_ = true;
    return absl::OkStatus();
  }

  std::vector<float> Dark() const {
    return std::vector<float>(options_.channels.first.size(), 0.0f);
  }

  static bool IsDark(const std::vector<float>& levels) {
    return std::all_of(levels.begin(), levels.end(), [](float level) { return level == 0; });
  }

  // The widget has failed, now or since the operation before, so that this one fails: nobody knows what the lamps did meanwhile. They are
  // darkened all the same, if it can be done.
  void DarkenAnew() {
    if (absl::Status dark = Connect(); dark.ok()) {
      spdlog::warn("{}: the widget had failed; it is connected anew, its lamps are dark", name_);
    } else {
      spdlog::error("{}: could not be darkened: {}", name_, MessageOf(dark));
    }
  }

  const std::string name_;
  const DmxOptions options_;
  Clock& clock_;
  const std::unique_ptr<UsbBus> bus_;
  std::unique_ptr<DmxWidget> widget_;  // none after an error
  bool connected_ = false;             // ever
  std::string model_, serial_;
};

}  // namespace

std::unique_ptr<LampsLink> MakeDmxLink(const DmxOptions& options, const DeviceContext& context,
                                       std::unique_ptr<UsbBus> bus) {
  return std::make_unique<DmxLink>(options, context, std::move(bus));
}

absl::StatusOr<std::unique_ptr<Lamps>> OpenDmxLamps(const DmxOptions& options,
                                                    const DeviceContext& context,
                                                    std::unique_ptr<UsbBus> bus) {
  return OpenLinkedLamps(context, "dmx", MakeDmxLink(options, context, std::move(bus)));
}

}  // namespace lightstage::dmx
