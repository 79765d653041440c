// What QEMU's bochs-display scans out, read in the guest past the kernel and all of DRM: the card's registers and video memory, mapped from its
// PCI BARs. Needs root, and iomem=relaxed on the kernel's command line.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace lightstage::sim {

struct ScannedOut {
  int width = 0, height = 0;
  uint64_t offset = 0;           // of the first pixel in video memory
  std::vector<uint32_t> pixels;  // 0x00RRGGBB, top row first
};

class BochsScanout {
 public:
  // The card at `pci`, its folder in /sys/bus/pci/devices.
  static absl::StatusOr<std::unique_ptr<BochsScanout>> Map(const std::string& pci);
  ~BochsScanout();
  BochsScanout(const BochsScanout&) = delete;
  BochsScanout& operator=(const BochsScanout&) = delete;

  // As QEMU's hw/display/bochs-display.c makes a picture of it. FAILED_PRECONDITION / NO_SIGNAL if the card is off or its mode is none of 32 bits.
  absl::StatusOr<ScannedOut> Read() const;

 private:
  BochsScanout() = default;
  std::span<const volatile uint32_t> memory_;
  std::span<const volatile uint16_t> registers_;
};

}  // namespace lightstage::sim
