#include "relight/dataset_reader.h"

#include "base/status.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "relight/test_dataset.h"

namespace lightstage::relight {
namespace {

using ::testing::HasSubstr;

TEST(Dataset, KeepsBasisImagesAndReadsThem) {
  const std::string folder = TestFolder();
  std::vector<ShotRecord> records = {SphereRecord(0, std::nullopt), SphereRecord(1, Vec3::UnitX())};
  records[0].shot.kind = ShotKind::kDark;
  const BasisImage image = SphereImage(Vec3::UnitX(), 1, {1, 0.5, 0.25});
  WriteImage(folder, records[1], image);
  WriteManifest(folder, records, 3);
  auto dataset = Dataset::Open(folder);
  ASSERT_TRUE(dataset.ok()) << dataset.status();
  ASSERT_EQ(dataset->basis().size(), 1u);
  EXPECT_EQ(dataset->basis()[0].shot.id, 1u);
  auto read = dataset->Read(dataset->basis()[0]);
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_NEAR(read->pixels.at(16, 16, 1), image.pixels.at(16, 16, 1), 1e-3);
  EXPECT_EQ(read->flags, image.flags);
}

TEST(Dataset, SaysWhatIsWrong) {
  const std::string folder = TestFolder();
  EXPECT_EQ(ErrorReason(Dataset::Open(folder).status()), "DATASET_NOT_FOUND");

  std::vector<ShotRecord> records = {SphereRecord(0, Vec3::UnitZ())};
  records[0].shot.kind = ShotKind::kReference;
  WriteManifest(folder, records, 3);
  EXPECT_EQ(ErrorReason(Dataset::Open(folder).status()), "DATASET_EMPTY");

  records[0].shot.kind = ShotKind::kBasis;
  WriteManifest(folder, records, 3);
  absl::Status missing = Dataset::Open(folder).status();
  EXPECT_EQ(missing.code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(std::string(missing.message()), HasSubstr("basis_0.exr"));

  WriteImage(folder, records[0], SphereImage(Vec3::UnitZ(), 1, {1}));  // grey, not RGB
  absl::Status other = Dataset::Open(folder).status();
  EXPECT_EQ(ErrorReason(other), "DATASET_INCONSISTENT");
  EXPECT_THAT(std::string(other.message()), HasSubstr("1 channels"));

  ASSERT_TRUE(PosixEnv().WriteFile(folder + "/manifest.json", "{\"format\": ").ok());
  EXPECT_EQ(ErrorReason(Dataset::Open(folder).status()), "MANIFEST_CORRUPT");
}

}  // namespace
}  // namespace lightstage::relight
