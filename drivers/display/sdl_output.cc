#include "drivers/display/sdl_output.h"

#define SDL_MAIN_HANDLED
#include <SDL.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <thread>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "base/status.h"

namespace lightstage {
namespace {

using Steady = std::chrono::steady_clock;

// Of an output that tells its rate, or 60 Hz.
std::chrono::duration<double> RefreshTime(const ScreenInfo& info) {
  return std::chrono::duration<double>(1 / (info.refresh_hz > 0 ? info.refresh_hz : 60));
}

absl::Status SdlError(std::string_view what) {
  return Error(absl::StatusCode::kUnavailable, "DEVICE_LOST",
               absl::StrCat(what, ": ", static_cast<const char*>(SDL_GetError())));
}

// Whatever the environment says.
void Hint(const char* name, const std::string& value) {
  SDL_SetHintWithPriority(name, value.c_str(), SDL_HINT_OVERRIDE);
}

// Hints for exact pixels and nothing else on the screen. SDL's environment is this process' own.
absl::Status StartSdl(const std::string& backend, const std::string& x_display, int card) {
  if (backend == "x11" && !x_display.empty()) setenv("DISPLAY", x_display.c_str(), 1);
  Hint(SDL_HINT_KMSDRM_DEVICE_INDEX, absl::StrCat(card));
  SDL_SetMainReady();
  Hint(SDL_HINT_VIDEODRIVER, backend);
  Hint(SDL_HINT_NO_SIGNAL_HANDLERS, "1");
  // No window manager moves, resizes or decorates it.
  Hint("SDL_X11_FORCE_OVERRIDE_REDIRECT", "1");
  Hint(SDL_HINT_VIDEO_X11_NET_WM_BYPASS_COMPOSITOR, "1");
  Hint(SDL_HINT_VIDEO_MINIMIZE_ON_FOCUS_LOSS, "0");
  Hint(SDL_HINT_RENDER_SCALE_QUALITY, "nearest");
  // What the software renderer drew goes to the screen as it is, not through a GL, which may be done in software too.
  Hint(SDL_HINT_FRAMEBUFFER_ACCELERATION, "0");
  Hint(SDL_HINT_VIDEO_ALLOW_SCREENSAVER, "0");
  if (SDL_Init(SDL_INIT_VIDEO) != 0) {
    return Error(absl::StatusCode::kNotFound, "DEVICE_NOT_FOUND",
                 absl::StrCat("no display by backend ", backend, ": ",
                              static_cast<const char*>(SDL_GetError())));
  }
  SDL_DisableScreenSaver();
  SDL_ShowCursor(SDL_DISABLE);
  return absl::OkStatus();
}

ScreenInfo InfoOf(const Head& head) {
  ScreenInfo info;
  info.output = head.name;
  info.width = head.width;
  info.height = head.height;
  info.refresh_hz = head.refresh_hz;
  if (!head.preferred) {
    info.note = absl::StrFormat(
        "output %s runs at %dx%d, which is not the mode that it prefers: what is behind it may "
        "scale",
        head.name, head.width, head.height);
  }
  return info;
}

absl::StatusOr<Head> Choose(const std::vector<Head>& heads, const OutputOptions& options) {
  std::vector<Head> fitting;
  std::string there_are;
  for (size_t i = 0; i < heads.size(); ++i) {
    absl::StrAppend(&there_are, i > 0 ? ", " : "", i, ": ", heads[i].name, " (", heads[i].width,
                    "x", heads[i].height, ")");
    if (options.output.empty() ? static_cast<int>(i) == options.output_index
                               : heads[i].name == options.output) {
      fitting.push_back(heads[i]);
    }
  }
  const std::string wanted = options.output.empty() ? absl::StrCat(options.output_index)
                                                    : absl::StrCat("\"", options.output, "\"");
  if (fitting.empty()) {
    return Error(absl::StatusCode::kNotFound, "DEVICE_NOT_FOUND",
                 absl::StrCat("there is no output ", wanted, "; there are ",
                              there_are.empty() ? "none" : there_are),
                 {{"output", wanted}});
  }
  if (fitting.size() > 1) {
    return Error(absl::StatusCode::kFailedPrecondition, "DEVICE_UNSUITABLE",
                 absl::StrCat(fitting.size(), " outputs are called ", wanted,
                              ": choose by output_index; there are ", there_are),
                 {{"output", wanted}});
  }
  return fitting.front();
}

}  // namespace

absl::StatusOr<std::unique_ptr<SdlOutput>> SdlOutput::Open(const OutputOptions& options) {
  std::unique_ptr<SdlOutput> output(new SdlOutput(options));
  RETURN_IF_ERROR(output->Start());
  return output;
}

absl::StatusOr<std::vector<ScreenInfo>> SdlOutput::List(const std::string& backend,
                                                        const std::string& x_display) {
  std::vector<Head> heads;
  if (backend == "x11") {
    ASSIGN_OR_RETURN(std::unique_ptr<X11Server> server, X11Server::Connect(x_display));
    heads = server->Heads();
  } else {
    ASSIGN_OR_RETURN(heads, KmsCard::Heads());
  }
  std::vector<ScreenInfo> outputs;
  for (const Head& head : heads) outputs.push_back(InfoOf(head));
  return outputs;
}

absl::Status SdlOutput::Start() {
  std::vector<Head> heads;
  if (options_.backend == "x11") {
    ASSIGN_OR_RETURN(server_, X11Server::Connect(options_.x_display));
    heads = server_->Heads();
  } else {
    ASSIGN_OR_RETURN(heads, KmsCard::Heads());
  }
  ASSIGN_OR_RETURN(head_, Choose(heads, options_));
  info_ = InfoOf(head_);
  if (head_.width != options_.width || head_.height != options_.height) {
    return Error(
        absl::StatusCode::kFailedPrecondition, "DEVICE_UNSUITABLE",
        absl::StrFormat("output %s has %dx%d pixels, the rig's projector %dx%d: they must be "
                        "the same, so that nothing is scaled",
                        head_.name, head_.width, head_.height, options_.width, options_.height),
        {{"output", head_.name}});
  }
  if (!head_.altered.empty()) {
    return Error(absl::StatusCode::kFailedPrecondition, "DEVICE_UNSUITABLE",
                 absl::StrCat("output ", head_.name, " is ", head_.altered,
                              " by the X server: pixels must come out as they are (xrandr --scale "
                              "1x1 --rotate normal --reflect normal)"),
                 {{"output", head_.name}});
  }
  if (server_ != nullptr) {
    server_->KeepAwake();
    RETURN_IF_ERROR(CheckMode());
  }
  RETURN_IF_ERROR(StartSdl(options_.backend, options_.x_display, head_.card));
  RETURN_IF_ERROR(OpenWindow());
  if (server_ == nullptr) {
    ASSIGN_OR_RETURN(card_, KmsCard::Open(head_));
  }
  pixels_.assign(static_cast<size_t>(head_.width) * head_.height, 0);
  read_back_.resize(pixels_.size());
  RETURN_IF_ERROR(MeasurePacing());
  return Show(std::vector<uint32_t>(pixels_.size(), 0));
}

absl::Status SdlOutput::OpenWindow() {
  // kmsdrm knows full screen windows only; on X11 this one is over everything at its place without asking anybody.
  const bool x11 = server_ != nullptr;
  const int any = SDL_WINDOWPOS_UNDEFINED_DISPLAY(head_.place);
  window_ = SDL_CreateWindow(
      "lightstage projector", x11 ? head_.x : any, x11 ? head_.y : any, head_.width, head_.height,
      SDL_WINDOW_SHOWN |
          (x11 ? SDL_WINDOW_BORDERLESS | SDL_WINDOW_ALWAYS_ON_TOP : SDL_WINDOW_FULLSCREEN_DESKTOP));
  if (window_ == nullptr) return SdlError("opening the window");
  const bool software = options_.renderer == "software";
  renderer_ = SDL_CreateRenderer(
      window_, -1,
      software ? SDL_RENDERER_SOFTWARE : SDL_RENDERER_ACCELERATED | SDL_RENDERER_PRESENTVSYNC);
  SDL_RendererInfo renderer{};
  // SDL may give another kind than was asked for (SDL_RENDER_DRIVER).
  if (renderer_ == nullptr || SDL_GetRendererInfo(renderer_, &renderer) != 0 ||
      ((renderer.flags & SDL_RENDERER_SOFTWARE) != 0) != software) {
    return Error(absl::StatusCode::kFailedPrecondition, "DEVICE_UNSUITABLE",
                 absl::StrCat("output ", head_.name, " has no renderer of the kind \"",
                              options_.renderer, "\": ", static_cast<const char*>(SDL_GetError())));
  }
  info_.renderer = renderer.name;
  int width = 0, height = 0;
  if (SDL_GetRendererOutputSize(renderer_, &width, &height) != 0 || width != head_.width ||
      height != head_.height) {
    return Error(
        absl::StatusCode::kFailedPrecondition, "DEVICE_UNSUITABLE",
        absl::StrFormat("output %s of %dx%d pixels gives a window of %dx%d: it must be the same",
                        head_.name, head_.width, head_.height, width, height),
        {{"output", head_.name}});
  }
  texture_ = SDL_CreateTexture(renderer_, SDL_PIXELFORMAT_RGB888, SDL_TEXTUREACCESS_STREAMING,
                               head_.width, head_.height);
  if (texture_ == nullptr) return SdlError("making a texture");
  SDL_SetTextureBlendMode(texture_, SDL_BLENDMODE_NONE);
  return absl::OkStatus();
}

SdlOutput::~SdlOutput() {
  if (texture_ != nullptr) SDL_DestroyTexture(texture_);
  if (renderer_ != nullptr) SDL_DestroyRenderer(renderer_);
  if (window_ != nullptr) SDL_DestroyWindow(window_);
  SDL_Quit();
}

// Whether presenting waits for the refresh: six frames take at least about as long as six refreshes.
absl::Status SdlOutput::MeasurePacing() {
  info_.paced = true;  // so that Present() does not wait
  if (SDL_UpdateTexture(texture_, nullptr, pixels_.data(), head_.width * 4) != 0) {
    return SdlError("giving the picture to the renderer");
  }
  for (int i = 0; i < 3; ++i) RETURN_IF_ERROR(Present(false));
  constexpr int kFrames = 6;
  const Steady::time_point begin = Steady::now();
  for (int i = 0; i < kFrames; ++i) RETURN_IF_ERROR(Present(false));
  const double took_s = std::chrono::duration<double>(Steady::now() - begin).count();
  info_.paced =
      took_s > 0.7 * kFrames * RefreshTime(info_).count() && options_.renderer != "software";
  return absl::OkStatus();
}

absl::Status SdlOutput::Present(bool read_back) {
  if (SDL_RenderCopy(renderer_, texture_, nullptr, nullptr) != 0) {
    return SdlError("drawing the picture");
  }
  if (read_back) {
    if (SDL_RenderReadPixels(renderer_, nullptr, SDL_PIXELFORMAT_RGB888, read_back_.data(),
                             head_.width * 4) != 0) {
      return SdlError("reading the picture back");
    }
    for (size_t i = 0; i < pixels_.size(); ++i) {
      const uint32_t is = read_back_[i] & 0xffffff;
      if (is == pixels_[i]) continue;
      return Error(
          absl::StatusCode::kFailedPrecondition, "DEVICE_FAULT",
          absl::StrFormat("output %s: the renderer %s drew %06x instead of %06x at pixel (%d, %d)",
                          head_.name, info_.renderer, is, pixels_[i], i % head_.width,
                          i / head_.width));
    }
  }
  AwaitRefresh();
  const uint32_t before = card_ != nullptr ? card_->Picture() : 0;
  SDL_RenderPresent(renderer_);
  presented_ = Steady::now();
  // SDL does not tell that the kernel refused it.
  if (card_ == nullptr) return absl::OkStatus();
  picture_ = card_->Picture();
  if (picture_ != 0 && picture_ != before) return absl::OkStatus();
  RETURN_IF_ERROR(card_->Check());
  return Error(absl::StatusCode::kFailedPrecondition, "DEVICE_BUSY",
               absl::StrFormat("output %s was not given the picture by the kernel: does another "
                               "program have /dev/dri/card%d, e.g. an X server?",
                               head_.name, head_.card),
               {{"output", head_.name}});
}

void SdlOutput::AwaitRefresh() {
  if (!info_.paced) std::this_thread::sleep_until(presented_ + RefreshTime(info_));
}

absl::Status SdlOutput::CheckMode() {
  return server_ != nullptr ? server_->Check(head_) : card_->Check();
}

absl::Status SdlOutput::Pump() {
  bool resized = false;
  SDL_Event event;
  while (SDL_PollEvent(&event) != 0) {
    switch (event.type) {
      case SDL_WINDOWEVENT:
        if (event.window.event == SDL_WINDOWEVENT_EXPOSED) stale_ = covered_ = true;
        if (event.window.event == SDL_WINDOWEVENT_SIZE_CHANGED ||
            event.window.event == SDL_WINDOWEVENT_MOVED) {
          resized = true;
        }
        break;
      case SDL_RENDER_TARGETS_RESET:
      case SDL_RENDER_DEVICE_RESET:
        stale_ = true;
        break;
      default:
        break;
    }
  }
  if (server_ != nullptr) touched_.Update(server_->CheckUntouched(head_));
  RETURN_IF_ERROR(CheckMode());
  if (!resized || server_ == nullptr) return absl::OkStatus();  // kmsdrm: the mode is all there is
  int x = 0, y = 0, width = 0, height = 0;
  SDL_GetWindowPosition(window_, &x, &y);
  SDL_GetWindowSize(window_, &width, &height);
  if (x != head_.x || y != head_.y || width != head_.width || height != head_.height) {
    return Error(absl::StatusCode::kFailedPrecondition, "DISPLAY_CHANGED",
                 absl::StrFormat("the window on output %s was changed from %dx%d+%d+%d to "
                                 "%dx%d+%d+%d",
                                 head_.name, head_.width, head_.height, head_.x, head_.y, width,
                                 height, x, y),
                 {{"output", head_.name}});
  }
  return absl::OkStatus();
}

absl::Status SdlOutput::Show(std::span<const uint32_t> pixels) {
  absl::Status ready = Pump();
  // Whatever is wrong: what is to be black is drawn.
  const bool black = std::all_of(pixels.begin(), pixels.end(), [](uint32_t p) { return p == 0; });
  if (!ready.ok() && !black) return ready;
  const absl::Status drawn = Draw(pixels);
  return ready.ok() ? drawn : ready;
}

absl::Status SdlOutput::Draw(std::span<const uint32_t> pixels) {
  if (server_ != nullptr) server_->Straighten(head_);
  touched_ = absl::OkStatus();
  pixels_.assign(pixels.begin(), pixels.end());
  if (SDL_UpdateTexture(texture_, nullptr, pixels_.data(), head_.width * 4) != 0) {
    return SdlError("giving the picture to the renderer");
  }
  SDL_RaiseWindow(window_);
  const Steady::time_point begin = Steady::now();
  // SDL's kmsdrm waits for the picture before, not for the one that it takes (SDL 2.26): one more, so that the last has been taken up.
  const int presents = options_.frames + (card_ != nullptr ? 1 : 0);
  for (int i = 0; i < presents; ++i) RETURN_IF_ERROR(Present(true));
  // Whatever was measured: so many frames last so long.
  std::this_thread::sleep_until(begin + (options_.frames - 1) * RefreshTime(info_));
  AwaitRefresh();
  stale_ = false;
  if (server_ != nullptr) {
    // The server has a queue of its own: once more after a further frame, and again.
    absl::Status shown = server_->CheckPixels(head_, pixels_);
    for (int i = 0; i < 3 && ErrorReason(shown) == "DEVICE_FAULT"; ++i) {
      RETURN_IF_ERROR(Present(true));
      AwaitRefresh();
      shown = server_->CheckPixels(head_, pixels_);
    }
    RETURN_IF_ERROR(shown);
  }
  RETURN_IF_ERROR(Pump());
  covered_ = false;
  return touched_;
}

absl::Status SdlOutput::Check() {
  RETURN_IF_ERROR(Pump());
  RETURN_IF_ERROR(touched_);
  if (covered_ || (card_ != nullptr && card_->Picture() != picture_)) {
    return Error(absl::StatusCode::kFailedPrecondition, "DEVICE_FAULT",
                 absl::StrCat("output ", head_.name,
                              ": something else was on the screen since the picture was shown"),
                 {{"output", head_.name}});
  }
  return server_ == nullptr ? absl::OkStatus() : server_->CheckPixels(head_, pixels_);
}

absl::Status SdlOutput::Idle() {
  RETURN_IF_ERROR(Pump());
  if (!stale_) return absl::OkStatus();
  stale_ = false;
  if (SDL_UpdateTexture(texture_, nullptr, pixels_.data(), head_.width * 4) != 0) {
    return SdlError("giving the picture to the renderer");
  }
  absl::Status drawn = Present(true);
  if (ErrorReason(drawn) != "DEVICE_FAULT") return drawn;
  touched_.Update(drawn);  // of another picture that says nothing
  return absl::OkStatus();
}

}  // namespace lightstage
