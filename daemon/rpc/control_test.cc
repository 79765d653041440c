#include "daemon/rpc/control.h"

#include <atomic>

#include "base/status.h"
#include "gtest/gtest.h"

namespace lightstage::rpc {
namespace {

using std::chrono::milliseconds;

class ControlTest : public testing::Test {
 protected:
  // Waits for the lease to end by itself.
  bool WaitLost(Duration most) {
    return clock_.WaitUntil(clock_.Now() + most, [&] { return lost_ > 0; });
  }

  RealClock clock_;
  std::atomic<int> lost_{0};
  Control control_{clock_, milliseconds(200), [this](std::string_view) {
                     ++lost_;
                     clock_.Notify();
                   }};
};

TEST_F(ControlTest, OneAtATime) {
  auto token = control_.Acquire("anna", "focus");
  ASSERT_TRUE(token.ok());
  auto second = control_.Acquire("ben", "");
  EXPECT_EQ(ErrorReason(second.status()), "CONTROL_HELD");
  EXPECT_NE(MessageOf(second.status()).find("anna: focus"), std::string::npos);
  EXPECT_TRUE(control_.Check(*token).ok());
  EXPECT_EQ(ErrorReason(control_.Check("")), "CONTROL_REQUIRED");
  EXPECT_EQ(ErrorReason(control_.Check("0123")), "CONTROL_LOST");
  ASSERT_TRUE(control_.Release(*token).ok());
  EXPECT_EQ(lost_, 1);
  EXPECT_EQ(ErrorReason(control_.Release(*token)), "CONTROL_LOST");
  auto third = control_.Acquire("ben", "");
  ASSERT_TRUE(third.ok());
  EXPECT_NE(*third, *token);
}

TEST_F(ControlTest, EndsWithoutRenewalAndNotBefore) {
  auto token = control_.Acquire("anna", "");
  ASSERT_TRUE(token.ok());
  for (int i = 0; i < 10; ++i) {
    ASSERT_FALSE(WaitLost(milliseconds(50))) << "lost although it was renewed";
    ASSERT_TRUE(control_.Renew(*token).ok());
  }
  TimePoint renewed = clock_.Now();
  ASSERT_TRUE(WaitLost(std::chrono::seconds(10)));
  EXPECT_GE(clock_.Now() - renewed, milliseconds(199));
  EXPECT_EQ(ErrorReason(control_.Renew(*token).status()), "CONTROL_LOST");
  EXPECT_EQ(lost_, 1);
}

TEST_F(ControlTest, AnOwnerMustBeNamed) {
  EXPECT_EQ(ErrorReason(control_.Acquire("", "").status()), "OWNER_INVALID");
  EXPECT_EQ(ErrorReason(control_.Acquire(std::string(201, 'x'), "").status()), "OWNER_INVALID");
  EXPECT_EQ(ErrorReason(control_.Acquire("a", std::string(501, 'x')).status()), "OWNER_INVALID");
  EXPECT_FALSE(control_.holder().has_value());
}

}  // namespace
}  // namespace lightstage::rpc
