#include "sim/peers/display/bochs_scanout.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>

#include "absl/strings/str_cat.h"
#include "base/status.h"

namespace lightstage::sim {
namespace {

// QEMU's docs/specs/standard-vga: the dispi registers lie at 0500h of BAR 2, 16 bits each.
constexpr size_t kRegisters = 0x500 / 2;
constexpr size_t kWidth = 1, kHeight = 2, kBitsPerPixel = 3, kEnable = 4, kMemoryWidth = 6,
                 kLeft = 8, kTop = 9;
constexpr uint16_t kEnabled = 1;

template <class Word>
absl::StatusOr<std::span<const volatile Word>> MapBar(const std::string& path) {
  const int file = open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (file < 0) return ErrnoError(errno, "opening", path);
  struct stat status {};
  fstat(file, &status);
  const auto bytes = static_cast<size_t>(status.st_size);
  void* mapped = mmap(nullptr, bytes, PROT_READ, MAP_SHARED, file, 0);
  const int error = errno;
  close(file);
  if (mapped == MAP_FAILED) return ErrnoError(error, "mapping", path);
  return std::span<const volatile Word>(static_cast<const volatile Word*>(mapped),
                                        bytes / sizeof(Word));
}

template <class Word>
void Unmap(std::span<const volatile Word> words) {
  if (!words.empty()) munmap(const_cast<Word*>(words.data()), words.size_bytes());
}

}  // namespace

absl::StatusOr<std::unique_ptr<BochsScanout>> BochsScanout::Map(const std::string& pci) {
  std::unique_ptr<BochsScanout> card(new BochsScanout);
  ASSIGN_OR_RETURN(card->memory_, MapBar<uint32_t>(absl::StrCat(pci, "/resource0")));
  ASSIGN_OR_RETURN(card->registers_, MapBar<uint16_t>(absl::StrCat(pci, "/resource2")));
  return card;
}

BochsScanout::~BochsScanout() {
  Unmap(memory_);
  Unmap(registers_);
}

absl::StatusOr<ScannedOut> BochsScanout::Read() const {
  auto value = [&](size_t index) -> size_t { return registers_[kRegisters + index]; };
  ScannedOut out;
  out.width = static_cast<int>(value(kWidth));
  out.height = static_cast<int>(value(kHeight));
  const size_t pitch = value(kMemoryWidth), count = value(kWidth) * value(kHeight);
  const size_t first = value(kTop) * pitch + value(kLeft);
  if ((value(kEnable) & kEnabled) == 0 || value(kBitsPerPixel) != 32 || count == 0 ||
      pitch < value(kWidth) || first + pitch * value(kHeight) > memory_.size()) {
    return Error(absl::StatusCode::kFailedPrecondition, "NO_SIGNAL",
                 absl::StrCat("the card shows nothing: ", out.width, "x", out.height, " of ",
                              value(kBitsPerPixel), " bits, rows of ", pitch,
                              " pixels, enable register ", value(kEnable)));
  }
  out.offset = first * sizeof(uint32_t);
  out.pixels.reserve(count);
  for (size_t y = 0; y < value(kHeight); ++y) {
    for (size_t x = 0; x < value(kWidth); ++x) {
      out.pixels.push_back(memory_[first + y * pitch + x] & 0xffffff);
    }
  }
  return out;
}

}  // namespace lightstage::sim
