// The dmx driver on a real USB, or on that of a virtual machine. Not part of the test suite: it needs a device.
//
//   LIGHTSTAGE_DMX_SERIAL  serial number of the FTDI device (required)
//   LIGHTSTAGE_DMX_WIDGET  "open" (default) or "pro"
//   LIGHTSTAGE_DMX_SLOTS   of the universe, default 512
//   LIGHTSTAGE_DMX_UNPLUG  if set: goes on until the device was lost and is back, at most a minute each
//
// Opens it, sets all lamps to 0, 51, 102 … 255, darkens, closes. They are at channels 1 to 8. Exit status 0 if all was confirmed; each step is a
// line.
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "drivers/dmx/driver.h"

namespace lightstage {
namespace {

using std::chrono::seconds;

std::string Environment(const char* name, const char* fallback) {
  const char* value = std::getenv(name);
  return value != nullptr ? value : fallback;
}

class Session {
 public:
  absl::Status Open() {
    const std::string serial = Environment("LIGHTSTAGE_DMX_SERIAL", "");
    if (serial.empty()) return absl::InvalidArgumentError("LIGHTSTAGE_DMX_SERIAL is not set");
    const std::string toml = absl::StrCat(
        "[lamps]\nwidget = \"", Environment("LIGHTSTAGE_DMX_WIDGET", "open"), "\"\nserial = \"",
        serial, "\"\nslots = ", Environment("LIGHTSTAGE_DMX_SLOTS", "512"),
        "\nfirst_channel = 1\nlamp_count = 8\nsettle_ms = 0\n");
    ASSIGN_OR_RETURN(TomlDocument document, TomlDocument::Parse(toml, "environment"));
    DeviceOpener<Lamps> open = DmxDriver().parse(document.root().Table("lamps"));
    RETURN_IF_ERROR(document.Finish());
    ASSIGN_OR_RETURN(lamps_, open({"lamps", &clock_, nullptr}));
    std::printf("open: %s, serial %s\n", lamps_->info().identity.model.c_str(),
                lamps_->info().identity.serial.c_str());
    return absl::OkStatus();
  }

  absl::Status Set(float level) {
    const TimePoint begin = clock_.Now();
    Pending<LampsState> done(clock_);
    lamps_->Set(std::vector<float>(8, level), begin + seconds(5), done.sink());
    absl::Status set = done.Wait(begin + seconds(6), "Set").status();
    std::printf("set %.3f: %s after %.1f ms\n", static_cast<double>(level), Text(set).c_str(),
                Seconds(clock_.Now() - begin) * 1e3);
    return set;
  }

  absl::Status Dark() {
    Pending<LampsState> done(clock_);
    lamps_->Dark(clock_.Now() + seconds(5), done.sink());
    absl::Status dark = done.Wait(clock_.Now() + seconds(6), "Dark").status();
    std::printf("dark: %s\n", Text(dark).c_str());
    return dark;
  }

  // Sets levels until that goes well, or does not.
  absl::Status Await(bool good) {
    const TimePoint give_up = clock_.Now() + seconds(60);
    while (clock_.Now() < give_up) {
      absl::Status set = Set(1);
      if (set.ok() == good) {
        if (!good && ErrorReason(set) != "DEVICE_LOST") return set;
        return absl::OkStatus();
      }
      SleepFor(clock_, std::chrono::milliseconds(200));
    }
    return absl::DeadlineExceededError(good ? "it did not come back" : "it was not unplugged");
  }

  absl::Status Run() {
    RETURN_IF_ERROR(Open());
    for (int step = 0; step <= 5; ++step) RETURN_IF_ERROR(Set(static_cast<float>(step) / 5));
    if (!Environment("LIGHTSTAGE_DMX_UNPLUG", "").empty()) {
      std::printf("waiting for it to be unplugged\n");
      RETURN_IF_ERROR(Await(false));
      std::printf("waiting for it to be plugged in\n");
      RETURN_IF_ERROR(Await(true));
    }
    SleepFor(clock_, seconds(1));  // frames go on
    RETURN_IF_ERROR(Dark());
    lamps_.reset();
    std::printf("closed\n");
    return absl::OkStatus();
  }

 private:
  static std::string Text(const absl::Status& status) {
    return status.ok() ? "confirmed" : absl::StrCat(ErrorReason(status), ": ", MessageOf(status));
  }

  RealClock clock_;
  std::unique_ptr<Lamps> lamps_;
};

}  // namespace
}  // namespace lightstage

int main() {
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  const absl::Status status = lightstage::Session().Run();
  if (status.ok()) return 0;
  std::fprintf(stderr, "vm_test_dmx: %s\n", lightstage::MessageOf(status).c_str());
  return 1;
}
