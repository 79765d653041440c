#include "dataset/record_json.h"

#include "base/status.h"
#include "dataset/test_record.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace lightstage {
namespace {

using ::testing::HasSubstr;

TEST(RecordJsonTest, EverythingComesBackExactly) {
  ShotRecord record = TestRecord(123);
  Json json = Json::parse(ToJson(record).dump());
  JsonReader reader(json, "record");
  ShotRecord r = ReadShotRecord(reader);
  ASSERT_TRUE(reader.status().ok()) << reader.status();
  EXPECT_EQ(r.shot.id, record.shot.id);
  EXPECT_EQ(r.shot.kind, record.shot.kind);
  EXPECT_EQ(r.shot.pose, record.shot.pose);
  EXPECT_EQ(r.shot.condition, record.shot.condition);
  EXPECT_EQ(r.shot.exposures, record.shot.exposures);
  EXPECT_EQ(r.reported_pose, record.reported_pose);
  EXPECT_EQ(r.direction, record.direction);
  ASSERT_EQ(r.exposures.size(), record.exposures.size());
  EXPECT_EQ(r.exposures[1].requested, record.exposures[1].requested);
  EXPECT_EQ(r.exposures[1].used, record.exposures[1].used);
  EXPECT_EQ(r.exposures[1].gain_db, record.exposures[1].gain_db);
  EXPECT_EQ(r.exposures[1].start, record.exposures[1].start);
  EXPECT_EQ(r.exposures[1].end, record.exposures[1].end);
  EXPECT_EQ(r.exposures[1].device_timestamp_ns, record.exposures[1].device_timestamp_ns);
  EXPECT_EQ(r.exposures[1].frame_sequence, record.exposures[1].frame_sequence);
  EXPECT_EQ(r.checks.saturated_share, record.checks.saturated_share);
  EXPECT_EQ(r.checks.black_share, record.checks.black_share);
  EXPECT_EQ(r.checks.mean, record.checks.mean);
  EXPECT_EQ(r.checks.maximum, record.checks.maximum);
  EXPECT_EQ(r.checks.nothing_seen, record.checks.nothing_seen);
  EXPECT_EQ(r.attempts, record.attempts);
  EXPECT_EQ(r.lit_at, record.lit_at);
  EXPECT_EQ(r.captured_at, record.captured_at);
  EXPECT_EQ(r.file, record.file);
  EXPECT_EQ(r.bytes, record.bytes);
  EXPECT_EQ(r.sha256, record.sha256);
}

TEST(RecordJsonTest, EveryPatternComesBack) {
  for (auto arrangement :
       {PatternArrangement::kBlack, PatternArrangement::kFull, PatternArrangement::kSquare,
        PatternArrangement::kHorizontal, PatternArrangement::kVertical}) {
    for (auto profile : {PatternProfile::kBox, PatternProfile::kGaussian, PatternProfile::kHat}) {
      Condition condition;
      condition.pattern = Pattern{.arrangement = arrangement,
                                  .profile = profile,
                                  .grid = 8,
                                  .influence = 1,
                                  .column = 1,
                                  .row = 1};
      EXPECT_EQ(ConditionFromJson(ToJson(condition).dump(), "c").value(), condition);
    }
  }
}

TEST(RecordJsonTest, ErrorsNameThePlace) {
  struct Case {
    const char* pointer;
    Json value;
    const char* message;
  };
  const Case cases[] = {
      {"/kind", "Basis", "record: kind: shot kind 'Basis'"},
      {"/commanded/tilt_deg", "flat", "record: commanded.tilt_deg: is string, must be a number"},
      {"/exposures/1/used_us", nullptr, "record: exposures[1].used_us: is null, must be a number"},
      {"/condition/lamps/0/level", 1.5,
       "record: condition.lamps[0].level: is 1.5, must be from 0 to 1"},
      {"/condition/lamps", 3, "record: condition.lamps: is number, must be an array"},
      {"/direction", Json::array({1, 2}), "record: direction: must be an array of 3 numbers"},
      {"/shot", -1, "record: shot: is -1, must be an integer from 0"},
      {"/attempts", 1.5, "record: attempts: is 1.5, must be an integer"},
      {"/checks/nothing_seen", 0, "record: checks.nothing_seen: is number, must be true or false"},
  };
  for (const Case& c : cases) {
    Json json = ToJson(TestRecord(1));
    json[Json::json_pointer(c.pointer)] = c.value;
    JsonReader reader(json, "record");
    ReadShotRecord(reader);
    EXPECT_EQ(ErrorReason(reader.status()), "JSON_INVALID");
    EXPECT_THAT(std::string(reader.status().message()), HasSubstr(c.message));
  }
  Json json = ToJson(TestRecord(1));
  json.erase("sha256");
  JsonReader reader(json, "record");
  ReadShotRecord(reader);
  EXPECT_THAT(std::string(reader.status().message()), HasSubstr("record: sha256: missing"));
}

TEST(RecordJsonTest, GeometryComesBack) {
  RigGeometry g = TestGeometry();
  Json json = Json::parse(ToJson(g).dump());
  JsonReader reader(json, "geometry");
  RigGeometry r = ReadRigGeometry(reader);
  ASSERT_TRUE(reader.status().ok()) << reader.status();
  EXPECT_EQ(r.brace.radius, g.brace.radius);
  EXPECT_EQ(r.brace.lamp_radius, g.brace.lamp_radius);
  ASSERT_EQ(r.brace.lamps.size(), 2u);
  EXPECT_EQ(r.brace.lamps[1].azimuth, g.brace.lamps[1].azimuth);
  EXPECT_EQ(r.brace.lamps[1].tilt, g.brace.lamps[1].tilt);
  EXPECT_EQ(r.camera.position, g.camera.position);
  EXPECT_EQ(r.camera.look_at, g.camera.look_at);
  EXPECT_EQ(r.camera.field_of_view, g.camera.field_of_view);
  EXPECT_TRUE(r.projector.present);
  EXPECT_EQ(r.projector.distance, g.projector.distance);
  EXPECT_EQ(r.projector.width, g.projector.width);
  g.projector.present = false;
  Json without = ToJson(g);
  EXPECT_FALSE(ReadRigGeometry(JsonReader(without, "g")).projector.present);
}

}  // namespace
}  // namespace lightstage
