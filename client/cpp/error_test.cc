#include "client/cpp/error.h"

#include "base/status.h"
#include "client/cpp/testing/fake_daemon.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace lightstage::client {
namespace {

using ::testing::ElementsAre;
using ::testing::Pair;

TEST(FromGrpc, TakesReasonAndMetadataFromErrorInfo) {
  absl::Status status = FromGrpc(FakeError(grpc::StatusCode::FAILED_PRECONDITION, "CONTROL_HELD",
                                           "held by anna", {{"owner", "anna"}, {"note", "n"}}));
  EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(status.message(), "held by anna");
  EXPECT_EQ(ErrorReason(status), "CONTROL_HELD");
  EXPECT_THAT(ErrorMetadataOf(status), ElementsAre(Pair("note", "n"), Pair("owner", "anna")));
  EXPECT_FALSE(IsConnectionLost(status));
}

TEST(FromGrpc, OkStaysOk) { EXPECT_TRUE(FromGrpc(grpc::Status::OK).ok()); }

TEST(FromGrpc, WithoutErrorInfoTheTransportSpeaks) {
  EXPECT_TRUE(IsConnectionLost(FromGrpc({grpc::StatusCode::UNAVAILABLE, "Socket closed"})));
  EXPECT_TRUE(IsConnectionLost(FromGrpc({grpc::StatusCode::CANCELLED, ""})));
  EXPECT_EQ(ErrorReason(FromGrpc({grpc::StatusCode::DEADLINE_EXCEEDED, ""})), "NO_ANSWER");
  absl::Status unimplemented = FromGrpc({grpc::StatusCode::UNIMPLEMENTED, "no such method"});
  EXPECT_EQ(ErrorReason(unimplemented), "UNIMPLEMENTED");
  EXPECT_FALSE(IsConnectionLost(unimplemented));
}

// The daemon may well be there and say so itself: that is an answer, not a broken connection.
TEST(FromGrpc, UnavailableFromTheDaemonIsNotALostConnection) {
  absl::Status status =
      FromGrpc(FakeError(grpc::StatusCode::UNAVAILABLE, "DEVICE_SILENT", "camera is silent"));
  EXPECT_FALSE(IsConnectionLost(status));
  EXPECT_EQ(ErrorReason(status), "DEVICE_SILENT");
}

TEST(FromGrpc, GarbageInTheDetailsIsIgnored) {
  absl::Status status = FromGrpc({grpc::StatusCode::NOT_FOUND, "gone", "\xff\xff not a message"});
  EXPECT_EQ(ErrorReason(status), "NOT_FOUND");
  EXPECT_EQ(status.message(), "gone");
}

}  // namespace
}  // namespace lightstage::client
