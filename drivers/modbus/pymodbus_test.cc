// Against a Modbus server that nobody of this project wrote: python3-pymodbus, over TCP and over a serial line.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "drivers/conformance/fixtures.h"
#include "drivers/conformance/private_network.h"
#include "drivers/modbus/client.h"
#include "drivers/modbus/lamps.h"
#include "drivers/modbus/testing/server_process.h"
#include "drivers/modbus/values.h"

namespace lightstage {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using testing::ElementsAre;
using testing::ElementsAreArray;
using testing::HasSubstr;

[[maybe_unused]] const bool kPrivateNetwork = EnterPrivateNetwork();

constexpr int kPort = 15020;

enum class Wire { kTcp, kRtu };

class PymodbusTest : public testing::TestWithParam<Wire> {
 protected:
  void SetUp() override {
    auto started =
        GetParam() == Wire::kTcp ? PymodbusServer::StartTcp(kPort) : PymodbusServer::StartRtu();
    ASSERT_TRUE(started.ok()) << started.status();
    server_.emplace(*std::move(started));
  }
  LineOptions Options() const {
    LineOptions line;
    if (GetParam() == Wire::kTcp) {
      line.host = "127.0.0.1";
      line.port = kPort;
    } else {
      line.serial_port = server_->serial_port();
    }
    line.response_timeout = milliseconds(1000);  // an interpreter on a busy machine
    return line;
  }

  RealClock clock_;
  std::optional<PymodbusServer> server_;
};

INSTANTIATE_TEST_SUITE_P(Wires, PymodbusTest, testing::Values(Wire::kTcp, Wire::kRtu),
                         [](const auto& info) { return info.param == Wire::kTcp ? "Tcp" : "Rtu"; });

TEST_P(PymodbusTest, RegistersAndCoilsRoundTrip) {
  ModbusClient client(Options(), 1, "peer", clock_);
  ASSERT_TRUE(client.Connect().ok());
  ASSERT_TRUE(client.WriteRegister(5, 0xABCD).ok());
  ASSERT_TRUE(client.WriteRegisters(6, std::vector<uint16_t>{1, 2, 65535}).ok());
  auto read = client.ReadRegisters(4, 5);
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_THAT(*read, ElementsAre(0, 0xABCD, 1, 2, 65535));

  ASSERT_TRUE(client.WriteCoil(17, true).ok());
  std::vector<bool> pattern(40);
  for (size_t i = 0; i < pattern.size(); ++i) pattern[i] = i % 3 == 0;
  ASSERT_TRUE(client.WriteCoils(20, pattern).ok());
  auto coils = client.ReadCoils(20, 40);
  ASSERT_TRUE(coils.ok()) << coils.status();
  EXPECT_THAT(*coils, ElementsAreArray(pattern));
  EXPECT_THAT(*client.ReadCoils(16, 3), ElementsAre(false, true, false));
}

TEST_P(PymodbusTest, LongNumbersInBothWordOrders) {
  ModbusClient client(Options(), 1, "peer", clock_);
  ASSERT_TRUE(client.Connect().ok());
  const NumberFormat high{2, WordOrder::kHighFirst, true}, low{2, WordOrder::kLowFirst, true};
  for (int64_t value : {int64_t{-2}, int64_t{100000}, int64_t{INT32_MIN}, int64_t{INT32_MAX}}) {
    ASSERT_TRUE(client.WriteRegisters(10, *EncodeNumber(high, value)).ok());
    ASSERT_TRUE(client.WriteRegisters(12, *EncodeNumber(low, value)).ok());
    auto read = client.ReadRegisters(10, 4);
    ASSERT_TRUE(read.ok()) << read.status();
    const std::span<const uint16_t> words(*read);
    EXPECT_EQ(DecodeNumber(high, words.first(2)), value);
    EXPECT_EQ(DecodeNumber(low, words.last(2)), value);
    EXPECT_EQ(words[0], words[3]);
    EXPECT_EQ(words[1], words[2]);
  }
}

TEST_P(PymodbusTest, AnAddressThatItDoesNotHaveIsNamed) {
  ModbusClient client(Options(), 1, "turntable", clock_);
  ASSERT_TRUE(client.Connect().ok());
  const absl::Status status = client.ReadRegisters(300, 2).status();
  EXPECT_EQ(ErrorReason(status), "MODBUS_EXCEPTION");
  EXPECT_THAT(MessageOf(status), HasSubstr("exception 2, ILLEGAL DATA ADDRESS"));
  EXPECT_THAT(MessageOf(status), HasSubstr("0x012C to 0x012D of unit 1"));
  EXPECT_TRUE(client.ReadRegisters(0, 2).ok()) << "the connection is as good as before";
}

TEST_P(PymodbusTest, SilenceAndThenTheRightAnswer) {
  LineOptions options = Options();
  options.response_timeout = milliseconds(300);
  ModbusClient client(options, 1, "peer", clock_);
  ASSERT_TRUE(client.Connect().ok());
  ASSERT_TRUE(client.WriteRegisters(0, std::vector<uint16_t>{111, 222}).ok());
  server_->server().Suspend(true);
  EXPECT_EQ(ErrorReason(client.ReadRegisters(0, 1).status()), "DEVICE_SILENT");
  server_->server().Suspend(false);
  // The answer to the request before, 111, comes now; it has the same shape.
  absl::StatusOr<std::vector<uint16_t>> read = absl::UnknownError("");
  for (int i = 0; i < 20 && !read.ok(); ++i) read = client.ReadRegisters(1, 1);
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_THAT(*read, ElementsAre(222));
}

TEST_P(PymodbusTest, AConnectionThatGoesAwayIsALoss) {
  ModbusClient client(Options(), 1, "peer", clock_);
  ASSERT_TRUE(client.Connect().ok());
  ASSERT_TRUE(client.ReadRegisters(0, 1).ok());
  if (GetParam() == Wire::kTcp) {
    server_->server().Kill();
  } else {
    server_->line().Kill();  // as pulling the converter out
  }
  const TimePoint begin = clock_.Now();
  EXPECT_EQ(ErrorReason(client.ReadRegisters(0, 1).status()), "DEVICE_LOST");
  EXPECT_EQ(ErrorReason(client.ReadRegisters(0, 1).status()), "DEVICE_LOST");
  EXPECT_EQ(ErrorReason(client.Connect()), "DEVICE_LOST");
  EXPECT_LT(clock_.Now() - begin, seconds(10));
}

ModbusLampsOptions Relays(const LineOptions& line) {
  ModbusLampsOptions o;
  o.line = line;
  o.boards.push_back({1, {}});
  for (int i = 0; i < 40; ++i) o.boards[0].addresses.push_back(100 + i);
  return o;
}

TEST_P(PymodbusTest, LampsAreReadBack) {
  ModbusClient client(Options(), 1, "peer", clock_);
  ASSERT_TRUE(client.Connect().ok());
  ASSERT_TRUE(client.WriteCoil(139, true).ok());
  auto lamps = OpenModbusLamps(Relays(Options()), {"lamps", &clock_, nullptr});
  ASSERT_TRUE(lamps.ok()) << lamps.status();
  EXPECT_THAT(*client.ReadCoils(139, 1), ElementsAre(false)) << "opens dark";
  std::vector<float> levels(40, 0.0f);
  levels[3] = levels[39] = 1.0f;
  Pending<LampsState> set(clock_);
  (*lamps)->Set(levels, clock_.Now() + seconds(20), set.sink());
  auto state = set.Wait(kNever, "Set");
  ASSERT_TRUE(state.ok()) << state.status();
  EXPECT_EQ(state->levels, levels);
  EXPECT_THAT(*client.ReadCoils(102, 3), ElementsAre(false, true, false));
  EXPECT_THAT(*client.ReadCoils(138, 2), ElementsAre(false, true));
  lamps->reset();
  EXPECT_THAT(*client.ReadCoils(103, 1), ElementsAre(false)) << "closes dark";
}

// The lamps' contract over pymodbus.
class PymodbusLamps : public LampsFixture {
 public:
  explicit PymodbusLamps(bool registers)
      : registers_(registers), server_(PymodbusServer::StartTcp(kPort)) {
    line_.host = "127.0.0.1";
    line_.port = kPort;
    line_.response_timeout = milliseconds(1000);
    look_.emplace(line_, 1, "look", clock_);
    look_->Connect().IgnoreError();
  }
  Clock& clock() override { return clock_; }
  absl::StatusOr<std::unique_ptr<Lamps>> Open() override {
    RETURN_IF_ERROR(server_.status());
    ModbusLampsOptions o = Relays(line_);
    o.registers = registers_;
    if (registers_) o.full = 1000;
    return OpenModbusLamps(o, {"lamps", &clock_, nullptr});
  }
  std::optional<std::vector<float>> Emitted() override {
    std::vector<float> levels;
    if (registers_) {
      const std::vector<uint16_t> values = look_->ReadRegisters(100, 40).value();
      for (uint16_t value : values) {
        levels.push_back(static_cast<float>(value) / 1000.0f);
      }
    } else {
      const std::vector<bool> coils = look_->ReadCoils(100, 40).value();
      for (const bool on : coils) levels.push_back(on ? 1.0f : 0.0f);
    }
    return levels;
  }

 private:
  const bool registers_;
  RealClock clock_;
  LineOptions line_;
  absl::StatusOr<PymodbusServer> server_;
  std::optional<ModbusClient> look_;
};

[[maybe_unused]] const bool kConformance =
    RegisterLampsConformance("PymodbusCoils",
                             [] { return std::make_unique<PymodbusLamps>(false); }) &&
    RegisterLampsConformance("PymodbusRegisters",
                             [] { return std::make_unique<PymodbusLamps>(true); });

}  // namespace
}  // namespace lightstage
