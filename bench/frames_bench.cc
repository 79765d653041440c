// Frames per second that a camera's driver delivers, and what a megabyte of them costs it, against the tool that everybody has for such a
// camera, on the same camera. Each contender is a process of its own, so that the kernel says what it used, and is measured as the
// difference between a long and a short run: starting does not count. Goal: the tool's rate, within 5 %.
//
//   frames_bench                              aravis against arv-camera-test-0.8, on libaravis' fake GigE Vision camera
//   frames_bench NODE WIDTH HEIGHT RATE       v4l2 against v4l2-ctl, on a camera of the kernel (vivid) with 8-bit grey at this rate
//
// libaravis' fake camera is served by this program, for the one that Debian has (arv-fake-gv-camera-0.8) looks for triggers 25 times a
// second and draws every picture: here it looks 200 times and draws nothing. It exposes for no time and sends a frame in one burst.

#include <arv.h>
#include <fcntl.h>
#include <linux/videodev2.h>
#include <signal.h>
#include <spdlog/spdlog.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "base/memory.h"
#include "base/status.h"
#include "bench/percentiles.h"
#include "bench/video_system.h"
#include "drivers/aravis/driver.h"
#include "drivers/conformance/private_network.h"
#include "drivers/v4l2/v4l2_camera.h"

namespace lightstage::bench {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr int kRounds = 3;
constexpr int kShortRun_s = 2, kLongRun_s = 7;

// What came of a run. `frames` are those that somebody gets, `received` all that the stream had.
struct Run {
  double seconds = 0, cpu_s = 0;
  double frames = 0, received = 0, failed = 0;
};

Run operator-(const Run& a, const Run& b) {
  return {a.seconds - b.seconds, a.cpu_s - b.cpu_s, a.frames - b.frames, a.received - b.received,
          a.failed - b.failed};
}

struct Contender {
  std::string name;
  std::function<absl::StatusOr<Run>(int seconds)> run;
};

// ---- Processes

// What `body` does in a process of its own and writes to its standard output, and the processor time of it.
absl::StatusOr<std::string> InChild(const std::function<int()>& body, double* cpu_s) {
  int ends[2];
  if (pipe2(ends, O_CLOEXEC) != 0) return ErrnoError(errno, "making", "a pipe");
  std::fflush(stdout);
  const pid_t child = fork();
  if (child < 0) return ErrnoError(errno, "starting", "a process");
  if (child == 0) {
    dup2(ends[1], STDOUT_FILENO);
    const int result = body();
    std::fflush(stdout);
    _exit(result);
  }
  close(ends[1]);
  std::string text;
  char bytes[4096];
  for (ssize_t size; (size = read(ends[0], bytes, sizeof bytes)) > 0;) text.append(bytes, size);
  close(ends[0]);
  int status = 0;
  rusage used = {};
  wait4(child, &status, 0, &used);
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0) {
    return absl::UnavailableError(absl::StrCat("a process failed (", status, "): ", text));
  }
  const auto time = [](const timeval& t) { return t.tv_sec + t.tv_usec * 1e-6; };
  *cpu_s = time(used.ru_utime) + time(used.ru_stime);
  return text;
}

absl::StatusOr<std::string> Tool(std::vector<std::string> arguments, double* cpu_s) {
  return InChild(
      [&] {
        dup2(STDOUT_FILENO, STDERR_FILENO);
        std::vector<char*> argv;
        for (std::string& argument : arguments) argv.push_back(argument.data());
        argv.push_back(nullptr);
        execvp(argv[0], argv.data());
        std::perror(argv[0]);
        return 127;
      },
      cpu_s);
}

// ---- The driver's side

// As fast as the contract allows: the next shot when the last one's frame is there.
absl::StatusOr<Run> Shoot(Camera& camera, Clock& clock, const CameraConfig& config,
                          Duration exposure, Duration time) {
  Pending<CameraConfig> configured(clock), armed(clock);
  camera.Configure(config, clock.Now() + seconds(30), configured.sink());
  RETURN_IF_ERROR(configured.Wait(kNever, "Configure").status());
  camera.Arm(clock.Now() + seconds(30), armed.sink());
  RETURN_IF_ERROR(armed.Wait(kNever, "Arm").status());
  Run run;
  const TimePoint begin = clock.Now();
  while (clock.Now() < begin + time) {
    Pending<Frame> frame(clock);
    camera.Trigger(
        exposure, clock.Now() + seconds(10), [](absl::StatusOr<ExposureEnd>) {}, frame.sink());
    if (frame.Wait(kNever, "the frame").ok()) {
      ++run.frames;
    } else {
      ++run.failed;
    }
  }
  run.seconds = Seconds(clock.Now() - begin);
  run.received = run.frames + run.failed;
  return run;
}

// `shoot` in a process of its own.
absl::StatusOr<Run> Driver(const std::function<absl::StatusOr<Run>()>& shoot) {
  double cpu_s = 0;
  ASSIGN_OR_RETURN(const std::string said,
                   InChild(
                       [&] {
                         KeepFrameMemory();  // as the daemon does
                         const absl::StatusOr<Run> run = shoot();
                         if (!run.ok()) {
                           std::printf("%s", MessageOf(run.status()).c_str());
                           return 1;
                         }
                         std::printf("%.9g %.9g %.9g %.9g", run->seconds, run->frames,
                                     run->received, run->failed);
                         return 0;
                       },
                       &cpu_s));
  Run run;
  if (std::sscanf(said.c_str(), "%lf %lf %lf %lf", &run.seconds, &run.frames, &run.received,
                  &run.failed) != 4) {
    return absl::InternalError(said);
  }
  run.cpu_s = cpu_s;
  return run;
}

// ---- The match

absl::Status Compare(const std::vector<Contender>& contenders, double megabytes) {
  std::printf("%-42s %9s %9s %8s %10s %10s %8s\n", "", "frames/s", "received", "failed", "MB/s",
              "CPU ms/MB", "rate");
  std::vector<std::vector<double>> rate(contenders.size()), received(contenders.size()),
      cost(contenders.size());
  std::vector<double> failed(contenders.size());
  for (int round = 0; round < kRounds; ++round) {
    for (size_t i = 0; i < contenders.size(); ++i) {
      ASSIGN_OR_RETURN(const Run began, contenders[i].run(kShortRun_s));
      ASSIGN_OR_RETURN(const Run ended, contenders[i].run(kLongRun_s));
      const Run run = ended - began;
      rate[i].push_back(run.frames / run.seconds);
      received[i].push_back(run.received / run.seconds);
      cost[i].push_back(run.cpu_s * 1e3 / (run.received * megabytes));
      failed[i] += ended.failed;
    }
  }
  const double first = Percentile(rate[0], 0.5);
  for (size_t i = 0; i < contenders.size(); ++i) {
    const double median = Percentile(rate[i], 0.5), all = Percentile(received[i], 0.5);
    std::printf("%-42s %9.2f %9.2f %8.0f %10.2f %10.3f %8.3f\n", contenders[i].name.c_str(), median,
                all, failed[i], all * megabytes, Percentile(cost[i], 0.5), median / first);
  }
  return absl::OkStatus();
}

// ---- aravis

constexpr char kAddress[] = "127.0.0.1";
constexpr int kWidth = 1280, kHeight = 1024;
constexpr int kPacketSize = 7000;
constexpr double kTriggerHz = 200;

// libaravis' fake camera in a process of its own, until this is gone.
class FakeCamera {
 public:
  FakeCamera() {
    int ready[2];
    if (pipe2(ready, O_CLOEXEC) != 0) std::abort();
    process_ = fork();
    if (process_ == 0) Serve(ready[1]);
    close(ready[1]);
    char byte = 0;
    started_ = read(ready[0], &byte, 1) == 1;
    close(ready[0]);
  }
  ~FakeCamera() {
    kill(process_, SIGKILL);
    waitpid(process_, nullptr, 0);
  }
  bool started() const { return started_; }

 private:
  [[noreturn]] static void Serve(int ready) {
    ArvGvFakeCamera* served = arv_gv_fake_camera_new(kAddress, "BENCH1");
    if (!arv_gv_fake_camera_is_running(served)) _exit(1);
    ArvFakeCamera* fake = arv_gv_fake_camera_get_fake_camera(served);
    for (auto [address, value] : {std::pair(ARV_FAKE_CAMERA_REGISTER_SENSOR_WIDTH, kWidth),
                                  {ARV_FAKE_CAMERA_REGISTER_SENSOR_HEIGHT, kHeight}}) {
      arv_fake_camera_write_register(fake, address, static_cast<guint32>(value));
    }
    arv_fake_camera_set_trigger_frequency(fake, kTriggerHz);
    arv_fake_camera_set_fill_pattern(
        fake, +[](ArvBuffer*, void*, guint32, guint32, ArvPixelFormat) {}, nullptr);
    if (write(ready, "r", 1) != 1) _exit(1);
    while (true) pause();
  }
  pid_t process_ = -1;
  bool started_ = false;
};

absl::StatusOr<Run> ArvCameraTest(const std::vector<std::string>& trigger, int seconds) {
  std::vector<std::string> arguments = {"arv-camera-test-0.8",
                                        "--name",
                                        kAddress,
                                        "--width",
                                        absl::StrCat(kWidth),
                                        "--height",
                                        absl::StrCat(kHeight),
                                        "--gv-packet-size",
                                        absl::StrCat(kPacketSize),
                                        "--no-packet-socket",
                                        "--auto",
                                        absl::StrCat("--duration=", seconds)};
  arguments.insert(arguments.end(), trigger.begin(), trigger.end());
  Run run;
  run.seconds = seconds;
  ASSIGN_OR_RETURN(const std::string said, Tool(arguments, &run.cpu_s));
  const char* completed = std::strstr(said.c_str(), "n_completed_buffers");
  const char* failures = std::strstr(said.c_str(), "n_failures");
  if (completed == nullptr || failures == nullptr ||
      std::sscanf(completed, "n_completed_buffers = %lf", &run.frames) != 1 ||
      std::sscanf(failures, "n_failures = %lf", &run.failed) != 1) {
    return absl::InternalError(said);
  }
  run.received = run.frames + run.failed;
  return run;
}

absl::StatusOr<Run> ShootAravis(int run_s) {
  RealClock clock;
  ASSIGN_OR_RETURN(TomlDocument document,
                   TomlDocument::Parse(absl::StrCat("[camera]\naddress = \"", kAddress,
                                                    "\"\npacket_size = ", kPacketSize, "\n"),
                                       "rig.toml"));
  DeviceOpener<Camera> open = AravisDriver().parse(document.root().Table("camera"));
  RETURN_IF_ERROR(document.Finish());
  ASSIGN_OR_RETURN(std::unique_ptr<Camera> camera, open({"camera", &clock, nullptr}));
  return Shoot(*camera, clock, {PixelFormat::kMono8, kWidth, kHeight, camera->info().min_gain_db},
               milliseconds(1), seconds(run_s));
}

absl::Status CompareAravis() {
  EnterPrivateNetwork();
  FakeCamera camera;
  if (!camera.started()) return absl::UnavailableError("the fake camera does not start");
  // The tool triggers by its own time: twice as often as the camera looks, so that it always finds one.
  const std::vector<std::string> triggered = {"--software-trigger", absl::StrCat(2 * kTriggerHz)},
                                 free = {"--frequency", absl::StrCat(kTriggerHz)};
  return Compare(
      {{"arv-camera-test-0.8, software trigger",
        [&](int run_s) { return ArvCameraTest(triggered, run_s); }},
       {"arv-camera-test-0.8, running freely",
        [&](int run_s) { return ArvCameraTest(free, run_s); }},
       {"aravis, shots", [](int run_s) { return Driver([=] { return ShootAravis(run_s); }); }}},
      kWidth * kHeight * 1e-6);
}

// ---- v4l2

// Counts the frames that were taken from it.
class CountingDevice final : public ForwardingDevice {
 public:
  CountingDevice(std::unique_ptr<VideoDevice> device, std::atomic<int>& frames)
      : ForwardingDevice(std::move(device)), frames_(frames) {}
  int Ioctl(unsigned long request, void* argument) override {
    const int error = ForwardingDevice::Ioctl(request, argument);
    if (request == VIDIOC_DQBUF && error == 0) ++frames_;
    return error;
  }

 private:
  std::atomic<int>& frames_;
};

struct VideoSource {
  std::string node;
  int width = 0, height = 0;
  double rate = 0;
};

absl::StatusOr<Run> V4l2Ctl(const VideoSource& source, int run_s) {
  Run run;
  run.frames = run.received = std::max(1.0, run_s * source.rate);
  RealClock clock;
  const TimePoint begin = clock.Now();
  RETURN_IF_ERROR(Tool({"v4l2-ctl", absl::StrCat("--device=", source.node),
                        absl::StrCat("--set-fmt-video=width=", source.width,
                                     ",height=", source.height, ",pixelformat=GREY"),
                        absl::StrCat("--set-parm=", source.rate), "--stream-mmap=4",
                        absl::StrCat("--stream-count=", run.frames)},
                       &run.cpu_s)
                      .status());
  run.seconds = Seconds(clock.Now() - begin);
  return run;
}

absl::StatusOr<Run> ShootV4l2(const VideoSource& source, std::optional<Duration> latency,
                              int run_s) {
  RealClock clock;
  TalliedSystem<CountingDevice, std::atomic<int>> system;
  V4l2Options options;
  options.device = source.node;
  options.frames_per_s = source.rate;
  options.fixed_exposure = milliseconds(1);
  options.latency = latency;
  ASSIGN_OR_RETURN(std::unique_ptr<Camera> camera,
                   V4l2Camera::Open(system, options, {"camera", &clock, nullptr}));
  ASSIGN_OR_RETURN(
      Run run, Shoot(*camera, clock,
                     {PixelFormat::kMono8, source.width, source.height, camera->info().min_gain_db},
                     milliseconds(1), seconds(run_s)));
  run.received = system.tally;
  return run;
}

absl::Status CompareV4l2(const VideoSource& source) {
  const auto shots = [&source](std::optional<Duration> latency) {
    return [&source, latency](int run_s) {
      return Driver([=, &source] { return ShootV4l2(source, latency, run_s); });
    };
  };
  return Compare({{"v4l2-ctl --stream-mmap", [&](int run_s) { return V4l2Ctl(source, run_s); }},
                  {"v4l2, shots, latency_ms = 0", shots(Duration::zero())},
                  {"v4l2, shots, latency_ms not known", shots(std::nullopt)}},
                 source.width * source.height * 1e-6);
}

}  // namespace
}  // namespace lightstage::bench

int main(int argc, char** argv) {
  using namespace lightstage::bench;
  spdlog::set_level(spdlog::level::err);
  if (argc != 1 && argc != 5) {
    return std::fprintf(stderr, "usage: frames_bench [NODE WIDTH HEIGHT RATE]\n"), 2;
  }
  const absl::Status compared =
      argc == 1
          ? CompareAravis()
          : CompareV4l2({argv[1], std::atoi(argv[2]), std::atoi(argv[3]), std::atof(argv[4])});
  if (!compared.ok()) std::fprintf(stderr, "%s\n", lightstage::MessageOf(compared).c_str());
  return compared.ok() ? 0 : 1;
}
