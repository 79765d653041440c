// What goes over the wire, against frames that makers' manuals print. Cited as: [AKD] Kollmorgen, AKD CANopen Communication, edition H
// (November 2012), p. 145, homing; [Festo] GDCP-CMMS/D-C-CO-EN 1404NH, p. 20; [Baumueller] b maXX 1000 parameter manual
// 5.07004.03, p. 181; [ICP DAS] CAN-8x23 user's manual 3.20, p. 72 (segments), p. 100 (abort), CAN-8123 manual 3.00, pp. 145, 147
// (emergencies), p. 164; [esd] CAN-CBX-REL4 manual C.3012.21, p. 67; [AKD2G] Kollmorgen's page on 1600h to 1603h.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "drivers/canopen/cia402.h"
#include "drivers/canopen/messages.h"
#include "drivers/canopen/sdo.h"
#include "drivers/canopen/socket_can.h"

namespace lightstage::canopen {
namespace {

using testing::ElementsAre;
using Kind = SdoReply::Kind;

SdoReply Decode(std::vector<uint8_t> bytes) { return DecodeSdoReply(bytes); }
std::vector<uint8_t> Bytes(std::span<const uint8_t> bytes) { return {bytes.begin(), bytes.end()}; }

// ---- SDO

TEST(Sdo, ExpeditedWrites) {
  const uint8_t homing[] = {6}, enable[] = {0x0F, 0}, five[] = {5};
  const uint8_t word[] = {0xE8, 0x03}, number[] = {0x78, 0x56, 0x34, 0x12};
  // [AKD]
  EXPECT_THAT(EncodeDownload({0x6060, 0}, homing), ElementsAre(0x2F, 0x60, 0x60, 0, 6, 0, 0, 0));
  EXPECT_THAT(EncodeDownload({0x6040, 0}, enable), ElementsAre(0x2B, 0x40, 0x60, 0, 0x0F, 0, 0, 0));
  // [Baumueller]
  EXPECT_THAT(EncodeDownload({0x6060, 0}, five), ElementsAre(0x2F, 0x60, 0x60, 0, 5, 0, 0, 0));
  // [Festo]
  EXPECT_THAT(EncodeDownload({0x6040, 0}, word), ElementsAre(0x2B, 0x40, 0x60, 0, 0xE8, 3, 0, 0));
  EXPECT_THAT(EncodeDownload({0x6093, 1}, number),
              ElementsAre(0x23, 0x93, 0x60, 1, 0x78, 0x56, 0x34, 0x12));
  // [ICP DAS] p. 164
  const uint8_t one[] = {1};
  EXPECT_THAT(EncodeDownload({0x2007, 1}, one), ElementsAre(0x2F, 0x07, 0x20, 1, 1, 0, 0, 0));
  // [AKD], [ICP DAS] p. 164: confirmed
  EXPECT_EQ(Decode({0x60, 0x40, 0x60, 0, 0, 0, 0, 0}).kind, Kind::kDownload);
  EXPECT_EQ(Decode({0x60, 0x07, 0x20, 1, 0, 0, 0, 0}).object, (ObjectAddress{0x2007, 1}));
}

TEST(Sdo, ExpeditedReads) {
  // [AKD], [Festo], [ICP DAS] p. 145
  EXPECT_THAT(EncodeUpload({0x6041, 0}), ElementsAre(0x40, 0x41, 0x60, 0, 0, 0, 0, 0));
  EXPECT_THAT(EncodeUpload({0x1003, 1}), ElementsAre(0x40, 0x03, 0x10, 1, 0, 0, 0, 0));
  const struct {
    std::vector<uint8_t> frame;
    ObjectAddress object;
    uint32_t value;
  } answers[] = {
      {{0x4B, 0x41, 0x60, 0, 0x37, 0x16, 0, 0}, {0x6041, 0}, 0x1637},  // [AKD]: homing finished
      {{0x4F, 0x61, 0x60, 0, 0x01, 0, 0, 0}, {0x6061, 0}, 1},          // [Festo]
      {{0x4B, 0x41, 0x60, 0, 0x34, 0x12, 0, 0}, {0x6041, 0}, 0x1234},
      {{0x43, 0x93, 0x60, 1, 0x78, 0x56, 0x34, 0x12}, {0x6093, 1}, 0x12345678},
      {{0x43, 0x03, 0x10, 1, 0x10, 0x82, 0x09, 0}, {0x1003, 1}, 0x00098210},  // [ICP DAS]
  };
  for (const auto& answer : answers) {
    const SdoReply reply = DecodeSdoReply(answer.frame);
    EXPECT_EQ(reply.kind, Kind::kUpload);
    EXPECT_EQ(reply.object, answer.object);
    EXPECT_EQ(LittleEndian(reply.bytes()), answer.value);
  }
  EXPECT_EQ(Decode({0x42, 0x41, 0x60, 0, 1, 2, 3, 4}).size, 4) << "expedited without a size";
}

TEST(Sdo, SegmentsCarryADeviceName) {
  EXPECT_THAT(EncodeUploadSegment(false),
              ElementsAre(0x60, 0, 0, 0, 0, 0, 0, 0));  // [ICP DAS] p. 72
  EXPECT_THAT(EncodeUploadSegment(true), ElementsAre(0x70, 0, 0, 0, 0, 0, 0, 0));
  // [ICP DAS] p. 72
  const SdoReply piece = Decode({0x00, 0x43, 0x41, 0x4E, 0x2D, 0x38, 0x34, 0x32});
  EXPECT_EQ(piece.kind, Kind::kUploadSegment);
  EXPECT_FALSE(piece.toggle);
  EXPECT_FALSE(piece.last);
  EXPECT_EQ(std::string(piece.bytes().begin(), piece.bytes().end()), "CAN-842");
  // Command bits as CiA 301 7.2.4.3.6 has them: toggle, 6 bytes without data, last.
  const SdoReply last = Decode({0x1D, 0x33, 0, 0, 0, 0, 0, 0});
  EXPECT_TRUE(last.toggle);
  EXPECT_TRUE(last.last);
  EXPECT_EQ(std::string(last.bytes().begin(), last.bytes().end()), "3");
  const SdoReply begin = Decode({0x41, 0x08, 0x10, 0, 8, 0, 0, 0});
  EXPECT_EQ(begin.kind, Kind::kUploadBegin);
  EXPECT_EQ(begin.total, 8u);
}

TEST(Sdo, SegmentedWrites) {
  const std::vector<uint8_t> eight(8, 0xAA);
  EXPECT_THAT(EncodeDownload({0x1F50, 1}, eight), ElementsAre(0x21, 0x50, 0x1F, 1, 8, 0, 0, 0));
  EXPECT_THAT(EncodeDownloadSegment(false, std::span(eight).first(7), false),
              ElementsAre(0x00, 0xAA, 0xAA, 0xAA, 0xAA, 0xAA, 0xAA, 0xAA));
  EXPECT_THAT(EncodeDownloadSegment(true, std::span(eight).first(1), true),
              ElementsAre(0x1D, 0xAA, 0, 0, 0, 0, 0, 0));
  const SdoReply taken = Decode({0x30, 0, 0, 0, 0, 0, 0, 0});
  EXPECT_EQ(taken.kind, Kind::kDownloadSegment);
  EXPECT_TRUE(taken.toggle);
}

TEST(Sdo, AbortsAreNamed) {
  // [ICP DAS] p. 100
  const SdoReply abort = Decode({0x80, 0x08, 0x10, 1, 0x11, 0x00, 0x09, 0x06});
  EXPECT_EQ(abort.kind, Kind::kAbort);
  EXPECT_EQ(abort.object, (ObjectAddress{0x1008, 1}));
  EXPECT_EQ(abort.abort, 0x06090011u);
  EXPECT_EQ(SdoAbortName(abort.abort), "sub-index does not exist");
  EXPECT_EQ(SdoAbortName(0x06010002), "attempt to write a read-only object");
  EXPECT_EQ(SdoAbortName(0x12345678), "unknown abort code");
  EXPECT_THAT(EncodeAbort({0x6041, 0}, kAbortTimeout),
              ElementsAre(0x80, 0x41, 0x60, 0, 0, 0, 0x04, 0x05));
}

TEST(Sdo, ShortOrStrangeAnswersAreUnknown) {
  EXPECT_EQ(Decode({}).kind, Kind::kUnknown);
  EXPECT_EQ(Decode({0x43, 0x41, 0x60}).kind, Kind::kUnknown);
  EXPECT_EQ(Decode({0x43, 0x41, 0x60, 0, 1, 2, 3}).kind, Kind::kUnknown) << "4 bytes, 3 there";
  EXPECT_EQ(Decode({0x80, 0x41, 0x60, 0, 1}).kind, Kind::kUnknown);
  EXPECT_EQ(Decode({0xC2, 0x41, 0x60, 0, 1, 2, 3, 4}).kind, Kind::kUnknown) << "block upload";
  EXPECT_EQ(Decode({0xFF, 0, 0, 0, 0, 0, 0, 0}).kind, Kind::kUnknown);
}

TEST(Sdo, IntegersHaveSigns) {
  const uint8_t bytes[] = {0xFE, 0xFF, 0xFF, 0xFF};
  for (size_t size : {1, 2, 3, 4}) {
    EXPECT_EQ(SignedLittleEndian(std::span(bytes).first(size)), -2) << size;
  }
  EXPECT_EQ(LittleEndian(std::span(bytes).first(2)), 0xFFFEu);
  EXPECT_EQ(SignedLittleEndian({}), 0);
}

// ---- The other services

TEST(Messages, NmtHeartbeatAndSync) {
  EXPECT_EQ(FrameText(EncodeNmt(NmtCommand::kStart, 3)), "000 01 03");
  EXPECT_EQ(FrameText(EncodeNmt(NmtCommand::kPreOperational, 0)), "000 80 00");
  EXPECT_EQ(FrameText(EncodeHeartbeat(127, NmtState::kOperational)), "77F 05");
  EXPECT_EQ(FrameText(EncodeSync()), "080");
  const uint8_t boot[] = {0}, guarded[] = {0x85}, strange[] = {0x33};
  EXPECT_EQ(DecodeHeartbeat(boot), NmtState::kBootUp);
  EXPECT_EQ(DecodeHeartbeat(guarded), NmtState::kOperational) << "node guarding's toggle bit";
  EXPECT_EQ(DecodeHeartbeat(strange), std::nullopt);
  EXPECT_EQ(DecodeHeartbeat({}), std::nullopt);
  EXPECT_EQ(ConsumerHeartbeat(0x31, 1000), 0x003103E8u);  // [esd]
}

TEST(Messages, EmergenciesAreNamed) {
  // The error register in [ICP DAS] p. 145's case is 11h, its field 1003h keeps code 8210h.
  const uint8_t length[] = {0x10, 0x82, 0x11, 0x09, 0, 0, 0, 0};
  const std::optional<Emergency> emergency = DecodeEmergency(length);
  ASSERT_TRUE(emergency.has_value());
  EXPECT_EQ(emergency->code, 0x8210);
  EXPECT_EQ(emergency->error_register, 0x11);
  EXPECT_EQ(EmergencyText(*emergency),
            "emergency 8210h (PDO not processed due to length error), vendor's bytes 09 00 00 00 "
            "00");
  const uint8_t gone[8] = {};  // [ICP DAS] p. 147: error reset
  EXPECT_EQ(DecodeEmergency(gone)->code, 0);
  EXPECT_FALSE(DecodeEmergency(std::span(gone).first(7)).has_value());
  EXPECT_EQ(EmergencyName(0x8130), "life guard or heartbeat error");
  EXPECT_EQ(EmergencyName(0x2310), "current, device output side");
  EXPECT_EQ(EmergencyName(0x2F00), "current");
  EXPECT_EQ(EmergencyName(0xFF42), "device specific");
  EXPECT_EQ(EmergencyName(0xA000), "unknown");
}

TEST(Messages, PdosFollowTheirMapping) {
  // [AKD2G]
  EXPECT_EQ(EncodeMapping({{0x6040, 0}, 16}), 0x60400010u);
  EXPECT_EQ(EncodeMapping({{0x607A, 0}, 32}), 0x607A0020u);
  EXPECT_EQ(DecodeMapping(0x607A0020), (MappedObject{{0x607A, 0}, 32}));

  const MappedObject mapping[] = {{{0x6041, 0}, 16}, {{0x6064, 0}, 32}};
  const uint8_t frame[] = {0x37, 0x16, 0x18, 0xFC, 0xFF, 0xFF};
  EXPECT_THAT(*UnpackPdo(frame, mapping), ElementsAre(0x1637u, 0xFFFFFC18u));
  EXPECT_EQ(UnpackPdo(std::span(frame).first(5), mapping), std::nullopt) << "too short";
  EXPECT_EQ(Bytes(*PackPdo(std::vector<uint32_t>{0x1637, 0xFFFFFC18}, mapping)), Bytes(frame));
  EXPECT_EQ(PackPdo(std::vector<uint32_t>{0x11637, 0}, mapping), std::nullopt) << "17 bits";
  EXPECT_EQ(PackPdo(std::vector<uint32_t>{1}, mapping), std::nullopt);

  // Bits that do not end with bytes: 3 and 13.
  const MappedObject odd[] = {{{0x2000, 1}, 3}, {{0x2000, 2}, 13}};
  EXPECT_THAT(*PackPdo(std::vector<uint32_t>{5, 0x1001}, odd), ElementsAre(0x0D, 0x80));
  const uint8_t packed[] = {0x0D, 0x80};
  EXPECT_THAT(*UnpackPdo(packed, odd), ElementsAre(5u, 0x1001u));
  const MappedObject wide[] = {{{0x2000, 0}, 64}}, none[] = {{{0x2000, 0}, 0}};
  const uint8_t eight[8] = {};
  EXPECT_EQ(UnpackPdo(eight, wide), std::nullopt);
  EXPECT_EQ(UnpackPdo(eight, none), std::nullopt);
}

// ---- CiA 402

TEST(Cia402, StatuswordsOfARealHoming) {
  // [AKD]: before, enabled, running, finished
  EXPECT_EQ(DecodeStatusword(0x0240), DriveState::kSwitchOnDisabled);
  EXPECT_EQ(DecodeStatusword(0x0237), DriveState::kOperationEnabled);
  EXPECT_EQ(DecodeHoming(0x0237), HomingState::kRunning);
  EXPECT_EQ(DecodeHoming(0x1637), HomingState::kDone);
}

TEST(Cia402, EveryStatuswordIsAtMostOneState) {
  int known = 0;
  for (int low = 0; low < 0x80; ++low) {
    const auto state = DecodeStatusword(static_cast<uint16_t>(low));
    if (!state.has_value()) continue;
    ++known;
    // What the standard leaves open must not count.
    EXPECT_EQ(DecodeStatusword(static_cast<uint16_t>(low | 0xFF90)), state) << low;
  }
  EXPECT_EQ(known, 4 * 4 + 4 * 2) << "four states leave bits 4 and 5 open, four bit 4 only";
  EXPECT_EQ(DecodeStatusword(0x07), DriveState::kQuickStopActive);
  EXPECT_EQ(DecodeStatusword(0x2F), DriveState::kFaultReaction);
  EXPECT_EQ(DecodeStatusword(0x0F), DriveState::kFaultReaction);
  EXPECT_EQ(DecodeStatusword(0x18), DriveState::kFault);
  EXPECT_EQ(DecodeStatusword(0x01), std::nullopt);
}

TEST(Cia402, ControlwordsLeadToOperationEnabled) {
  EXPECT_EQ(StepToOperationEnabled(DriveState::kSwitchOnDisabled), 0x06);  // [AKD]
  EXPECT_EQ(StepToOperationEnabled(DriveState::kReadyToSwitchOn), 0x07);
  EXPECT_EQ(StepToOperationEnabled(DriveState::kSwitchedOn), 0x0F);
  EXPECT_EQ(StepToOperationEnabled(DriveState::kQuickStopActive), 0x00);
  for (DriveState state : {DriveState::kNotReady, DriveState::kOperationEnabled,
                           DriveState::kFaultReaction, DriveState::kFault}) {
    EXPECT_EQ(StepToOperationEnabled(state), std::nullopt) << DriveStateName(state);
  }
  EXPECT_EQ(kControlEnable | kControlStartHoming, 0x1F);  // [AKD]
}

TEST(Cia402, HomingStates) {
  EXPECT_EQ(DecodeHoming(0x0400), HomingState::kNotStarted);
  EXPECT_EQ(DecodeHoming(0x1000), HomingState::kAttained);
  EXPECT_EQ(DecodeHoming(0x2000), HomingState::kErrorMoving);
  EXPECT_EQ(DecodeHoming(0x2400), HomingState::kError);
  EXPECT_EQ(DecodeHoming(0x3400), HomingState::kReserved);
}

TEST(Cia402, ProfilesAreNamed) {
  EXPECT_EQ(ProfileText(0x00020192), "a CiA 402 drive (device type 00020192h)");
  EXPECT_EQ(ProfileText(0x00030191), "a CiA 401 I/O module (device type 00030191h)");
  EXPECT_EQ(ProfileText(0x00000196), "a CiA 406 device (device type 00000196h)");
  EXPECT_EQ(ProfileText(0), "a device without a profile (device type 00000000h)");
}

// ---- The kernel's error frames (linux/can/error.h)

TEST(SocketCan, ErrorFramesTellTheControllersState) {
  const auto decode = [](uint32_t id, std::vector<uint8_t> data) {
    return DecodeErrorFrame(id, data);
  };
  constexpr uint32_t kErr = 0x20000000;
  EXPECT_EQ(decode(kErr | 0x40, std::vector<uint8_t>(8)).state, CanState::kBusOff);
  EXPECT_EQ(decode(kErr | 0x100, std::vector<uint8_t>(8)).state, CanState::kActive);
  EXPECT_EQ(decode(kErr | 0x04, {0, 0x08, 0, 0, 0, 0, 96, 0}).state, CanState::kWarning);
  EXPECT_EQ(decode(kErr | 0x04, {0, 0x20, 0, 0, 0, 0, 128, 0}).state, CanState::kPassive);
  EXPECT_EQ(decode(kErr | 0x04, {0, 0x40, 0, 0, 0, 0, 0, 0}).state, CanState::kActive);
  EXPECT_EQ(decode(kErr | 0x44, {0, 0x30, 0, 0, 0, 0, 0, 0}).state, CanState::kBusOff)
      << "the worst counts";
  EXPECT_EQ(decode(kErr | 0x20, std::vector<uint8_t>(8)).state, std::nullopt);
  EXPECT_EQ(decode(kErr | 0x20, {}).text, "no acknowledge on transmission");
  EXPECT_EQ(decode(kErr | 0x04, {}).state, std::nullopt) << "nothing there to read";
  EXPECT_EQ(decode(kErr | 0x04, {0, 0x01, 0, 0, 0, 0, 0, 0}).text,
            "buffer overflow: frames were lost");
}

// What comes from outside may be anything.
TEST(Decoders, TakeAnyBytes) {
  std::minstd_rand random(7);
  const MappedObject mapping[] = {{{0x6041, 0}, 16}, {{0x6064, 0}, 32}};
  for (int round = 0; round < 20000; ++round) {
    std::vector<uint8_t> bytes(random() % 10);
    for (uint8_t& byte : bytes) byte = static_cast<uint8_t>(random());
    const SdoReply reply = DecodeSdoReply(bytes);
    EXPECT_LE(reply.size, 7);
    DecodeHeartbeat(bytes);
    DecodeEmergency(bytes);
    UnpackPdo(bytes, mapping);
    DecodeErrorFrame(static_cast<uint32_t>(random()), bytes);
  }
}

}  // namespace
}  // namespace lightstage::canopen
