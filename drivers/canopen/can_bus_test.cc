// The shared bus and its nodes, over a bus within the process; the other end is scripted here.
#include "drivers/canopen/can_bus.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>

#include "base/env.h"
#include "base/status.h"
#include "drivers/canopen/memory_bus.h"
#include "drivers/canopen/node.h"
#include "drivers/canopen/socket_can.h"

namespace lightstage::canopen {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using testing::HasSubstr;

class CanBusTest : public testing::Test {
 protected:
  CanBusTest() : wire_(clock_), bus_(std::make_shared<CanBus>("can0", clock_, Opener())) {
    other_ = wire_.Attach();
  }
  CanPortOpener Opener() {
    return [this]() -> absl::StatusOr<std::unique_ptr<CanPort>> {
      ++opened_;
      auto port = wire_.Attach();
      mine_ = port.get();
      return port;
    };
  }
  void Say(uint16_t id, std::vector<uint8_t> bytes) {
    ASSERT_TRUE(other_->Send(MakeFrame(id, bytes)).ok());
  }
  bool Becomes(absl::FunctionRef<bool()> ready) {
    const TimePoint deadline = clock_.Now() + seconds(20);
    while (!ready()) {
      if (clock_.Now() > deadline) return false;
      SleepFor(clock_, milliseconds(2));
    }
    return true;
  }
  int SentWith(uint16_t id) {
    int count = 0;
    for (const CanFrame& frame : wire_.Sent()) count += frame.id == id;
    return count;
  }
  // Answers what node 5 is asked, in this order, whatever it is; aborts ask nothing.
  void AnswerWith(std::vector<std::vector<uint8_t>> answers) {
    for (const std::vector<uint8_t>& answer : answers) {
      while (true) {
        absl::StatusOr<std::optional<CanEvent>> event = other_->Receive(seconds(20));
        ASSERT_TRUE(event.ok() && event->has_value());
        if ((*event)->frame.id == 0x605 && (*event)->frame.data[0] != 0x80) break;
      }
      Say(0x585, answer);
    }
  }

  RealClock clock_;
  MemoryBus wire_;
  std::shared_ptr<CanBus> bus_;
  std::unique_ptr<CanPort> other_;
  CanPort* mine_ = nullptr;
  int opened_ = 0;
};

// What a port can do that the wire can not: its sending fails alone, and it stands still while frames wait in it.
class OddPort final : public CanPort {
 public:
  OddPort(std::unique_ptr<CanPort> port, const std::atomic<bool>& breaks,
          const std::atomic<Duration::rep>& stands_ns)
      : port_(std::move(port)), breaks_(breaks), stands_ns_(stands_ns) {}
  absl::Status Send(const CanFrame& frame) override {
    if (breaks_) return Error(absl::StatusCode::kUnavailable, "DEVICE_LOST", "it is down");
    return port_->Send(frame);
  }
  absl::StatusOr<std::optional<CanEvent>> Receive(Duration timeout) override {
    std::this_thread::sleep_for(Duration(stands_ns_));
    return port_->Receive(timeout);
  }
  CanState state() const override { return port_->state(); }

 private:
  const std::unique_ptr<CanPort> port_;
  const std::atomic<bool>& breaks_;
  const std::atomic<Duration::rep>& stands_ns_;
};

// A machine that is busy, or stood still: the answer was there in time.
TEST_F(CanBusTest, AnAnswerThatIsReadLateWasNotLate) {
  const std::atomic<bool> breaks{false};
  std::atomic<Duration::rep> stands_ns{0};
  auto bus = std::make_shared<CanBus>("can0", clock_, [&] {
    return absl::StatusOr<std::unique_ptr<CanPort>>(
        std::make_unique<OddPort>(wire_.Attach(), breaks, stands_ns));
  });
  Node five("tilt", bus, 5, milliseconds(300), nullptr);
  ASSERT_TRUE(five.Attach().ok());
  std::thread answer([&] { AnswerWith({{0x60, 0x17, 0x10, 0, 0, 0, 0, 0}}); });
  stands_ns = Duration(milliseconds(700)).count();
  const absl::Status written = five.WriteInteger({0x1017, 0}, 100, 2);
  EXPECT_TRUE(written.ok()) << written;
  stands_ns = 0;
  answer.join();
  EXPECT_EQ(ErrorReason(five.WriteInteger({0x1017, 0}, 100, 2)), "DEVICE_SILENT");
}

// Who shares the bus may be the one who finds that it is gone.
TEST_F(CanBusTest, WhoWaitsIsToldThatThePortWasTakenAway) {
  std::atomic<bool> breaks{false};
  const std::atomic<Duration::rep> stands_ns{0};
  auto bus =
      std::make_shared<CanBus>("can0", clock_, [&]() -> absl::StatusOr<std::unique_ptr<CanPort>> {
        if (breaks) return Error(absl::StatusCode::kUnavailable, "DEVICE_LOST", "it is down");
        return std::make_unique<OddPort>(wire_.Attach(), breaks, stands_ns);
      });
  Node five("tilt", bus, 5, seconds(20), nullptr), nine("lamps", bus, 9, seconds(1), nullptr);
  ASSERT_TRUE(five.Attach().ok() && nine.Attach().ok());
  absl::Status waited;
  const TimePoint begin = clock_.Now();
  std::thread waits([&] { waited = five.WriteInteger({0x1017, 0}, 100, 2); });
  ASSERT_TRUE(Becomes([&] { return SentWith(0x605) == 1; }));
  breaks = true;
  EXPECT_FALSE(nine.WriteInteger({0x1017, 0}, 100, 2).ok());
  EXPECT_FALSE(nine.Attach().ok());
  waits.join();
  EXPECT_EQ(ErrorReason(waited), "DEVICE_LOST") << waited;
  EXPECT_LT(clock_.Now() - begin, seconds(15));
  breaks = false;
  EXPECT_TRUE(five.Attach().ok());
}

TEST_F(CanBusTest, GivesFramesToTheNodeWhoseTheyAre) {
  Node five("tilt", bus_, 5, seconds(1), nullptr), nine("lamps", bus_, 9, seconds(1), nullptr);
  ASSERT_TRUE(five.Attach().ok());
  ASSERT_TRUE(nine.Attach().ok());
  EXPECT_EQ(opened_, 1) << "one port for all";
  Say(0x085, {0x20, 0x43, 1, 0, 0, 0, 0, 0});
  Say(0x705, {0x05});
  Say(0x709, {0x7F});
  ASSERT_TRUE(Becomes([&] { return nine.nmt_state() == NmtState::kPreOperational; }));
  EXPECT_EQ(five.nmt_state(), NmtState::kOperational);
  EXPECT_EQ(five.emergency()->code, 0x4320);
  EXPECT_FALSE(nine.emergency().has_value());
  EXPECT_TRUE(five.Check().ok());
  Say(0x705, {0x00});
  Say(0x705, {0x7F});
  ASSERT_TRUE(Becomes([&] { return five.nmt_state() == NmtState::kPreOperational; }));
  EXPECT_TRUE(five.Check().ok()) << "it was not told anything that it could forget";
  std::thread answer([&] { AnswerWith({{0x60, 0x17, 0x10, 0, 0, 0, 0, 0}}); });
  EXPECT_TRUE(five.WriteInteger({0x1017, 0}, 100, 2).ok());
  answer.join();
  Say(0x085, {0, 0, 0, 0, 0, 0, 0, 0});
  Say(0x705, {0x00});
  ASSERT_TRUE(Becomes([&] { return !five.Check().ok(); }));
  EXPECT_EQ(ErrorReason(five.Check()), "DEVICE_LOST");
  EXPECT_FALSE(five.emergency().has_value()) << "it said that it is over";
  EXPECT_TRUE(nine.Check().ok());
  EXPECT_TRUE(five.Attach().ok());
  EXPECT_TRUE(five.Check().ok());
}

TEST_F(CanBusTest, EveryoneIsToldOfBusOffAndOneConnectsForAll) {
  Node five("tilt", bus_, 5, seconds(1), nullptr), nine("lamps", bus_, 9, seconds(1), nullptr);
  ASSERT_TRUE(five.Attach().ok());
  ASSERT_TRUE(nine.Attach().ok());
  wire_.SetState(*mine_, CanState::kPassive);
  ASSERT_TRUE(Becomes([&] { return bus_->state() == CanState::kPassive; }));
  EXPECT_TRUE(five.Check().ok()) << "that is a warning only";
  // At once, however busy the machine is now and then.
  Duration shortest = seconds(20);
  for (int i = 0; i < 5; ++i) {
    wire_.SetState(*mine_, CanState::kActive);
    ASSERT_TRUE(Becomes([&] { return bus_->trouble().ok(); }));
    ASSERT_TRUE(five.Attach().ok());
    ASSERT_TRUE(nine.Attach().ok());
    const TimePoint off = clock_.Now();
    wire_.SetState(*mine_, CanState::kBusOff);
    ASSERT_TRUE(Becomes([&] { return !five.Check().ok() && !nine.Check().ok(); }));
    shortest = std::min(shortest, clock_.Now() - off);
  }
  EXPECT_LT(shortest, milliseconds(100));
  EXPECT_THAT(std::string(five.Check().message()), HasSubstr("bus-off"));
  EXPECT_EQ(ErrorReason(bus_->Send(EncodeSync())), "DEVICE_LOST");
  EXPECT_FALSE(five.Attach().ok());
  wire_.SetState(*mine_, CanState::kActive);
  ASSERT_TRUE(Becomes([&] { return bus_->trouble().ok(); }));
  EXPECT_EQ(ErrorReason(five.Check()), "DEVICE_LOST") << "until it attaches anew";
  EXPECT_TRUE(five.Attach().ok());
  EXPECT_EQ(opened_, 1);
  wire_.SetPresent(false);
  ASSERT_TRUE(Becomes([&] { return !five.Check().ok(); }));
  wire_.SetPresent(true);
  EXPECT_TRUE(Becomes([&] { return five.Attach().ok() && five.Check().ok(); }));
  EXPECT_GE(opened_, 2);
}

TEST_F(CanBusTest, SaysOurHeartbeatWhileSomebodyWantsIt) {
  ASSERT_TRUE(bus_->Connect().ok());
  const int axis = 0, other_axis = 0, lamps = 0;
  ASSERT_TRUE(bus_->AddHeartbeat(127, milliseconds(20), &axis).ok());
  ASSERT_TRUE(bus_->AddHeartbeat(127, milliseconds(40), &other_axis).ok());
  ASSERT_TRUE(bus_->AddHeartbeat(126, {}, &lamps).ok());
  EXPECT_TRUE(Becomes([&] { return SentWith(0x77F) >= 5; }));
  EXPECT_EQ(SentWith(0x77E), 0) << "that one only when it is asked for";
  ASSERT_TRUE(bus_->SayHeartbeat(126).ok());
  EXPECT_EQ(SentWith(0x77E), 1);
  EXPECT_EQ(ErrorReason(bus_->AddHeartbeat(127, {}, &lamps)), "NODE_TAKEN");
  EXPECT_EQ(ErrorReason(bus_->AddHeartbeat(126, milliseconds(20), &axis)), "NODE_TAKEN");
  bus_->RemoveHeartbeat(&axis);
  bus_->RemoveHeartbeat(&other_axis);
  SleepFor(clock_, milliseconds(100));
  const int said = SentWith(0x77F);
  SleepFor(clock_, milliseconds(200));
  EXPECT_EQ(SentWith(0x77F), said);
}

TEST_F(CanBusTest, IsSharedByNameAndForgottenWithItsLastHolder) {
  std::shared_ptr<CanBus> first = CanBus::Shared("can7", clock_, Opener());
  EXPECT_EQ(CanBus::Shared("can7", clock_, Opener()), first);
  EXPECT_NE(CanBus::Shared("can8", clock_, Opener()), first);
  EXPECT_EQ(CanBus::Find("can7"), first);
  first.reset();
  EXPECT_EQ(CanBus::Find("can7"), nullptr);
}

TEST_F(CanBusTest, AnswersThatAreNoneAreSaid) {
  Node five("tilt", bus_, 5, seconds(2), nullptr);
  ASSERT_TRUE(five.Attach().ok());
  auto read = [&](std::vector<std::vector<uint8_t>> answers) {
    std::thread node([&] { AnswerWith(answers); });
    absl::Status status = five.Read({0x1008, 0}).status();
    node.join();
    return status;
  };
  // Segments that repeat, that are too many, and a number of bytes that is not kept.
  absl::Status status = read({{0x41, 0x08, 0x10, 0, 9, 0, 0, 0},
                              {0x00, 1, 2, 3, 4, 5, 6, 7},
                              {0x00, 1, 2, 3, 4, 5, 6, 7}});
  EXPECT_EQ(ErrorReason(status), "BAD_ANSWER") << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr("toggle"));
  status = read({{0x41, 0x08, 0x10, 0, 0xFF, 0xFF, 0xFF, 0x7F}});
  EXPECT_EQ(ErrorReason(status), "BAD_ANSWER") << status;
  status = read({{0x41, 0x08, 0x10, 0, 9, 0, 0, 0}, {0x01, 1, 2, 3, 4, 5, 6, 7}});
  EXPECT_EQ(ErrorReason(status), "BAD_ANSWER") << status;
  // About another object: it is not taken, and named.
  status = read({{0x43, 0x00, 0x10, 0, 1, 2, 3, 4}});
  EXPECT_EQ(ErrorReason(status), "DEVICE_SILENT") << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr("585 43 00 10 00 01 02 03 04"));
}

TEST_F(CanBusTest, SilenceIsJudgedByWhatWasHeard) {
  Node five("tilt", bus_, 5, seconds(1), nullptr);
  ASSERT_TRUE(five.Attach().ok());
  std::thread node([&] { AnswerWith({{0x60, 0x17, 0x10, 0, 0, 0, 0, 0}}); });
  ASSERT_TRUE(five.WatchHeartbeat(milliseconds(400)).ok());
  node.join();
  ASSERT_TRUE(Becomes([&] { return !five.Check().ok(); }));
  EXPECT_EQ(ErrorReason(five.Check()), "DEVICE_LOST");
  EXPECT_THAT(std::string(five.Check().message()), HasSubstr("400 ms"));
  Say(0x705, {0x05});
  SleepFor(clock_, milliseconds(50));
  EXPECT_EQ(ErrorReason(five.Check()), "DEVICE_LOST") << "it may have been reset meanwhile";
}

TEST(SocketCan, InterfacesAreThoseOfTypeCan) {
  const std::string root = testing::TempDir() + "/net";
  std::filesystem::remove_all(root);
  const struct {
    const char *name, *type, *flags;
  } interfaces[] = {
      {"eth0", "1\n", "0x1003\n"}, {"can1", "280\n", "0x40080\n"}, {"can0", "280\n", "0x400c1\n"}};
  for (const auto& interface : interfaces) {
    const std::string folder = root + "/" + interface.name;
    std::filesystem::create_directories(folder);
    ASSERT_TRUE(PosixEnv().WriteFile(folder + "/type", interface.type).ok());
    ASSERT_TRUE(PosixEnv().WriteFile(folder + "/flags", interface.flags).ok());
  }
  absl::StatusOr<std::vector<CanInterface>> found = ListCanInterfaces(root);
  ASSERT_TRUE(found.ok()) << found.status();
  ASSERT_EQ(found->size(), 2u);
  EXPECT_EQ((*found)[0].name, "can0");
  EXPECT_TRUE((*found)[0].up);
  EXPECT_EQ((*found)[1].name, "can1");
  EXPECT_FALSE((*found)[1].up);
  EXPECT_EQ(ErrorReason(ListCanInterfaces(root + "/nowhere").status()), "IO");
}

// With CAN or without: an interface that is not there is an error that names it.
TEST(SocketCan, MissingInterfaceIsNamed) {
  RealClock clock;
  const absl::Status missing = OpenSocketCan("can-not-there", clock).status();
  EXPECT_FALSE(missing.ok());
  EXPECT_TRUE(ErrorReason(missing) == "DEVICE_LOST" || ErrorReason(missing) == "CAN_UNSUPPORTED")
      << missing;
  EXPECT_THAT(ErrorMetadataOf(missing),
              testing::Contains(std::pair<std::string, std::string>("interface", "can-not-there")));
}

}  // namespace
}  // namespace lightstage::canopen
