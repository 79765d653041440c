// The outputs of a CiA 401 module as lamps: digital outputs 6200h, eight to an object, or analogue ones 6411h, written and read back by
// SDO. Time to dark is the module's own heartbeat consumer 1016h: this computer's heartbeat for it is said at Set and Refresh only.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "drivers/canopen/node.h"
#include "drivers/canopen/options.h"
#include "drivers/link/light_link.h"

namespace lightstage::canopen {

// LampsLink's errors, and FAILED_PRECONDITION / LAMP_NOT_CONFIRMED (Set: an output reads back as something else), / LAMPS_DARK
// (Refresh: the module went dark by itself) and / DEVICE_UNSUITABLE (Connect).
class CanopenLampsLink final : public LampsLink {
 public:
  CanopenLampsLink(const std::string& device, const LampsOptions& options, int lamps,
                   std::shared_ptr<CanBus> bus);
  ~CanopenLampsLink() override;

  absl::Status Connect() override;
  LampsInfo info() const override;
  absl::StatusOr<std::vector<float>> Set(const std::vector<float>& levels) override;
  absl::Status Check() override;
  absl::Status SetTimeToDark(Duration time) override;
  absl::Status Refresh() override;

 private:
  // An object that is written at once: a group of eight lamps, or one.
  struct Output {
    uint8_t sub = 0;
    std::optional<int> value;  // as confirmed; nothing: unknown
  };

  bool digital() const { return options_.output == LampOutput::kDigital; }
  // Values of outputs_ for the levels.
  std::vector<int> ValuesOf(const std::vector<float>& levels) const;
  std::vector<float> LevelsOf() const;
  absl::Status SetErrorMode();
  absl::Status WriteAll(const std::vector<int>& values);
  absl::Status WriteOutput(Output& output, int value);
  absl::Status Confirm(const ObjectAddress& object, int value);
  absl::Status CheckLit();
  int Trouble() const;  // code of the emergency in force; 0: none
  absl::Status Say();
  absl::Status Start();
  absl::Status WriteTimeToDark();

  const LampsOptions options_;
  const int lamps_;
  Node node_;
  std::optional<NodeIdentity> identity_;
  std::vector<Output> outputs_;
  bool goes_dark_ = false;  // it can watch us, and its outputs go to 0 then
  Duration time_to_dark_{};
  bool connected_ = false;
  TimePoint said_{};          // our last heartbeat for it
  bool may_be_dark_ = false;  // it may have missed one; until it is started anew
  bool lit_ = false;
  int trouble_when_set_ = 0;
};

}  // namespace lightstage::canopen
