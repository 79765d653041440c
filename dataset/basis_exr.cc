#include "dataset/basis_exr.h"

#include <ImathMatrix.h>
#include <ImathVec.h>
#include <ImfChannelList.h>
#include <ImfFloatVectorAttribute.h>
#include <ImfFrameBuffer.h>
#include <ImfIntAttribute.h>
#include <ImfMatrixAttribute.h>
#include <ImfStandardAttributes.h>
#include <ImfStringAttribute.h>
#include <ImfVecAttribute.h>

#include <algorithm>
#include <climits>

#include "base/status.h"
#include "dataset/exr_codec.h"
#include "dataset/record_json.h"

namespace lightstage {
namespace {

constexpr char kFlags[] = "flags";

absl::Status InvalidImage(std::string_view why) {
  return Error(absl::StatusCode::kInvalidArgument, "IMAGE_INVALID",
               absl::StrCat("basis image: ", why), {{"why", std::string(why)}});
}

// "2004-05-06T07:08:09.123456Z" as capDate wants it.
std::string CapDate(std::string_view rfc3339) {
  std::string date(rfc3339.substr(0, 19));
  if (date.size() == 19) date[4] = date[7] = ':', date[10] = ' ';
  return date;
}

// Imath multiplies row vectors from the left. Camera space: x right, y up, looking along −z.
Imath::M44f WorldToCamera(const CameraGeometry& camera) {
  ViewFrame frame = CameraFrame(camera);
  const Vec3 axes[] = {frame.right, -frame.down, -frame.forward};
  Imath::M44f m;
  for (int column = 0; column < 3; ++column) {
    for (int row = 0; row < 3; ++row) m[row][column] = static_cast<float>(axes[column][row]);
    m[3][column] = static_cast<float>(-axes[column].dot(frame.position));
  }
  return m;
}

Imath::V2d ToV2d(const Pose& pose) { return {pose.azimuth.degrees(), pose.tilt.degrees()}; }
Pose ToPose(const Imath::V2d& v) { return {Degrees(v.x), Degrees(v.y)}; }

absl::Status AddAttributes(const FrameAttributes& a, Imf::Header& header) {
  if (a.shot.id > INT_MAX) {
    return Error(absl::StatusCode::kInvalidArgument, "SHOT_ID",
                 absl::StrCat("shot id ", a.shot.id, "; at most ", INT_MAX),
                 {{"shot", absl::StrCat(a.shot.id)}});
  }
  if (!a.exposures_s.empty()) {
    Imf::addExpTime(header, static_cast<float>(a.exposures_s.back()));
    header.insert("lsExposures", Imf::FloatVectorAttribute(std::vector<float>(
                                     a.exposures_s.begin(), a.exposures_s.end())));
  }
  if (!a.captured_at.empty()) {
    Imf::addCapDate(header, CapDate(a.captured_at));
    Imf::addUtcOffset(header, 0.0f);
    header.insert("lsCapturedAt", Imf::StringAttribute(a.captured_at));
  }
  Imf::addComments(header, DescribeShot(a.shot));
  if (a.camera) Imf::addWorldToCamera(header, WorldToCamera(*a.camera));
  header.insert("lsRun", Imf::StringAttribute(a.run_id));
  header.insert("lsRig", Imf::StringAttribute(a.rig_name));
  header.insert("lsShot", Imf::IntAttribute(static_cast<int>(a.shot.id)));
  header.insert("lsKind", Imf::StringAttribute(ShotKindName(a.shot.kind)));
  header.insert("lsPoseCommanded", Imf::V2dAttribute(ToV2d(a.shot.pose)));
  header.insert("lsPoseReported", Imf::V2dAttribute(ToV2d(a.reported_pose)));
  if (a.direction) {
    header.insert("lsDirection", Imf::V3dAttribute(Imath::V3d(a.direction->x(), a.direction->y(),
                                                              a.direction->z())));
  }
  header.insert("lsCondition", Imf::StringAttribute(ToJson(a.shot.condition).dump()));
  return absl::OkStatus();
}

template <class Attribute>
const Attribute* Find(const Imf::Header& header, const char* name) {
  return header.findTypedAttribute<Attribute>(name);
}

std::string StringOr(const Imf::Header& header, const char* name) {
  const auto* found = Find<Imf::StringAttribute>(header, name);
  return found == nullptr ? std::string() : found->value();
}

absl::StatusOr<FrameAttributes> ReadAttributes(const Imf::Header& header, std::string_view name) {
  FrameAttributes a;
  const auto* shot = Find<Imf::IntAttribute>(header, "lsShot");
  const auto* commanded = Find<Imf::V2dAttribute>(header, "lsPoseCommanded");
  const auto* reported = Find<Imf::V2dAttribute>(header, "lsPoseReported");
  if (shot == nullptr || commanded == nullptr || reported == nullptr) {
    return exr_codec::Unsupported(name, "no basis image: lsShot or a pose is missing");
  }
  a.run_id = StringOr(header, "lsRun");
  a.rig_name = StringOr(header, "lsRig");
  a.captured_at = StringOr(header, "lsCapturedAt");
  a.shot.id = static_cast<uint64_t>(std::max(shot->value(), 0));
  a.shot.pose = ToPose(commanded->value());
  a.reported_pose = ToPose(reported->value());
  auto kind = ParseShotKind(StringOr(header, "lsKind"));
  if (!kind.ok()) return exr_codec::Corrupt(name, std::string(kind.status().message()));
  a.shot.kind = *kind;
  auto condition =
      ConditionFromJson(StringOr(header, "lsCondition"), absl::StrCat(name, ": lsCondition"));
  if (!condition.ok()) return condition.status();
  a.shot.condition = *std::move(condition);
  if (const auto* direction = Find<Imf::V3dAttribute>(header, "lsDirection")) {
    a.direction = Vec3(direction->value().x, direction->value().y, direction->value().z);
  }
  if (const auto* exposures = Find<Imf::FloatVectorAttribute>(header, "lsExposures")) {
    a.exposures_s.assign(exposures->value().begin(), exposures->value().end());
  }
  return a;
}

absl::Status ReadFlags(Imf::InputFile& file, std::vector<uint8_t>& flags) {
  const Imath::Box2i& window = file.header().dataWindow();
  size_t width = static_cast<size_t>(window.max.x - window.min.x) + 1;
  std::vector<float> values(flags.size());
  Imf::FrameBuffer buffer;
  buffer.insert(kFlags, Imf::Slice::Make(Imf::FLOAT, values.data(), window, sizeof(float),
                                         sizeof(float) * width));
  file.setFrameBuffer(buffer);
  file.readPixels(window.min.y, window.max.y);
  constexpr float kAllFlags = kAboveRange | kBelowRange;
  for (size_t i = 0; i < values.size(); ++i) {
    if (!(values[i] >= 0 && values[i] <= kAllFlags)) {
      return absl::OutOfRangeError(absl::StrCat("flags hold ", values[i]));
    }
    flags[i] = static_cast<uint8_t>(values[i]);
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<std::string> EncodeBasisExr(const BasisImage& image,
                                           const FrameAttributes& attributes,
                                           ExrCompression compression) {
  const Image& pixels = image.pixels;
  size_t count = static_cast<size_t>(pixels.width()) * static_cast<size_t>(pixels.height());
  size_t channels = static_cast<size_t>(pixels.channels());
  if (pixels.empty() || (channels != 1 && channels != 3)) {
    return InvalidImage(absl::StrCat("it is ", pixels.width(), "x", pixels.height(), " with ",
                                     channels, " channels; 1 or 3 are written"));
  }
  if (image.flags.size() != count) {
    return InvalidImage(
        absl::StrCat("it has ", image.flags.size(), " flags for ", count, " pixels"));
  }
  std::vector<uint16_t> halves(pixels.pixels().size());
  std::vector<uint8_t> flags = image.flags;  // a clamped value adds one
  switch (exr_codec::ToHalf(pixels.pixels().data(), halves.size(), halves.data())) {
    case exr_codec::HalfResult::kExact:
      break;
    case exr_codec::HalfResult::kNotFinite:
      return InvalidImage("a pixel is not finite");
    case exr_codec::HalfResult::kClamped:
      for (size_t i = 0; i < halves.size(); ++i) {
        if (pixels.pixels()[i] > exr_codec::kLargestHalf) flags[i / channels] |= kAboveRange;
      }
  }

  std::vector<std::string> names = exr_codec::ChannelNames(pixels.channels());
  Imf::Header header =
      exr_codec::MakeHeader(pixels.width(), pixels.height(), names, Imf::HALF, compression);
  RETURN_IF_ERROR(AddAttributes(attributes, header));
  std::vector<exr_codec::Plane> planes;
  const size_t pixel = sizeof(uint16_t) * channels;
  const size_t width = static_cast<size_t>(pixels.width());
  for (size_t c = 0; c < channels; ++c) {
    planes.push_back({names[c], Imf::HALF, halves.data() + c, pixel, pixel * width});
  }
  std::vector<uint16_t> flag_halves;
  if (std::any_of(flags.begin(), flags.end(), [](uint8_t f) { return f != 0; })) {
    constexpr uint16_t kHalves[] = {0x0000, 0x3c00, 0x4000, 0x4200};  // 0, 1, 2, 3
    flag_halves.reserve(count);
    for (uint8_t f : flags) flag_halves.push_back(kHalves[f & (kAboveRange | kBelowRange)]);
    header.channels().insert(kFlags, Imf::Channel(Imf::HALF, 1, 1, /*pLinear=*/true));
    planes.push_back(
        {kFlags, Imf::HALF, flag_halves.data(), sizeof(uint16_t), sizeof(uint16_t) * width});
  }
  return exr_codec::Write(header, planes);
}

absl::StatusOr<DecodedBasis> DecodeBasisExr(std::string_view bytes, std::string_view name) {
  DecodedBasis decoded;
  RETURN_IF_ERROR(exr_codec::Read(bytes, name, [&](Imf::InputFile& file) -> absl::Status {
    ASSIGN_OR_RETURN(decoded.attributes, ReadAttributes(file.header(), name));
    ASSIGN_OR_RETURN(decoded.image.pixels, exr_codec::ReadPixels(file, name));
    const Image& pixels = decoded.image.pixels;
    decoded.image.flags.resize(pixels.pixels().size() / static_cast<size_t>(pixels.channels()));
    const Imf::Channel* flags = file.header().channels().findChannel(kFlags);
    if (flags == nullptr) return absl::OkStatus();
    if (flags->xSampling != 1 || flags->ySampling != 1) {
      return exr_codec::Unsupported(name, "channel flags is subsampled");
    }
    absl::Status read = ReadFlags(file, decoded.image.flags);
    return read.ok() ? read : exr_codec::Corrupt(name, std::string(read.message()));
  }));
  return decoded;
}

absl::StatusOr<DecodedBasis> ReadBasisExr(const std::string& path, Env& env) {
  ASSIGN_OR_RETURN(std::string bytes, env.ReadFile(path));
  return DecodeBasisExr(bytes, path);
}

absl::StatusOr<BasisHeader> ReadBasisHeader(std::string_view bytes, std::string_view name) {
  BasisHeader read;
  RETURN_IF_ERROR(exr_codec::Read(bytes, name, [&](Imf::InputFile& file) -> absl::Status {
    const Imath::Box2i& window = file.header().dataWindow();
    read.width = window.max.x - window.min.x + 1;
    read.height = window.max.y - window.min.y + 1;
    read.channels = file.header().channels().findChannel("Y") != nullptr ? 1 : 3;
    ASSIGN_OR_RETURN(read.attributes, ReadAttributes(file.header(), name));
    return absl::OkStatus();
  }));
  return read;
}

}  // namespace lightstage
