#include "drivers/modbus/line.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <modbus/modbus.h>

#include <cerrno>

#include "base/status.h"
#include "drivers/conformance/private_network.h"
#include "drivers/modbus/axis.h"
#include "drivers/modbus/client.h"
#include "drivers/modbus/lamps.h"

namespace lightstage {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::seconds;
using testing::ElementsAre;
using testing::HasSubstr;

[[maybe_unused]] const bool kPrivateNetwork = EnterPrivateNetwork();

LineOptions Tcp() {
  LineOptions line;
  line.host = "127.0.0.1";
  line.port = 1;  // nobody listens there
  return line;
}

LineOptions Serial(const char* port) {
  LineOptions line;
  line.serial_port = port;
  return line;
}

TEST(Line, FramesAreApartAsTheStandardSays) {
  EXPECT_EQ(FrameGap(115200), microseconds(1750));
  EXPECT_NEAR(Seconds(FrameGap(9600)), 0.00401, 0.00001);
}

TEST(Line, ErrorsNameExceptionFunctionAndRegister) {
  const Request request{"turntable", 3, 16, 0x58, 16};
  absl::Status error = RequestError(EMBXILADD, request, Tcp());
  EXPECT_EQ(error.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(ErrorReason(error), "MODBUS_EXCEPTION");
  EXPECT_THAT(MessageOf(error),
              HasSubstr("turntable: 127.0.0.1:1: exception 2, ILLEGAL DATA ADDRESS"));
  EXPECT_THAT(MessageOf(error),
              HasSubstr("function 16 (write registers), registers 0x0058 to 0x0067 of unit 3"));
  error = RequestError(EMBXSBUSY, {"lamps", 1, 5, 7, 1}, Tcp());
  EXPECT_THAT(MessageOf(error), HasSubstr("SERVER DEVICE BUSY"));
  EXPECT_THAT(MessageOf(error), HasSubstr("function 5 (write coil), coil 0x0007 of unit 1"));
}

TEST(Line, ErrorsHaveTheirReasons) {
  const Request request{"turntable", 1, 3, 0, 1};
  auto reason = [&](int error) { return ErrorReason(RequestError(error, request, Tcp())); };
  EXPECT_EQ(reason(ETIMEDOUT), "DEVICE_SILENT");
  EXPECT_EQ(reason(EMBXGTAR), "DEVICE_SILENT") << "a gateway asked it in vain";
  for (int error : {EMBBADCRC, EMBBADDATA, EMBBADSLAVE, EMBBADEXC, EMBUNKEXC}) {
    EXPECT_EQ(reason(error), "MODBUS_GARBLED") << modbus_strerror(error);
  }
  for (int error : {ECONNRESET, ECONNREFUSED, EPIPE, EIO, ENODEV, EBADF}) {
    EXPECT_EQ(reason(error), "DEVICE_LOST") << modbus_strerror(error);
  }
  for (int error : {EMBXILFUN, EMBXILVAL, EMBXSFAIL, EMBXACK, EMBXNACK, EMBXMEMPAR}) {
    EXPECT_EQ(reason(error), "MODBUS_EXCEPTION") << modbus_strerror(error);
  }
  EXPECT_EQ(reason(EMBMDATA), "MODBUS_REQUEST");
}

TEST(Line, ARefusedConnectionIsALossAtOnce) {
  RealClock clock;
  ModbusClient client(Tcp(), 1, "tilt", clock);
  const TimePoint begin = clock.Now();
  const absl::Status status = client.Connect();
  EXPECT_EQ(ErrorReason(status), "DEVICE_LOST") << status;
  EXPECT_THAT(MessageOf(status), HasSubstr("127.0.0.1:1"));
  EXPECT_LT(clock.Now() - begin, seconds(10));
  EXPECT_EQ(ErrorReason(client.ReadRegisters(0, 1).status()), "DEVICE_LOST");
}

TEST(Line, AMissingSerialPortIsALoss) {
  RealClock clock;
  ModbusClient client(Serial("/dev/serial/by-id/there-is-none"), 1, "tilt", clock);
  EXPECT_EQ(ErrorReason(client.ReadCoils(0, 1).status()), "DEVICE_LOST") << "never connected";
  const absl::Status status = client.Connect();
  EXPECT_EQ(ErrorReason(status), "DEVICE_LOST");
  EXPECT_THAT(MessageOf(status), HasSubstr("there-is-none"));
}

TEST(Line, DevicesOnOneSerialLineMustAgree) {
  LineOptions options = Serial("/dev/ttyTEST");
  auto first = Line::Get(options), second = Line::Get(options);
  ASSERT_TRUE(first.ok() && second.ok());
  EXPECT_EQ(*first, *second);
  options.baud = 9600;
  EXPECT_EQ(ErrorReason(Line::Get(options).status()), "SERIAL_PORT_SHARED");
  first->reset();
  second->reset();
  EXPECT_TRUE(Line::Get(options).ok()) << "nobody uses it any more";
  EXPECT_NE(*Line::Get(Tcp()), *Line::Get(Tcp())) << "TCP has a connection each";
}

TEST(LampRuns, AreWhatOneRequestCanHold) {
  auto runs = LampRuns({7, 3, 4, 9, 5}, 2);
  ASSERT_EQ(runs.size(), 4u);
  EXPECT_EQ(runs[0].first, 3);
  EXPECT_THAT(runs[0].lamps, ElementsAre(1, 2));
  EXPECT_EQ(runs[1].first, 5);
  EXPECT_THAT(runs[1].lamps, ElementsAre(4));
  EXPECT_THAT(runs[2].lamps, ElementsAre(0));
  EXPECT_EQ(runs[3].first, 9);
  EXPECT_TRUE(LampRuns({}, 10).empty());
}

TEST(ImplausibleHint, TellsWhatIsLikelyWrong) {
  EXPECT_THAT(ImplausibleHint(0.5, 32768.0), HasSubstr("other order"));
  EXPECT_THAT(ImplausibleHint(0.5, 0.00001), HasSubstr("does not follow"));
  EXPECT_THAT(ImplausibleHint(0.5, -0.5), HasSubstr("opposite"));
  EXPECT_THAT(ImplausibleHint(0.5, 0.25), HasSubstr("scaled"));
}

}  // namespace
}  // namespace lightstage
