// A USB gadget that poses as an FT232R (0403:6001) and writes down, with time stamps, what a host does to it: every vendor request and every
// byte. For virtual machines with dummy_hcd; the C library only, so that it runs anywhere.
//
//   ftdi_functionfs_peer SERIAL [LOG]       as root; before: modprobe dummy_hcd is_high_speed=0, modprobe libcomposite, usb_f_fs, and
//                                           configfs mounted on /sys/kernel/config
//
// Lines of the log (default: standard output), times in seconds of CLOCK_MONOTONIC:
//   12.345678 event ENABLE
//   12.345678 request 40 04 value 5008 index 0000 length 0
//   12.345678 bytes 64 00ff…
// SIGUSR1 unplugs it, SIGUSR2 plugs it in again, SIGTERM or SIGINT ends it. Line status tells TEMT when the bytes would have left at the rate
// and format that were set.
#include <errno.h>
#include <fcntl.h>
#include <linux/usb/functionfs.h>
#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mount.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

namespace {

constexpr char kGadget[] = "/sys/kernel/config/usb_gadget/lightstage_dmx";
constexpr char kMount[] = "/dev/lightstage_dmx_ffs";
constexpr char kInstance[] = "lightstage_dmx";
constexpr char kUdc[] = "dummy_udc.0";

FILE* log_file = nullptr;
pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;  // of all that follows
double line_free_at = 0;                            // s
double baud = 9600;
int bits_per_byte = 10;

volatile sig_atomic_t want_unplug = 0, want_plug = 0, want_end = 0;

double Now() {
  timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return static_cast<double>(now.tv_sec) + static_cast<double>(now.tv_nsec) * 1e-9;
}

__attribute__((format(printf, 1, 2))) void Log(const char* format, ...) {
  pthread_mutex_lock(&mutex);
  fprintf(log_file, "%.6f ", Now());
  va_list arguments;
  va_start(arguments, format);
  vfprintf(log_file, format, arguments);
  va_end(arguments);
  fputc('\n', log_file);
  fflush(log_file);
  pthread_mutex_unlock(&mutex);
}

[[noreturn]] void Die(const char* what, const char* which) {
  fprintf(stderr, "ftdi_functionfs_peer: %s %s: %s\n", what, which, strerror(errno));
  exit(1);
}

// ---- The gadget in configfs

bool TryWrite(const char* name, const char* text) {
  char path[512];
  snprintf(path, sizeof path, "%s/%s", kGadget, name);
  const int fd = open(path, O_WRONLY | O_CLOEXEC);
  if (fd < 0) return false;
  const size_t length = strlen(text);
  const bool good = write(fd, text, length) == static_cast<ssize_t>(length);
  const int why = errno;
  close(fd);
  errno = why;
  return good;
}

void Write(const char* name, const char* text) {
  if (!TryWrite(name, text)) Die("writing", name);
}

void MakeDirectory(const char* name) {
  char path[512];
  snprintf(path, sizeof path, "%s%s%s", kGadget, *name ? "/" : "", name);
  if (mkdir(path, 0755) != 0 && errno != EEXIST) Die("making", path);
}

void Describe(const char* serial) {
  MakeDirectory("");
  Write("idVendor", "0x0403");
  Write("idProduct", "0x6001");
  Write("bcdDevice", "0x0600");
  TryWrite("max_speed", "full-speed");  // newer kernels; for others dummy_hcd says so
  MakeDirectory("strings/0x409");
  Write("strings/0x409/manufacturer", "FTDI");
  Write("strings/0x409/product", "FT232R USB UART");
  Write("strings/0x409/serialnumber", serial);
  MakeDirectory("configs/c.1");
  char function[64];
  snprintf(function, sizeof function, "functions/ffs.%s", kInstance);
  MakeDirectory(function);
  char target[512], link[512];
  snprintf(target, sizeof target, "%s/%s", kGadget, function);
  snprintf(link, sizeof link, "%s/configs/c.1/ffs.%s", kGadget, kInstance);
  if (symlink(target, link) != 0 && errno != EEXIST) Die("linking", link);
  if (mkdir(kMount, 0755) != 0 && errno != EEXIST) Die("making", kMount);
  if (mount(kInstance, kMount, "functionfs", 0, nullptr) != 0 && errno != EBUSY) {
    Die("mounting functionfs on", kMount);
  }
}

void Plug(bool in) {
  if (TryWrite("UDC", in ? kUdc : "\n")) {
    Log("event %s", in ? "PLUGGED" : "UNPLUGGED");
  } else {
    Log("event %s FAILED %s", in ? "PLUG" : "UNPLUG", strerror(errno));
    if (in) Die("plugging in at", kUdc);
  }
}

// ---- Descriptors: one interface, bulk in 0x81 and bulk out 0x02, full speed

struct __attribute__((packed)) {
  usb_functionfs_descs_head_v2 head;
  __le32 full_speed_count;
  usb_interface_descriptor interface;
  usb_endpoint_descriptor_no_audio in, out;
} const kDescriptors = {
    // This program is for little-endian machines, as the USB is.
    {FUNCTIONFS_DESCRIPTORS_MAGIC_V2, sizeof kDescriptors,
     FUNCTIONFS_HAS_FS_DESC | FUNCTIONFS_ALL_CTRL_RECIP},
    3,
    {USB_DT_INTERFACE_SIZE, USB_DT_INTERFACE, 0, 0, 2, 0xFF, 0xFF, 0xFF, 1},
    {USB_DT_ENDPOINT_SIZE, USB_DT_ENDPOINT, 0x81, USB_ENDPOINT_XFER_BULK, 64, 0},
    {USB_DT_ENDPOINT_SIZE, USB_DT_ENDPOINT, 0x02, USB_ENDPOINT_XFER_BULK, 64, 0},
};

struct __attribute__((packed)) {
  usb_functionfs_strings_head head;
  __le16 language;
  char interface[16];
} const kStrings = {{FUNCTIONFS_STRINGS_MAGIC, sizeof kStrings, 1, 1}, 0x0409, "FT232R USB UART"};

// ---- What an FT232R does

void SetBaud(unsigned value, unsigned index) {
  constexpr int kEighths[8] = {0, 4, 2, 1, 3, 5, 6, 7};
  const double divisor = (value & 0x3FFF) + kEighths[(value >> 14 & 3) | (index & 1) << 2] / 8.0;
  pthread_mutex_lock(&mutex);
  baud = divisor == 0 ? 3e6 : divisor == 1 ? 2e6 : 3e6 / divisor;
  pthread_mutex_unlock(&mutex);
}

void SetData(unsigned value) {
  pthread_mutex_lock(&mutex);
  const bool parity = (value >> 8 & 7) != 0, two = (value >> 11 & 7) == 2;
  bits_per_byte = 1 + static_cast<int>(value & 0xFF) + (parity ? 1 : 0) + (two ? 2 : 1);
  pthread_mutex_unlock(&mutex);
}

void Serve(int ep0, const usb_ctrlrequest& setup) {
  Log("request %02x %02x value %04x index %04x length %d", setup.bRequestType, setup.bRequest,
      setup.wValue, setup.wIndex, setup.wLength);
  const bool in = (setup.bRequestType & USB_DIR_IN) != 0;
  bool known = true;
  uint8_t answer[2] = {0x01, 0x20};
  size_t length = 0;
  switch (setup.bRequestType << 8 | setup.bRequest) {
    case 0x4003:
      SetBaud(setup.wValue, setup.wIndex);
      break;
    case 0x4004:
      SetData(setup.wValue);
      break;
    case 0x4000:
    case 0x4001:
    case 0x4002:
    case 0x4006:
    case 0x4007:
    case 0x4009:
      break;
    case 0xC005:  // modem and line status
      pthread_mutex_lock(&mutex);
      if (Now() >= line_free_at) answer[1] |= 0x40;
      pthread_mutex_unlock(&mutex);
      length = 2;
      break;
    case 0xC00A:  // latency
      answer[0] = 16;
      length = 1;
      break;
    default:
      known = false;
  }
  if (length > setup.wLength) length = setup.wLength;
  // Going the other way than the request stalls it.
  ssize_t done = 0;
  if (in == known) {
    done = write(ep0, answer, known ? length : 0);
  } else {
    done = read(ep0, answer, 0);
  }
  if (done < 0 && errno != EL2HLT && errno != EIDRM) Log("error answering: %s", strerror(errno));
}

void* Receive(void* path) {
  const int out = open(static_cast<const char*>(path), O_RDONLY | O_CLOEXEC);
  if (out < 0) Die("opening", static_cast<const char*>(path));
  while (true) {
    uint8_t packet[64];
    const ssize_t count = read(out, packet, sizeof packet);
    if (count < 0) {
      usleep(10000);  // unplugged
      continue;
    }
    char hex[2 * sizeof packet + 1] = "";
    for (ssize_t i = 0; i < count; ++i) snprintf(hex + 2 * i, 3, "%02x", packet[i]);
    pthread_mutex_lock(&mutex);
    const double now = Now();
    line_free_at = (line_free_at > now ? line_free_at : now) +
                   static_cast<double>(count) * bits_per_byte / baud;
    pthread_mutex_unlock(&mutex);
    Log("bytes %zd %s", count, hex);
  }
}

void OnSignal(int number) {
  if (number == SIGUSR1) {
    want_unplug = 1;
  } else if (number == SIGUSR2) {
    want_plug = 1;
  } else {
    want_end = 1;
  }
}

const char* NameOf(unsigned event) {
  constexpr const char* kNames[] = {"BIND",  "UNBIND",  "ENABLE", "DISABLE",
                                    "SETUP", "SUSPEND", "RESUME"};
  return event < sizeof kNames / sizeof *kNames ? kNames[event] : "UNKNOWN";
}

void TakeSignals() {
  if (want_unplug) {
    want_unplug = 0;
    Plug(false);
  }
  if (want_plug) {
    want_plug = 0;
    Plug(true);
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2 || argc > 3) {
    fprintf(stderr, "usage: ftdi_functionfs_peer SERIAL [LOG]\n");
    return 2;
  }
  log_file = argc == 3 ? fopen(argv[2], "w") : stdout;
  if (log_file == nullptr) Die("opening", argv[2]);
  struct sigaction action = {};
  action.sa_handler = OnSignal;
  constexpr int kSignals[] = {SIGUSR1, SIGUSR2, SIGTERM, SIGINT};
  for (int number : kSignals) sigaction(number, &action, nullptr);

  Describe(argv[1]);
  char path[128];
  snprintf(path, sizeof path, "%s/ep0", kMount);
  const int ep0 = open(path, O_RDWR | O_CLOEXEC);
  if (ep0 < 0) Die("opening", path);
  if (write(ep0, &kDescriptors, sizeof kDescriptors) < 0) Die("writing descriptors to", path);
  if (write(ep0, &kStrings, sizeof kStrings) < 0) Die("writing strings to", path);
  static char out_path[128];
  snprintf(out_path, sizeof out_path, "%s/ep2", kMount);
  pthread_t receiver;
  if (pthread_create(&receiver, nullptr, Receive, out_path) != 0) Die("starting", "a thread");
  Plug(true);

  while (!want_end) {
    TakeSignals();
    pollfd ready = {ep0, POLLIN, 0};
    if (poll(&ready, 1, 200) <= 0) continue;
    usb_functionfs_event events[4];
    const ssize_t count = read(ep0, events, sizeof events);
    if (count < 0) {
      if (errno == EINTR || errno == EAGAIN) continue;
      Die("reading", path);
    }
    for (size_t i = 0; i < static_cast<size_t>(count) / sizeof *events; ++i) {
      if (events[i].type == FUNCTIONFS_SETUP) {
        Serve(ep0, events[i].u.setup);
      } else {
        Log("event %s", NameOf(events[i].type));
      }
    }
  }
  Plug(false);
  return 0;
}
