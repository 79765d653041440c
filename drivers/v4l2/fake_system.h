// The video device nodes of a machine, for tests.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "drivers/v4l2/fake_camera.h"

namespace lightstage {

// The nodes of a machine; cameras outlive it.
class FakeVideoSystem final : public VideoSystem {
 public:
  void Add(const std::string& path, FakeCamera* camera) { nodes_[path] = camera; }
  void Remove(const std::string& path) { nodes_.erase(path); }
  void Refuse(const std::string& path, int error) { refusals_[path] = error; }
  void SetHolders(std::string holders) { holders_ = std::move(holders); }

  std::vector<std::string> Paths() override;
  int Open(const std::string& path, std::unique_ptr<VideoDevice>* device) override;
  std::string HoldersOf(const std::string&) override { return holders_; }

 private:
  std::map<std::string, FakeCamera*> nodes_;
  std::map<std::string, int> refusals_;
  std::string holders_;
};

}  // namespace lightstage
