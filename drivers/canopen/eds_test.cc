#include "drivers/canopen/eds.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "base/status.h"

namespace lightstage::canopen {
namespace {

using testing::HasSubstr;

// As makers write them: comments, CRLF, hexadecimal, octal and node-dependent numbers, sections in any case.
constexpr char kSheet[] =
    "; an "
    "example\r\n[FileInfo]\r\nFileName=drive.eds\r\n[DeviceInfo]\r\nVendorNumber=0x0000006A\r\n"
    "ProductNumber=20\r\n\r\n[1000]\r\nParameterName=Device Type\r\nObjectType=0x7\r\n"
    "DataType=0x0007\r\nAccessType=ro\r\nDefaultValue=0x00020192\r\nPDOMapping=0\r\n"
    "[1016]\nParameterName=Consumer Heartbeat Time\nObjectType=0x8\nSubNumber=2\n"
    "[1016Sub1]\nParameterName=Entry 1\nDataType=0x0007\nAccessType=rw\nLowLimit=\nHighLimit=\n"
    "[1800sub1]\nParameterName=COB-ID\nDataType=0x0007\nAccessType=rw\n"
    "DefaultValue=$NODEID+0x180\n[6099]\nCompactSubObj=2\nParameterName=Homing Speeds\n"
    "DataType=0x7\nAccessType=rw\nLowLimit=010\nHighLimit=0x1000\n"
    "[607A]\nParameterName=Target Position\nDataType=0x0004\nAccessType=rww\n"
    "LowLimit=0x80000000\nHighLimit=0x7FFFFFFF\n[1008]\nDataType=0x0009\nAccessType=const\n"
    "DefaultValue=A name\n";

TEST(Eds, ReadsWhatMakersWrite) {
  absl::StatusOr<Eds> eds = Eds::Parse(kSheet, "drive.eds", 5);
  ASSERT_TRUE(eds.ok()) << eds.status();
  EXPECT_EQ(eds->vendor(), 0x6Au);
  EXPECT_EQ(eds->product(), 20u);
  const EdsObject* type = eds->Find({0x1000, 0});
  ASSERT_NE(type, nullptr);
  EXPECT_EQ(type->name, "Device Type");
  EXPECT_FALSE(type->writable);
  EXPECT_EQ(type->standard, 0x20192);
  EXPECT_EQ(eds->Find({0x1800, 1})->standard, 0x185) << "$NODEID";
  EXPECT_EQ(eds->Find({0x607A, 0})->low, INT32_MIN) << "a bit pattern of a signed object";
  EXPECT_EQ(eds->Find({0x607A, 0})->high, INT32_MAX);
  ASSERT_NE(eds->Find({0x6099, 2}), nullptr) << "CompactSubObj";
  EXPECT_EQ(eds->Find({0x6099, 2})->low, 8) << "octal";
  EXPECT_EQ(eds->Find({0x6099, 3}), nullptr);
  EXPECT_EQ(eds->Find({0x1016, 1})->high, std::nullopt);
  EXPECT_EQ(eds->Find({0x1008, 0})->standard, std::nullopt) << "no number";
}

TEST(Eds, WritesAreCheckedAgainstIt) {
  absl::StatusOr<Eds> eds = Eds::Parse(kSheet, "drive.eds", 5);
  ASSERT_TRUE(eds.ok()) << eds.status();
  EXPECT_TRUE(eds->CheckWrite({0x6099, 1}, 8).ok());
  EXPECT_TRUE(eds->CheckWrite({0x6099, 1}, 0x1000).ok());
  EXPECT_TRUE(eds->CheckWrite({0x607A, 0}, -5).ok());
  EXPECT_TRUE(eds->CheckWrite({0x1016, 1}, 0xFFFFFFFF).ok());
  const absl::Status high = eds->CheckWrite({0x6099, 1}, 0x1001);
  EXPECT_EQ(ErrorReason(high), "OBJECT_LIMIT");
  EXPECT_EQ(high.code(), absl::StatusCode::kOutOfRange);
  EXPECT_THAT(std::string(high.message()), HasSubstr("from 8 to 4096"));
  EXPECT_EQ(ErrorReason(eds->CheckWrite({0x6099, 1}, 7)), "OBJECT_LIMIT");
  EXPECT_EQ(ErrorReason(eds->CheckWrite({0x1000, 0}, 1)), "OBJECT_READ_ONLY");
  EXPECT_EQ(ErrorReason(eds->CheckWrite({0x6007, 0}, 1)), "OBJECT_MISSING");
}

TEST(Eds, MistakesAreSaidWithTheirLine) {
  const struct {
    const char *text, *said;
  } mistakes[] = {
      {"", "no [DeviceInfo]"},
      {"[DeviceInfo]\n", "no objects"},
      {"key=1\n[DeviceInfo]\n", "x.eds:1:"},
      {"[DeviceInfo]\n[1000]\nnonsense\n", "x.eds:3:"},
      {"[DeviceInfo]\n[1000]\n=7\n", "x.eds:3:"},
      {"[DeviceInfo]\n[1000\n", "x.eds:2:"},
      {"[DeviceInfo]\n[1000]\n[1000]\n", "given twice, first in line 2"},
      {"[DeviceInfo]\n[1000]\nDataType=7\ndatatype=7\n", "given twice, first in line 3"},
      {"[DeviceInfo]\n[1000]\nDataType=seven\n", "x.eds:3: datatype = seven"},
      {"[DeviceInfo]\n[1000]\nDataType=7\nAccessType=rx\n", "accesstype = rx"},
      {"[DeviceInfo]\n[1000]\nDataType=7\nHighLimit=08\n", "x.eds:4:"},
      {"[DeviceInfo]\n[1000]\nDataType=7\nHighLimit=$NODEID-1\n", "x.eds:4:"},
      {"[DeviceInfo]\n[1000]\nDataType=7\nLowLimit=2\nHighLimit=1\n", "above"},
      {"[DeviceInfo]\n[1000]\nDataType=99999999999999999999\n", "x.eds:3:"},
      {"[DeviceInfo]\nVendorNumber=0x100000001\n[1000]\n", "x.eds:2: vendornumber"},
      {"[DeviceInfo]\nProductNumber=-1\n[1000]\n", "x.eds:2: productnumber"},
  };
  for (const auto& mistake : mistakes) {
    const absl::Status status = Eds::Parse(mistake.text, "x.eds", 5).status();
    EXPECT_EQ(ErrorReason(status), "EDS_INVALID") << mistake.text;
    EXPECT_THAT(std::string(status.message()), HasSubstr(mistake.said)) << mistake.text;
  }
}

TEST(Eds, TakesAnyBytes) {
  std::minstd_rand random(11);
  for (int round = 0; round < 2000; ++round) {
    std::string text = kSheet;
    for (int i = 0; i < 5; ++i) text[random() % text.size()] = static_cast<char>(random());
    text.resize(random() % text.size());
    Eds::Parse(text, "x.eds", 5).status().IgnoreError();
  }
}

}  // namespace
}  // namespace lightstage::canopen
