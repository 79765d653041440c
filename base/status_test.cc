#include "base/status.h"

#include <cerrno>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace lightstage {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::Pair;

TEST(StatusTest, CarriesReasonAndMetadata) {
  absl::Status status =
      Error(absl::StatusCode::kOutOfRange, "AXIS_LIMIT", "turntable: 400 is too far",
            {{"axis", "turntable"}, {"target", "400"}, {"note", ""}});
  EXPECT_EQ(status.code(), absl::StatusCode::kOutOfRange);
  EXPECT_EQ(std::string(status.message()), "turntable: 400 is too far");
  EXPECT_EQ(ErrorReason(status), "AXIS_LIMIT");
  EXPECT_THAT(ErrorMetadataOf(status),
              ElementsAre(Pair("axis", "turntable"), Pair("target", "400"), Pair("note", "")));
}

TEST(StatusTest, ForeignErrorsHaveTheirCodesName) {
  EXPECT_EQ(ErrorReason(absl::UnavailableError("gone")), "UNAVAILABLE");
  EXPECT_THAT(ErrorMetadataOf(absl::UnavailableError("gone")), IsEmpty());
}

TEST(StatusTest, AnnotateKeepsEverythingElse) {
  absl::Status inner = Error(absl::StatusCode::kDataLoss, "X", "why", {{"k", "v"}});
  absl::Status outer = Annotate(inner, "shot 3");
  EXPECT_EQ(std::string(outer.message()), "shot 3: why");
  EXPECT_EQ(outer.code(), absl::StatusCode::kDataLoss);
  EXPECT_EQ(ErrorReason(outer), "X");
  EXPECT_THAT(ErrorMetadataOf(outer), ElementsAre(Pair("k", "v")));
  EXPECT_TRUE(Annotate(absl::OkStatus(), "shot 3").ok());
}

TEST(StatusTest, ErrnoErrors) {
  struct Case {
    int error;
    absl::StatusCode code;
    const char* reason;
  };
  for (const Case& c : {Case{ENOENT, absl::StatusCode::kNotFound, "FILE_NOT_FOUND"},
                        Case{ENOSPC, absl::StatusCode::kResourceExhausted, "DISK_FULL"},
                        Case{EDQUOT, absl::StatusCode::kResourceExhausted, "DISK_FULL"},
                        Case{EROFS, absl::StatusCode::kPermissionDenied, "FILE_PERMISSION"},
                        Case{EEXIST, absl::StatusCode::kAlreadyExists, "FILE_EXISTS"},
                        Case{EIO, absl::StatusCode::kInternal, "FILE_IO"}}) {
    absl::Status status = ErrnoError(c.error, "write", "/data/x");
    EXPECT_EQ(status.code(), c.code);
    EXPECT_EQ(ErrorReason(status), c.reason);
    EXPECT_THAT(std::string(status.message()), testing::StartsWith("write /data/x: "));
  }
}

absl::StatusOr<int> Half(int x) {
  if (x % 2 != 0) return absl::InvalidArgumentError("odd");
  return x / 2;
}

absl::StatusOr<int> Quarter(int x) {
  ASSIGN_OR_RETURN(int half, Half(x));
  ASSIGN_OR_RETURN(int quarter, Half(half));
  RETURN_IF_ERROR(Half(0).status());
  return quarter;
}

TEST(StatusTest, Macros) {
  EXPECT_EQ(Quarter(8).value(), 2);
  EXPECT_EQ(std::string(Quarter(6).status().message()), "odd");
}

// Debian's Abseil has a string_view of its own: ours must go into messages all the same.
TEST(StatusTest, EveryKindOfStringGoesIntoAMessage) {
  std::string_view view = "view";
  std::string text = "string";
  EXPECT_EQ(absl::StrCat("literal ", view, " ", text, " ", 3, " ", 0.5),
            "literal view string 3 0.5");
  absl::StrAppend(&text, view, 'c' - 'a');
  EXPECT_EQ(text, "stringview2");
  EXPECT_EQ(absl::StrCat(view), "view");
}

}  // namespace
}  // namespace lightstage
