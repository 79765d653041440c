#include "drivers/v4l2/fake_system.h"

#include <cerrno>

namespace lightstage {

std::vector<std::string> FakeVideoSystem::Paths() {
  std::vector<std::string> paths;
  for (const auto& [path, camera] : nodes_) {
    if (camera == nullptr || camera->plugged()) paths.push_back(path);
  }
  return paths;
}

int FakeVideoSystem::Open(const std::string& path, std::unique_ptr<VideoDevice>* device) {
  if (auto refusal = refusals_.find(path); refusal != refusals_.end()) return refusal->second;
  auto node = nodes_.find(path);
  if (node == nodes_.end()) return ENOENT;
  return node->second->Open(device);
}

}  // namespace lightstage
