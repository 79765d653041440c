#include "drivers/v4l2/v4l2_device.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <filesystem>
#include <fstream>
#include <optional>

#include "base/strings.h"

namespace lightstage {
namespace {

namespace fs = std::filesystem;

std::optional<int> WholeNumber(std::string_view text) {
  int value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

// Both the same device node or the same file.
bool SameFile(const struct stat& a, const struct stat& b) {
  if (S_ISCHR(a.st_mode) && S_ISCHR(b.st_mode)) return a.st_rdev == b.st_rdev;
  return a.st_dev == b.st_dev && a.st_ino == b.st_ino;
}

bool HasOpen(const fs::path& process, const struct stat& file) {
  std::error_code error;
  for (fs::directory_iterator it(process / "fd", error), end; !error && it != end;
       it.increment(error)) {
    struct stat other;
    if (stat(it->path().c_str(), &other) == 0 && SameFile(other, file)) return true;
  }
  return false;
}

}  // namespace

int V4l2Device::Open(const std::string& path, std::unique_ptr<VideoDevice>* device) {
  const int fd = open(path.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC);
  if (fd < 0) return errno;
  device->reset(new V4l2Device(fd));
  return 0;
}

V4l2Device::~V4l2Device() { close(fd_); }

int V4l2Device::Ioctl(unsigned long request, void* argument) {
  int result;
  do {
    result = ioctl(fd_, request, argument);
  } while (result != 0 && errno == EINTR);
  return result == 0 ? 0 : errno;
}

int V4l2Device::Map(size_t length, off_t offset, std::span<std::byte>* memory) {
  void* start = mmap(nullptr, length, PROT_READ | PROT_WRITE, MAP_SHARED, fd_, offset);
  if (start == MAP_FAILED) return errno;
  *memory = {static_cast<std::byte*>(start), length};
  return 0;
}

void V4l2Device::Unmap(std::span<std::byte> memory) { munmap(memory.data(), memory.size()); }

VideoDevice::Readiness V4l2Device::Wait(Duration timeout, int wake_fd) {
  pollfd fds[2] = {{fd_, POLLIN, 0}, {wake_fd, POLLIN, 0}};
  const auto ms = std::chrono::ceil<std::chrono::milliseconds>(timeout).count();
  if (poll(fds, 2, static_cast<int>(std::clamp<int64_t>(ms, 0, 60000))) <= 0) {
    return Readiness::kNothing;  // a signal is no error: who waits looks again
  }
  if ((fds[0].revents & (POLLERR | POLLHUP | POLLNVAL)) != 0) return Readiness::kError;
  return (fds[0].revents & POLLIN) != 0 ? Readiness::kFrame : Readiness::kNothing;
}

V4l2System& V4l2System::Instance() {
  static V4l2System system;
  return system;
}

std::vector<std::string> V4l2System::Paths() {
  constexpr std::string_view kPrefix = "video";
  std::vector<int> numbers;
  std::error_code error;
  for (fs::directory_iterator it("/dev", error), end; !error && it != end; it.increment(error)) {
    const std::string name = it->path().filename();
    if (name.compare(0, kPrefix.size(), kPrefix) != 0) continue;
    if (auto number = WholeNumber(std::string_view(name).substr(kPrefix.size()))) {
      numbers.push_back(*number);
    }
  }
  std::sort(numbers.begin(), numbers.end());
  std::vector<std::string> paths;
  for (int number : numbers) paths.push_back(absl::StrCat("/dev/video", number));
  return paths;
}

int V4l2System::Open(const std::string& path, std::unique_ptr<VideoDevice>* device) {
  return V4l2Device::Open(path, device);
}

std::string V4l2System::HoldersOf(const std::string& path) {
  return ProcessesWithFile("/proc", path, getpid());
}

std::string ProcessesWithFile(const std::string& proc, const std::string& path, int self) {
  struct stat file;
  if (stat(path.c_str(), &file) != 0) return "";
  std::string holders;
  std::error_code error;
  for (fs::directory_iterator it(proc, error), end; !error && it != end; it.increment(error)) {
    const std::optional<int> id = WholeNumber(it->path().filename().native());
    if (!id || *id == self || !HasOpen(it->path(), file)) continue;
    std::string name;
    std::getline(std::ifstream(it->path() / "comm"), name);
    absl::StrAppend(&holders, holders.empty() ? "" : ", ", name, " (process ", *id, ")");
  }
  return holders;
}

}  // namespace lightstage
