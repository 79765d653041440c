// Packets byte by byte; and the watch over a camera of a few lines: a socket that answers, refuses, forgets or is silent.
#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <vector>

#include "base/mutex.h"
#include "drivers/aravis/gvcp_watch.h"

namespace lightstage {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

std::vector<std::byte> Bytes(std::initializer_list<int> values) {
  std::vector<std::byte> bytes;
  for (int value : values) bytes.push_back(static_cast<std::byte>(value));
  return bytes;
}

// As other tools send and show them: key 42h, acknowledge wanted, READREG_CMD, 4 bytes, id 1234h, register 0A00h.
TEST(Gvcp, QuestionsAreThoseOfTheStandard) {
  const auto question = EncodeReadRegister(0x1234, 0x0A00);
  EXPECT_EQ(std::vector(question.begin(), question.end()),
            Bytes({0x42, 0x01, 0x00, 0x80, 0x00, 0x04, 0x12, 0x34, 0x00, 0x00, 0x0A, 0x00}));
}

TEST(Gvcp, AnswersAreTakenForTheirQuestionOnly) {
  const auto answer = Bytes({0, 0, 0, 0x81, 0, 4, 0x12, 0x34, 0, 0, 0, 2});
  const auto decoded = DecodeReadRegister(answer, 0x1234);
  ASSERT_TRUE(decoded.has_value());
  EXPECT_FALSE(decoded->refused);
  EXPECT_EQ(decoded->value, 2u);
  EXPECT_FALSE(DecodeReadRegister(answer, 0x1235).has_value());
  // ACCESS_DENIED: there is somebody.
  const auto refused = DecodeReadRegister(Bytes({0x80, 0x06, 0, 0x81, 0, 0, 0x12, 0x34}), 0x1234);
  ASSERT_TRUE(refused.has_value());
  EXPECT_TRUE(refused->refused);
  const auto pending = DecodeReadRegister(Bytes({0, 0, 0, 0x89, 0, 4, 0x12, 0x34}), 0x1234);
  EXPECT_TRUE(pending.has_value()) << "it is there, and takes a while";
  auto other = answer;
  other[3] = std::byte{0x83};  // WRITEREG_ACK
  EXPECT_FALSE(DecodeReadRegister(other, 0x1234).has_value());
  for (size_t size = 0; size < answer.size(); ++size) {
    EXPECT_FALSE(DecodeReadRegister(std::span(answer).first(size), 0x1234).has_value()) << size;
  }
}

// One event of 16 bytes: id, stream, block, time; and with EVENTDATA_CMD something behind it.
TEST(Gvcp, EventsAreTakenApart) {
  const auto one = Bytes(
      {0x42, 1, 0, 0xC0, 0, 16, 0x12, 0x34, 0, 0, 0x90, 3, 0, 0, 0, 7, 0, 0, 0, 0, 0, 0, 0, 9});
  const auto event = DecodeEvents(one);
  ASSERT_TRUE(event.has_value());
  EXPECT_EQ(event->request, 0x1234);
  EXPECT_TRUE(event->wants_acknowledge);
  ASSERT_EQ(event->events.size(), 1u);
  EXPECT_EQ(event->events[0].id, 0x9003);
  EXPECT_EQ(event->events[0].frame_id, 7u);
  const auto acknowledge = EncodeEventAcknowledge(*event);
  EXPECT_EQ(std::vector(acknowledge.begin(), acknowledge.end()),
            Bytes({0, 0, 0, 0xC1, 0, 0, 0x12, 0x34}));
  for (size_t size = 0; size < one.size(); ++size) {
    EXPECT_FALSE(DecodeEvents(std::span(one).first(size)).has_value()) << size;
  }
  // Two at once, and the longer form with 64 bits of block id.
  auto two = one;
  two[5] = std::byte{32};
  two.insert(two.end(), one.begin() + 8, one.end());
  two[24 + 3] = std::byte{4};
  ASSERT_EQ(DecodeEvents(two)->events.size(), 2u);
  EXPECT_EQ(DecodeEvents(two)->events[1].id, 0x9004);
  auto extended = one;
  extended[1] = std::byte{0x11};
  extended[5] = std::byte{24};
  EXPECT_FALSE(DecodeEvents(extended).has_value()) << "8 bytes are missing";
  extended.resize(32);
  extended[8 + 15] = std::byte{5};
  ASSERT_EQ(DecodeEvents(extended)->events.size(), 1u);
  EXPECT_EQ(DecodeEvents(extended)->events[0].id, 0x9003);
  EXPECT_EQ(DecodeEvents(extended)->events[0].frame_id, 5u);
  auto with_data = two;
  with_data[3] = std::byte{0xC2};
  EXPECT_EQ(DecodeEvents(with_data)->events.size(), 1u);
  EXPECT_EQ(EncodeEventAcknowledge(*DecodeEvents(with_data))[3], std::byte{0xC3});
  auto other = one;
  other[3] = std::byte{0x81};
  EXPECT_FALSE(DecodeEvents(other).has_value());
}

class Camera {
 public:
  Camera() : socket_(socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    address_.sin_family = AF_INET;
    address_.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof(address_);
    bind(socket_, reinterpret_cast<sockaddr*>(&address_), size);
    getsockname(socket_, reinterpret_cast<sockaddr*>(&address_), &size);
    thread_ = std::thread([this] { Serve(); });
  }
  ~Camera() {
    ending = true;
    thread_.join();
    close(socket_);
  }
  const sockaddr_in& address() const { return address_; }

  std::atomic<bool> silent{false}, refuses{false}, ending{false};
  std::atomic<int> privilege{2}, questions{0};

 private:
  void Serve() {
    while (!ending) {
      pollfd fd{socket_, POLLIN, 0};
      if (poll(&fd, 1, 10) <= 0) continue;
      std::array<unsigned char, 64> packet;
      sockaddr_in from{};
      socklen_t size = sizeof(from);
      if (recvfrom(socket_, packet.data(), packet.size(), 0, reinterpret_cast<sockaddr*>(&from),
                   &size) != 12) {
        continue;
      }
      ++questions;
      if (silent) continue;
      const unsigned char answer[] = {static_cast<unsigned char>(refuses ? 0x80 : 0),
                                      static_cast<unsigned char>(refuses ? 6 : 0),
                                      0,
                                      0x81,
                                      0,
                                      4,
                                      packet[6],
                                      packet[7],
                                      0,
                                      0,
                                      0,
                                      static_cast<unsigned char>(privilege)};
      sendto(socket_, answer, sizeof(answer), 0, reinterpret_cast<sockaddr*>(&from), size);
    }
  }

  int socket_;
  sockaddr_in address_{};
  std::thread thread_;
};

class GvcpWatchTest : public testing::Test {
 protected:
  void Watch(Duration patience) {
    auto watch = GvcpWatch::Start(camera_.address(), patience, [this](const std::string& why) {
      MutexLock lock(&mutex_);
      ++losses_;
      why_ = why;
    });
    ASSERT_TRUE(watch.ok()) << watch.status();
    watch_ = *std::move(watch);
  }
  std::string Why() {
    MutexLock lock(&mutex_);
    return why_;
  }
  bool Becomes(const std::function<bool()>& ready) {
    for (const TimePoint give_up = clock_.Now() + seconds(20); !ready();) {
      if (clock_.Now() > give_up) return false;
      SleepFor(clock_, milliseconds(2));
    }
    return true;
  }

  RealClock clock_;
  Camera camera_;
  Mutex mutex_;
  int losses_ ABSL_GUARDED_BY(mutex_) = 0;
  std::string why_ ABSL_GUARDED_BY(mutex_);
  std::unique_ptr<GvcpWatch> watch_;
};

TEST_F(GvcpWatchTest, AskedAllTheTimeAndSilenceIsALossOnce) {
  Watch(milliseconds(400));
  ASSERT_TRUE(Becomes([&] { return camera_.questions >= 8; }));
  EXPECT_EQ(Why(), "") << "it answers";
  camera_.silent = true;
  ASSERT_TRUE(Becomes([&] { return !Why().empty(); }));
  EXPECT_EQ(Why(), "it has not answered for 0.4 s: is it plugged in?");
  const int questions = camera_.questions;
  SleepFor(clock_, milliseconds(300));
  EXPECT_EQ(camera_.questions, questions) << "it was told; nobody asks any more";
  watch_.reset();
  MutexLock lock(&mutex_);
  EXPECT_EQ(losses_, 1);
}

TEST_F(GvcpWatchTest, FewQuestionsWithoutAnswerAreNone) {
  Watch(milliseconds(2000));
  for (int i = 0; i < 3; ++i) {
    const int before = camera_.questions;
    camera_.silent = true;
    ASSERT_TRUE(Becomes([&] { return camera_.questions >= before + 2; }));
    camera_.silent = false;
    ASSERT_TRUE(Becomes([&] { return camera_.questions >= before + 4; }));
  }
  EXPECT_EQ(Why(), "");
}

TEST_F(GvcpWatchTest, ACameraThatNobodyControlsIsALoss) {
  Watch(seconds(8));
  camera_.refuses = true;  // another's exclusive access: it is there
  ASSERT_TRUE(Becomes([&] { return camera_.questions >= 2; }));
  EXPECT_EQ(Why(), "");
  camera_.refuses = false;
  camera_.privilege = 0;
  ASSERT_TRUE(Becomes([&] { return !Why().empty(); }));
  EXPECT_EQ(Why(), "nobody controls it any more: it was restarted, or let go");
}

}  // namespace
}  // namespace lightstage
