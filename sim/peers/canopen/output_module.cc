#include "sim/peers/canopen/output_module.h"

#include <algorithm>
#include <utility>

namespace lightstage::sim {

class CanopenOutputModule::Profile final : public PeerProfile {
 public:
  Profile(const OutputModuleOptions& options, std::shared_ptr<World> world)
      : options_(options), world_(std::move(world)), driven_(options.outputs) {}

  ~Profile() override { Apply(std::vector<int>(driven_.size())); }  // the power goes

  void Declare(ObjectDictionary& objects) override {
    objects_ = &objects;
    operational_ = false;
    const uint16_t outputs = options_.analogue ? 0x6411 : 0x6200;
    const uint16_t mode = options_.analogue ? 0x6443 : 0x6206;
    const uint16_t value = options_.analogue ? 0x6444 : 0x6207;
    const int count = options_.analogue ? options_.outputs : options_.outputs / 8;
    objects.Constant(outputs, 0, 1, static_cast<uint32_t>(count));
    for (int i = 1; i <= count; ++i) {
      const auto sub = static_cast<uint8_t>(i);
      objects.Variable(outputs, sub, options_.analogue ? 2 : 1, 0,
                       [this, i](uint32_t written) { return Write(i - 1, written); });
      if (!options_.has_error_mode) continue;
      // As it leaves the factory it keeps its outputs whatever happens.
      objects.Variable(mode, sub, 1, 0);
      objects.Variable(value, sub, options_.analogue ? 4 : 1, options_.analogue ? 20000 : 0xFF);
    }
    if (options_.has_error_mode) {
      objects.Constant(mode, 0, 1, static_cast<uint32_t>(count));
      objects.Constant(value, 0, 1, static_cast<uint32_t>(count));
    }
    Apply(std::vector<int>(driven_.size()));
  }

  // An output that an error has switched stays so until it is written while operational; its object keeps what was written.
  void NmtChanged(bool operational) override {
    if (!operational) TakeErrorValues();
    operational_ = operational;
  }
  void MasterLost() override { TakeErrorValues(); }

  void IgnoreWrites(bool ignore) { ignore_ = ignore; }

 private:
  uint32_t Write(int object, uint32_t written) {
    if (ignore_) return ObjectDictionary::kNotTaken;
    if (!operational_) return 0;
    std::vector<int> driven = driven_;
    if (options_.analogue) {
      if (written > 32767) return 0x06090032;
      driven[object] = static_cast<int>(written);
    } else {
      for (int bit = 0; bit < 8; ++bit) driven[object * 8 + bit] = (written >> bit & 1) != 0;
    }
    Apply(std::move(driven));
    return 0;
  }

  void TakeErrorValues() {
    if (!options_.has_error_mode) return;
    std::vector<int> driven = driven_;
    for (size_t i = 0; i < driven.size(); ++i) {
      if (options_.analogue) {
        const auto sub = static_cast<uint8_t>(i + 1);
        if (objects_->Value(0x6443, sub) == 1) {
          driven[i] = static_cast<int>(objects_->Value(0x6444, sub));
        }
      } else {
        const auto sub = static_cast<uint8_t>(i / 8 + 1);
        if ((objects_->Value(0x6206, sub) >> (i % 8) & 1) != 0) {
          driven[i] = static_cast<int>(objects_->Value(0x6207, sub) >> (i % 8) & 1);
        }
      }
    }
    Apply(std::move(driven));
  }

  void Apply(std::vector<int> driven) {
    driven_ = std::move(driven);
    std::vector<float> levels(world_->geometry().brace.lamps.size());
    for (size_t lamp = 0; lamp < levels.size(); ++lamp) {
      const size_t output = lamp + static_cast<size_t>(options_.first_output);
      if (output >= driven_.size()) break;
      levels[lamp] = options_.analogue ? static_cast<float>(driven_[output] / 32767.0)
                                       : static_cast<float>(driven_[output]);
    }
    world_->RampLamps(world_->clock().Now(), options_.rise, {}, levels);
  }

  const OutputModuleOptions options_;
  const std::shared_ptr<World> world_;  // shared: with the rig's other simulated devices
  ObjectDictionary* objects_ = nullptr;
  std::vector<int> driven_;  // what every output really is
  bool operational_ = false, ignore_ = false;
};

CanopenOutputModule::CanopenOutputModule(std::unique_ptr<canopen::CanPort> port,
                                         const OutputModuleOptions& options,
                                         const std::shared_ptr<World>& world)
    : profile_(std::make_unique<Profile>(options, world)),
      node_(std::make_unique<PeerNode>(std::move(port), options.identity, *profile_,
                                       world->clock())) {
  node_->Start();
}

CanopenOutputModule::~CanopenOutputModule() = default;

void CanopenOutputModule::IgnoreWrites(bool ignore) {
  node_->Do([&](ObjectDictionary&) { profile_->IgnoreWrites(ignore); });
}

}  // namespace lightstage::sim
