#include "base/toml.h"

#include <ctime>

#include "base/status.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace lightstage {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

TomlDocument MustParse(std::string_view text) {
  auto document = TomlDocument::Parse(text, "rig.toml");
  EXPECT_TRUE(document.ok()) << document.status();
  return *std::move(document);
}

std::string FinishMessage(const TomlDocument& document) {
  absl::Status status = document.Finish();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(ErrorReason(status), "RIG_FILE_INVALID");
  return std::string(status.message());
}

TEST(TomlTest, ReadsEveryType) {
  auto doc = MustParse(R"(
name = "stage"
gain = 3
ratio = 0.25
on = true
wait_ms = 2.5
exposure_us = 33
settle_s = 1
list = [1, 2.5]
[camera]
driver = "sim"
[[lamp]]
tilt_deg = 10
[[lamp]]
tilt_deg = 20
)");
  const TomlTable& t = doc.root();
  EXPECT_EQ(t.String("name"), "stage");
  EXPECT_EQ(t.Int("gain", 0, 3), 3);
  EXPECT_EQ(t.Double("ratio", 0, 1), 0.25);
  EXPECT_TRUE(t.Bool("on"));
  EXPECT_EQ(t.Time("wait_ms", 0, 10), std::chrono::microseconds(2500));
  EXPECT_EQ(t.Time("exposure_us", 0, 100), std::chrono::microseconds(33));
  EXPECT_EQ(t.Time("settle_s", 0, 10), std::chrono::seconds(1));
  EXPECT_THAT(t.Doubles("list", 0, 5, 2), ElementsAre(1, 2.5));
  EXPECT_EQ(t.Table("camera").OneOf("driver", {"aravis", "sim"}), "sim");
  auto lamps = t.Tables("lamp");
  ASSERT_EQ(lamps.size(), 2u);
  EXPECT_EQ(lamps[1].Int("tilt_deg", 0, 90), 20);
  EXPECT_EQ(lamps[0].Int("tilt_deg", 0, 90), 10);
  EXPECT_TRUE(doc.Finish().ok()) << doc.Finish();
}

TEST(TomlTest, SyntaxErrorNamesPlace) {
  auto document = TomlDocument::Parse("a = 1\nb = = 2\n", "rig.toml");
  ASSERT_FALSE(document.ok());
  EXPECT_EQ(document.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(document.status().message()), HasSubstr("rig.toml:2:"));
}

TEST(TomlTest, ErrorsNamePlaceTableKeyValueAndRange) {
  auto doc = MustParse("[camera]\n  gain_db = 99.5\n  width = 1.5\n  driver = \"simm\"\n");
  TomlTable camera = doc.root().Table("camera");
  camera.Double("gain_db", 0, 24);
  camera.Int("width", 1, 100);
  camera.OneOf("driver", {"aravis", "sim"});
  std::string message = FinishMessage(doc);
  EXPECT_THAT(message, HasSubstr("rig.toml:2:3: [camera] gain_db: is 99.5, must be from 0 to 24"));
  EXPECT_THAT(message, HasSubstr("rig.toml:3:3: [camera] width: is a number, must be an integer"));
  EXPECT_THAT(
      message,
      HasSubstr("rig.toml:4:3: [camera] driver: is \"simm\", must be one of \"aravis\", \"sim\""));
}

TEST(TomlTest, NanAndInfinityAreOutOfEveryRange) {
  auto doc = MustParse("a = nan\nb = inf\nc = [1, -inf]\n");
  doc.root().Double("a", -1e300, 1e300);
  doc.root().Double("b", 0, std::numeric_limits<double>::infinity());
  doc.root().Doubles("c", -std::numeric_limits<double>::infinity(), 1);
  std::string message = FinishMessage(doc);
  EXPECT_THAT(message, HasSubstr("rig.toml:1:1: a: is nan"));
  EXPECT_THAT(message, HasSubstr("rig.toml:2:1: b: is inf"));
  EXPECT_THAT(message, HasSubstr("rig.toml:3:1: c: element 1 is -inf"));
}

TEST(TomlTest, MissingRequiredKeyNamesTableAndWhatIsWanted) {
  auto doc = MustParse("\n[camera]\n");
  EXPECT_EQ(doc.root().Table("camera").Int("width", 1, 64), 1);
  EXPECT_THAT(FinishMessage(doc),
              HasSubstr("rig.toml:2:1: [camera] width: missing; an integer from 1 to 64"));
}

TEST(TomlTest, MissingTable) {
  auto doc = MustParse("a = 1\n");
  doc.root().Int("a", 0, 1);
  TomlTable optional = doc.root().Table("store");
  EXPECT_EQ(optional.Int("queue", 0, 9, 4), 4);
  EXPECT_FALSE(optional.Has("queue"));
  EXPECT_TRUE(optional.Tables("x").empty());
  EXPECT_TRUE(doc.Finish().ok());

  TomlTable required = doc.root().Table("camera", /*required=*/true);
  required.String("driver");
  // One error: that the table is missing says it all.
  EXPECT_EQ(FinishMessage(doc), "rig.toml:1:1: table [camera] is missing");
}

TEST(TomlTest, IgnoredTablesHaveNoUnknownKeys) {
  auto doc = MustParse("[camera]\ndriver = \"x\"\n[camera.options]\na = 1\n");
  TomlTable camera = doc.root().Table("camera");
  camera.ErrorAt("driver", "is not known");
  camera.Ignore();
  EXPECT_EQ(FinishMessage(doc), "rig.toml:2:1: [camera] driver: is not known");
}

TEST(TomlTest, UnknownKeysAreErrorsWithASuggestion) {
  auto doc = MustParse("[camera]\nexposure = 5\ngain_bd = 1\nzzz = 1\n[cammera]\n");
  TomlTable camera = doc.root().Table("camera");
  camera.Int("exposure_us", 0, 10, 1);
  camera.Double("gain_db", 0, 1, 0);
  std::string message = FinishMessage(doc);
  EXPECT_THAT(
      message,
      HasSubstr("rig.toml:2:1: [camera] exposure: unknown key; did you mean 'exposure_us'?"));
  EXPECT_THAT(message, HasSubstr("[camera] gain_bd: unknown key; did you mean 'gain_db'?"));
  EXPECT_THAT(message, HasSubstr("[camera] zzz: unknown key; known here: exposure_us, gain_db"));
  EXPECT_THAT(message, HasSubstr("rig.toml:5:2: cammera: unknown key; did you mean 'camera'?"));
}

TEST(TomlTest, UnknownKeyInsideArrayOfTables) {
  auto doc = MustParse("[[lamp]]\ntilt = 1\n[[lamp]]\ntilt = 1\ncolour = 2\n");
  for (const TomlTable& lamp : doc.root().Tables("lamp")) lamp.Int("tilt", 0, 9);
  std::string message = FinishMessage(doc);
  EXPECT_THAT(message, HasSubstr("rig.toml:5:1: [lamp[1]] colour: unknown key"));
  EXPECT_THAT(message, Not(HasSubstr("lamp[0]")));
}

TEST(TomlTest, ReaderChecksAndPlaces) {
  auto doc = MustParse("b = 1\na = 2\n[c]\nx = 1\n");
  EXPECT_THAT(doc.root().Keys(), ElementsAre("b", "a", "c"));
  EXPECT_EQ(doc.root().Where("a"), "rig.toml:2:1");
  TomlTable c = doc.root().Table("c");
  EXPECT_EQ(c.Where(), "rig.toml:3:1");
  EXPECT_EQ(c.path(), "c");
  doc.root().Int("b", 0, 1);
  doc.root().Int("a", 0, 2);
  c.ErrorAt("x", "two lamps at one angle");  // a key complained about is not also unknown
  EXPECT_EQ(FinishMessage(doc), "rig.toml:4:1: [c] x: two lamps at one angle");
}

TEST(TomlTest, AtMostTenLinesInFileOrder) {
  std::string text;
  for (int i = 0; i < 15; ++i) text += "k" + std::to_string(i) + " = 1\n";
  auto doc = MustParse(text);
  std::string message = FinishMessage(doc);
  EXPECT_EQ(std::count(message.begin(), message.end(), '\n'), 9);
  EXPECT_THAT(message, HasSubstr("rig.toml:1:1: k0: unknown key; this table takes none\n"));
  EXPECT_THAT(message, HasSubstr("\nand 6 more"));
}

// In a moment: to look for what each of them may have meant takes minutes.
TEST(TomlTest, ThousandsOfUnknownKeysAreCounted) {
  constexpr int kCount = 300000;
  std::string text = "[a]\nz = 1\n";
  for (int i = 0; i < kCount; ++i) absl::StrAppend(&text, "key", i, " = 1\n");
  auto doc = MustParse(text);
  const TomlTable a = doc.root().Table("a");
  a.ErrorAt("z", "is wrong");
  for (int i = 0; i < 100; ++i) a.Int(absl::StrCat("known", i), 0, 1, 0);
  const std::clock_t start = std::clock();
  const std::string message = FinishMessage(doc);
  EXPECT_LT(static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC, 5);
  EXPECT_THAT(message, HasSubstr("rig.toml:2:1: [a] z: is wrong\nrig.toml:3:1: [a] key0: unknown"));
  EXPECT_EQ(std::count(message.begin(), message.end(), '\n'), 9);
  EXPECT_THAT(message, HasSubstr(absl::StrCat("\nand ", kCount - 8, " more")));
  EXPECT_EQ(FinishMessage(doc), message) << "asked again";
}

TEST(TomlTest, KeysAreNotDeeperThanTheParserCanStand) {
  std::string key = "a";
  for (int i = 0; i < 200000; ++i) key += ".a";
  auto doc = TomlDocument::Parse("x = 1\n" + key + " = 1\n", "rig.toml");
  EXPECT_THAT(std::string(doc.status().message()), HasSubstr("rig.toml:2:1: a key of more than"));
  for (const char* part : {"\"\u00e9\"", "\"a,\"", "'='", "\"\\\"\""}) {
    key = part;
    for (int i = 0; i < 200000; ++i) key += absl::StrCat(" . ", part);
    EXPECT_FALSE(TomlDocument::Parse("[" + key + "]", "f").ok()) << part;
  }
  // Behind the end of a string over several lines, in which single quotes say nothing.
  key = "a";
  for (int i = 0; i < 200000; ++i) key += ".a";
  for (const char* before :
       {"x = { y = \"\"\"\n\"\"\", ", "x = { y = '''\n\"''', ", "x = { y = \"\"\"\n\"\"\"\"\", ",
        "x = \"\"\"\\\n \" \"\"\" # \\\n", "x = \"\"\n", "x = '\\'\n"}) {
    doc = TomlDocument::Parse(before + key + " = 1", "f");
    EXPECT_THAT(std::string(doc.status().message()), HasSubstr("a key of more than")) << before;
  }
  EXPECT_TRUE(TomlDocument::Parse("# " + std::string(500, '.') + "\na.b.c = 0.5\n", "f").ok());
  EXPECT_TRUE(TomlDocument::Parse("a = \"\"\"\n" + std::string(500, '.') + "\"\"\"\n", "f").ok());
}

TEST(TomlTest, FinishMayBeAskedAgain) {
  auto doc = MustParse("a = 1\nb = { c = 2 }\n");
  doc.root().Int("a", 2, 3);
  const std::string message = FinishMessage(doc);
  EXPECT_THAT(message, HasSubstr("b: unknown key"));
  EXPECT_EQ(FinishMessage(doc), message);
}

TEST(TomlTest, WrongShapes) {
  auto doc = MustParse("camera = 3\nlamp = 4\nlist = [1, \"a\"]\nshort = [1]\n");
  doc.root().Table("camera", true).String("driver");
  doc.root().Tables("lamp");
  EXPECT_EQ(doc.root().Doubles("list", 0, 1, 2).size(), 2u);
  EXPECT_EQ(doc.root().Doubles("short", 0, 1, 3).size(), 3u);
  std::string message = FinishMessage(doc);
  EXPECT_THAT(message, HasSubstr("camera: is an integer, must be a table"));
  EXPECT_THAT(message, HasSubstr("lamp: is an integer, must be an array of tables, [[lamp]]"));
  EXPECT_THAT(message, HasSubstr("list: element 1 is a string, must be a number"));
  EXPECT_THAT(message, HasSubstr("short: has 1 elements, must be an array of 3 numbers"));
  EXPECT_THAT(message, Not(HasSubstr("driver")));
}

TEST(Toml, QuotedTextComesBack) {
  const std::string text = "a\"b\\c\n\t\x01 d";
  auto document = TomlDocument::Parse("key = " + TomlQuoted(text), "f");
  ASSERT_TRUE(document.ok()) << document.status();
  EXPECT_EQ(document->root().String("key"), text);
}

}  // namespace
}  // namespace lightstage
