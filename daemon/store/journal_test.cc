#include "daemon/store/journal.h"

#include "base/status.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace lightstage {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

struct Scanned {
  JournalScan scan;
  std::vector<std::string> payloads;
};

Scanned Scan(std::string_view text) {
  Scanned result;
  result.scan = ScanJournal(text, "journal", [&](std::string_view payload) {
    result.payloads.emplace_back(payload);
    return payload == "refused" ? absl::InvalidArgumentError("no such entry") : absl::OkStatus();
  });
  return result;
}

TEST(JournalTest, LineHasTheDocumentedForm) {
  // `printf '7 {"a":1}' | crc32` (IEEE 802.3).
  EXPECT_EQ(JournalLine("{\"a\":1}"), "9e58a832 7 {\"a\":1}\n");
}

TEST(JournalTest, ReadsBackInOrder) {
  std::string text = JournalLine("one") + JournalLine("") + JournalLine("three");
  Scanned s = Scan(text);
  EXPECT_THAT(s.payloads, ElementsAre("one", "", "three"));
  EXPECT_EQ(s.scan.good_bytes, text.size());
  EXPECT_EQ(s.scan.torn_bytes, 0u);
  EXPECT_TRUE(s.scan.damage.ok());
}

TEST(JournalTest, EveryTornTailIsCutAtTheLastGoodLine) {
  std::string good = JournalLine("one") + JournalLine("two");
  std::string last = JournalLine("{\"type\":\"shot\"}");
  for (size_t cut = 1; cut < last.size(); ++cut) {
    Scanned s = Scan(good + last.substr(0, cut));
    EXPECT_THAT(s.payloads, ElementsAre("one", "two")) << cut;
    EXPECT_EQ(s.scan.good_bytes, good.size());
    EXPECT_EQ(s.scan.torn_bytes, cut);
    EXPECT_TRUE(s.scan.damage.ok());
  }
  // Blocks that were allocated but never written.
  Scanned zeros = Scan(good + std::string(4096, '\0'));
  EXPECT_EQ(zeros.scan.torn_bytes, 4096u);
  EXPECT_TRUE(zeros.scan.damage.ok());
}

TEST(JournalTest, EveryFlippedBitIsFound) {
  std::string first = JournalLine("one");
  for (size_t byte = 0; byte < first.size(); ++byte) {
    for (int bit = 0; bit < 8; ++bit) {
      std::string text = first + JournalLine("two") + JournalLine("three");
      text[byte] = static_cast<char>(text[byte] ^ (1 << bit));
      Scanned s = Scan(text);
      EXPECT_FALSE(s.scan.damage.ok()) << byte << " " << bit;
      EXPECT_EQ(s.payloads.back(), "three");
      EXPECT_NE(s.payloads.front(), "one");
    }
  }
}

TEST(JournalTest, DamageNamesLineAndOffset) {
  std::string text = JournalLine("one") + "garbage\n" + JournalLine("three");
  Scanned s = Scan(text);
  EXPECT_EQ(s.scan.damage.code(), absl::StatusCode::kDataLoss);
  EXPECT_EQ(ErrorReason(s.scan.damage), "JOURNAL_CORRUPT");
  EXPECT_THAT(std::string(s.scan.damage.message()), HasSubstr("journal: line 2 at byte 15"));
  EXPECT_THAT(s.payloads, ElementsAre("one", "three"));
}

TEST(JournalTest, ARefusedEntryIsDamage) {
  Scanned s = Scan(JournalLine("one") + JournalLine("refused"));
  EXPECT_EQ(s.scan.damage.code(), absl::StatusCode::kDataLoss);
  EXPECT_THAT(std::string(s.scan.damage.message()), HasSubstr("line 2 at byte 15: no such entry"));
}

TEST(JournalTest, EmptyIsEmpty) {
  Scanned s = Scan("");
  EXPECT_THAT(s.payloads, IsEmpty());
  EXPECT_TRUE(s.scan.damage.ok());
}

}  // namespace
}  // namespace lightstage
