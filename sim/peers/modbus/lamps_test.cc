// The lamps' contract over relay and dimmer boards, and what goes wrong with them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "drivers/conformance/fixtures.h"
#include "drivers/conformance/private_network.h"
#include "drivers/conformance/unplug.h"
#include "sim/peers/modbus/test_bench.h"

namespace lightstage::sim {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using testing::HasSubstr;

[[maybe_unused]] const bool kPrivateNetwork = EnterPrivateNetwork();

constexpr int kLamps = 40;
constexpr char kSingleWrites[] = "single_writes = true\n";

// Two boards share the lamps.
class Boards {
 public:
  Boards(Wire wire, LampsPeerOptions options, std::string keys)
      : wire_(wire), keys_(std::move(keys)), bench_(kLamps) {
    options.lamps = 24;
    boards_.push_back(std::make_shared<ModbusLampsPeer>(options, bench_.world()));
    options.first_lamp = 24;
    options.lamps = kLamps - 24;
    boards_.push_back(std::make_shared<ModbusLampsPeer>(options, bench_.world()));
  }
  absl::StatusOr<std::unique_ptr<Lamps>> Open() {
    RETURN_IF_ERROR(bench_.Serve(wire_, {{1, boards_[0]}, {2, boards_[1]}}));
    return bench_.Open(ModbusLampsDriver(), "lamps",
                       absl::StrCat("response_timeout_ms = 500\nsettle_ms = 1\n", keys_,
                                    "[[lamps.board]]\nunit = 1\nfirst = 16\ncount = 24\n"
                                    "[[lamps.board]]\nunit = 2\nfirst = 16\ncount = 16\n",
                                    watchdog_));
  }
  void SetWatchdog(const std::string& keys) { watchdog_ = keys; }
  std::vector<float> Emitted() { return bench_.world()->LampLevels(bench_.clock().Now()); }
  ModbusBench& bench() { return bench_; }
  ModbusLampsPeer& board(int i) { return *boards_[i]; }

 private:
  const Wire wire_;
  const std::string keys_;
  std::string watchdog_;
  ModbusBench bench_;
  std::vector<std::shared_ptr<ModbusLampsPeer>> boards_;
};

class BoardsFixture : public LampsFixture {
 public:
  explicit BoardsFixture(std::unique_ptr<Boards> boards) : boards_(std::move(boards)) {}
  Clock& clock() override { return boards_->bench().clock(); }
  absl::StatusOr<std::unique_ptr<Lamps>> Open() override { return boards_->Open(); }
  std::optional<std::vector<float>> Emitted() override { return boards_->Emitted(); }

 private:
  std::unique_ptr<Boards> boards_;
};

std::unique_ptr<Boards> Relays(Wire wire, const std::string& keys, bool inverted = false) {
  LampsPeerOptions options;
  options.first_address = 16;
  options.single_writes = keys == kSingleWrites;
  options.inverted = inverted;
  return std::make_unique<Boards>(wire, options, "kind = \"coils\"\n" + keys);
}

std::unique_ptr<Boards> Dimmers(Wire wire, const std::string& keys = "") {
  LampsPeerOptions options;
  options.first_address = 16;
  options.single_writes = keys == kSingleWrites;
  options.full = 255;
  options.watchdog = 100;
  options.watchdog_step = milliseconds(100);
  auto boards =
      std::make_unique<Boards>(wire, options, "kind = \"registers\"\nfull = 255\n" + keys);
  boards->SetWatchdog("[lamps.watchdog]\nregister = 100\nstep_ms = 100\nmax = 600\n");
  return boards;
}

using Make = std::unique_ptr<Boards> (*)();
bool Register(const char* name, Make make) {
  return RegisterLampsConformance(name, [=] { return std::make_unique<BoardsFixture>(make()); });
}

[[maybe_unused]] const bool kConformance =
    Register("ModbusRelaysTcp", [] { return Relays(Wire::kTcp, ""); }) &&
    Register("ModbusRelaysRtu", [] { return Relays(Wire::kRtu, kSingleWrites); }) &&
    Register("ModbusInvertedRelays",
             [] { return Relays(Wire::kTcp, "inverted = true\n", true); }) &&
    Register("ModbusDimmersTcp", [] { return Dimmers(Wire::kTcp); }) &&
    Register("ModbusDimmersRtu", [] { return Dimmers(Wire::kRtu, kSingleWrites); });

class BoardsTest : public testing::Test {
 protected:
  void Start(std::unique_ptr<Boards> boards) {
    boards_ = std::move(boards);
    auto lamps = boards_->Open();
    ASSERT_TRUE(lamps.ok()) << lamps.status();
    lamps_ = *std::move(lamps);
  }
  absl::Status Set(const std::vector<float>& levels) {
    Pending<LampsState> done(boards_->bench().clock());
    lamps_->Set(levels, boards_->bench().In(seconds(30)), done.sink());
    return done.Wait(kNever, "Set").status();
  }
  absl::Status Dark() {
    Pending<LampsState> done(boards_->bench().clock());
    lamps_->Dark(boards_->bench().In(seconds(30)), done.sink());
    return done.Wait(kNever, "Dark").status();
  }
  std::unique_ptr<Boards> boards_;
  std::unique_ptr<Lamps> lamps_;
};

const std::vector<float> kAll(kLamps, 1.0f), kNone(kLamps, 0.0f);

TEST_F(BoardsTest, ALampThatDoesNotTakeItIsNamed) {
  Start(Relays(Wire::kTcp, ""));
  boards_->board(1).Stick(30);
  const absl::Status status = Set(kAll);
  EXPECT_EQ(ErrorReason(status), "LAMP_NOT_CONFIRMED");
  EXPECT_THAT(MessageOf(status),
              HasSubstr("lamp 30 (coil 22 of unit 2) was set to 1 of 1 and reads "
                        "back 0"));
  boards_->board(1).Stick({});
  EXPECT_TRUE(Set(kAll).ok()) << "what is not known is written anew";
  EXPECT_EQ(boards_->Emitted(), kAll);
}

TEST_F(BoardsTest, ALampThatStaysLitIsToldOfDarkToo) {
  Start(Dimmers(Wire::kTcp));
  ASSERT_TRUE(Set(kAll).ok());
  boards_->board(0).Stick(7);
  const absl::Status status = Dark();
  EXPECT_EQ(ErrorReason(status), "LAMP_NOT_CONFIRMED");
  EXPECT_THAT(MessageOf(status), HasSubstr("lamp 7 (register 23 of unit 1)"));
  EXPECT_THAT(MessageOf(status), HasSubstr("255"));
}

TEST_F(BoardsTest, ABoardThatReadsBackLateIsWaitedFor) {
  Start(Relays(Wire::kTcp, "confirm_ms = 1000\n"));
  boards_->board(0).ReadBackLate(milliseconds(100));
  EXPECT_TRUE(Set(kAll).ok());
  boards_->board(0).ReadBackLate(seconds(60));
  EXPECT_EQ(ErrorReason(Dark()), "LAMP_NOT_CONFIRMED");
}

TEST_F(BoardsTest, OneBoardThatFailsDoesNotKeepTheOtherLit) {
  Start(Relays(Wire::kTcp, ""));
  ASSERT_TRUE(Set(kAll).ok());
  boards_->bench().server().Inject(WireFault::kException, 1, 4);
  EXPECT_EQ(ErrorReason(Dark()), "MODBUS_EXCEPTION");
  const std::vector<float> emitted = boards_->Emitted();
  for (int i = 0; i < kLamps; ++i) EXPECT_EQ(emitted[i], i < 24 ? 1.0f : 0.0f) << i;
  EXPECT_TRUE(Dark().ok());
  EXPECT_EQ(boards_->Emitted(), kNone);
}

TEST_F(BoardsTest, ALostConnectionComesBackDark) {
  for (Wire wire : {Wire::kTcp, Wire::kRtu}) {
    Start(Relays(wire, ""));
    ASSERT_TRUE(Set(kAll).ok());
    boards_->bench().server().Unplug();
    EXPECT_EQ(ErrorReason(Set(kAll)), "DEVICE_LOST");
    EXPECT_EQ(ErrorReason(Dark()), "DEVICE_LOST");
    ASSERT_EQ(boards_->bench().server().Plug(), absl::OkStatus());
    EXPECT_TRUE(Dark().ok());
    EXPECT_EQ(boards_->Emitted(), kNone);
    EXPECT_TRUE(Set(kAll).ok());
    lamps_.reset();
    EXPECT_EQ(boards_->Emitted(), kNone);
  }
}

TEST_F(BoardsTest, TheTimeToDarkIsTheBoardsOwn) {
  Start(Dimmers(Wire::kTcp));
  EXPECT_EQ(lamps_->info().max_time_to_dark, seconds(60));
  ASSERT_TRUE(lamps_->SetTimeToDark(milliseconds(1500)).ok());
  ASSERT_TRUE(Set(kAll).ok());
  boards_->bench().server().Unplug();  // as if the daemon were gone
  EXPECT_TRUE(boards_->bench().Becomes([&] { return boards_->Emitted() == kNone; }));
  ASSERT_EQ(boards_->bench().server().Plug(), absl::OkStatus());
  EXPECT_EQ(ErrorReason(Set(kAll)), "DEVICE_LOST");
  // Connected anew it is set again.
  ASSERT_TRUE(Set(kAll).ok());
  EXPECT_TRUE(boards_->bench().Becomes([&] { return boards_->Emitted() == kNone; }));
}

TEST_F(BoardsTest, UnpluggedIsToldWithinASecondAndKeepsNothingOpen) {
  for (Wire wire : {Wire::kTcp, Wire::kRtu}) {
    Start(Relays(wire, ""));
    bool on = false;
    CheckUnplugging(boards_->bench().clock(), "lamps",
                    {.plug =
                         [&](bool plugged) {
                           if (plugged) {
                             EXPECT_EQ(boards_->bench().server().Plug(), absl::OkStatus());
                           } else {
                             boards_->bench().server().Unplug();
                           }
                         },
                     .use = [&] { return Set((on = !on) ? kAll : kNone); },
                     .recover =
                         [&] {
                           Set(kNone).IgnoreError();  // may find out only now
                           return Set(kNone);
                         }});
    lamps_.reset();
  }
}

TEST_F(BoardsTest, ABoardWithoutTheWatchdogRegisterIsRefused) {
  boards_ = Relays(Wire::kTcp, "");
  boards_->SetWatchdog("[lamps.watchdog]\nregister = 7\nstep_ms = 100\nmax = 600\n");
  EXPECT_EQ(ErrorReason(boards_->Open().status()), "MODBUS_EXCEPTION");
}

}  // namespace
}  // namespace lightstage::sim
