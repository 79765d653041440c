#include "dataset/manifest.h"

#include "base/status.h"
#include "dataset/record_json.h"
#include "dataset/test_record.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace lightstage {
namespace {

using ::testing::HasSubstr;

Manifest TestManifest(uint64_t shots) {
  Manifest m;
  m.run_id = "20040506-070809";
  m.name = "chess \"pieces\"";
  m.rig_name = "stage";
  m.created_at = "2004-05-06T07:08:09Z";
  m.geometry = TestGeometry();
  m.plan_json = R"({"lightStage":{"azimuthsDeg":[0,5.625]}})";
  m.width = 320;
  m.height = 240;
  m.channels = 3;
  m.compression = "piz";
  for (uint64_t id = 0; id < shots; ++id) m.shots.push_back(TestRecord(id));
  return m;
}

TEST(ManifestTest, ComesBack) {
  for (uint64_t shots : {0, 1, 3}) {
    Manifest m = TestManifest(shots);
    std::string text = ManifestToJson(m).value();
    auto read = ManifestFromJson(text, "manifest.json");
    ASSERT_TRUE(read.ok()) << read.status();
    EXPECT_EQ(read->run_id, m.run_id);
    EXPECT_EQ(read->name, m.name);
    EXPECT_EQ(read->rig_name, m.rig_name);
    EXPECT_EQ(read->created_at, m.created_at);
    EXPECT_EQ(read->plan_json, m.plan_json);
    EXPECT_EQ(read->width, 320);
    EXPECT_EQ(read->height, 240);
    EXPECT_EQ(read->channels, 3);
    EXPECT_EQ(read->compression, "piz");
    EXPECT_EQ(read->geometry.projector.height, 1140);
    ASSERT_EQ(read->shots.size(), shots);
    for (uint64_t i = 0; i < shots; ++i) EXPECT_EQ(ToJson(read->shots[i]), ToJson(m.shots[i]));
    EXPECT_EQ(ManifestToJson(*read).value(), text);
  }
}

// What a foreign reader relies on, without our reader.
TEST(ManifestTest, IsPlainJsonAsDocumented) {
  Json json = Json::parse(ManifestToJson(TestManifest(2)).value());
  EXPECT_EQ(json["format"], "lightstage-dataset");
  EXPECT_EQ(json["version"], 1);
  EXPECT_EQ(json["image"]["width"], 320);
  EXPECT_EQ(json["plan"]["lightStage"]["azimuthsDeg"][1], 5.625);
  EXPECT_EQ(json["geometry"]["brace"]["lamps"][1]["tilt_deg"], 87.75);
  ASSERT_EQ(json["shots"].size(), 2u);
  const Json& shot = json["shots"][1];
  EXPECT_EQ(shot["shot"], 1);
  EXPECT_EQ(shot["kind"], "basis");
  EXPECT_EQ(shot["commanded"]["azimuth_deg"], 5.625);
  EXPECT_EQ(shot["reported"]["azimuth_deg"], 5.6250001);
  EXPECT_EQ(shot["condition"]["lamps"][0]["lamp"], 7);
  EXPECT_EQ(shot["bracket_us"][0], 500.25);
  EXPECT_EQ(shot["exposures"][1]["used_us"], 3999.999);
  EXPECT_EQ(shot["direction"][2], 0.8);
}

TEST(ManifestTest, ErrorsNameFileAndPlace) {
  std::string text = ManifestToJson(TestManifest(2)).value();
  auto message = [&](const std::string& from, const std::string& to) {
    std::string changed = text;
    size_t at = changed.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    changed.replace(at, from.size(), to);
    absl::Status status = ManifestFromJson(changed, "m.json").status();
    EXPECT_EQ(status.code(), absl::StatusCode::kDataLoss);
    EXPECT_EQ(ErrorReason(status), "MANIFEST_CORRUPT");
    return std::string(status.message());
  };
  EXPECT_THAT(message("\"version\": 1", "\"version\": 2"), HasSubstr("m.json: version: is 2"));
  EXPECT_THAT(message("lightstage-dataset", "other"), HasSubstr("m.json: format: is 'other'"));
  EXPECT_THAT(message("\"width\": 320", "\"width\": \"wide\""),
              HasSubstr("m.json: image.width: is"));
  EXPECT_THAT(message("\"shot\":1,", "\"shot\":\"one\","), HasSubstr("m.json: shots[1]: shot: is"));
  EXPECT_THAT(message("\"shot\":1,", "\"shot\":0,"),
              HasSubstr("m.json: shots[1].shot: is 0, must be above"));
  EXPECT_THAT(message("\"shots\"", "\"shoots\""), HasSubstr("m.json: shots: missing"));
  EXPECT_THAT(message("{\"shot\":1,", "[{\"shot\":1,"), HasSubstr("m.json"));
}

TEST(ManifestTest, EveryTruncationIsDataLoss) {
  std::string text = ManifestToJson(TestManifest(1)).value();
  for (size_t size = 0; size + 2 < text.size(); size += 11) {
    EXPECT_EQ(ManifestFromJson(text.substr(0, size), "m").status().code(),
              absl::StatusCode::kDataLoss);
  }
}

TEST(ManifestTest, ThePlanMustBeJson) {
  Manifest m = TestManifest(1);
  m.plan_json = "nonsense";
  EXPECT_EQ(ManifestToJson(m).status().code(), absl::StatusCode::kInvalidArgument);
}

TEST(ManifestTest, ReadNamesAMissingFile) {
  absl::Status status = ReadManifest("/nonexistent").status();
  EXPECT_EQ(status.code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(std::string(status.message()), HasSubstr("/nonexistent/manifest.json"));
}

}  // namespace
}  // namespace lightstage
