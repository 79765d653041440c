#include "optics/rig_geometry.h"

#include "gtest/gtest.h"

namespace lightstage {
namespace {

void ExpectNear(const Vec3& a, const Vec3& b, double tolerance = 1e-12) {
  EXPECT_LT((a - b).norm(), tolerance) << a.transpose() << " vs " << b.transpose();
}

TEST(Direction, FollowsTheConventionOfMethodPage) {
  ExpectNear(DirectionFromAngles(Degrees(0), Degrees(0)), Vec3::UnitZ());
  ExpectNear(DirectionFromAngles(Degrees(0), Degrees(90)), Vec3::UnitX());
  ExpectNear(DirectionFromAngles(Degrees(90), Degrees(90)), Vec3::UnitY());
  for (double azimuth : {0.0, 10.0, 179.0, 300.0}) {
    for (double tilt : {1.0, 45.0, 120.0}) {
      AzimuthTilt back =
          AnglesOfDirection(3.0 * DirectionFromAngles(Degrees(azimuth), Degrees(tilt)));
      EXPECT_NEAR(back.azimuth.degrees(), azimuth, 1e-9);
      EXPECT_NEAR(back.tilt.degrees(), tilt, 1e-9);
    }
  }
  EXPECT_EQ(AnglesOfDirection(-Vec3::UnitZ()).azimuth.degrees(), 0);
}

TEST(LookAt, SeenFromTheSideTheHorizonIsLevel) {
  ViewFrame f = LookAt({2, 0, 0}, Vec3::Zero());
  ExpectNear(f.forward, {-1, 0, 0});
  ExpectNear(f.down, {0, 0, -1});
  ExpectNear(f.right, {0, 1, 0});  // facing west, north is on the right
}

TEST(LookAt, IsOrthonormalAndRightHanded) {
  for (double tilt : {0.0, 1e-7, 30.0, 90.0, 150.0, 180.0}) {
    ViewFrame f = LookAt(DirectionFromAngles(Degrees(70), Degrees(tilt)), {0, 0, 0}, Degrees(70));
    ExpectNear(f.right.cross(f.down), f.forward);
    EXPECT_NEAR(f.right.norm(), 1, 1e-12);
    EXPECT_NEAR(f.down.dot(f.forward), 0, 1e-12);
  }
}

TEST(LookAt, PassesToThePolesWithoutAFlip) {
  for (double azimuth : {0.0, 45.0, 200.0}) {
    for (double pole : {0.0, 180.0}) {
      double near_pole = pole == 0 ? 1e-3 : 180 - 1e-3;
      ViewFrame at = LookAt(DirectionFromAngles(Degrees(azimuth), Degrees(pole)), Vec3::Zero(),
                            Degrees(azimuth));
      ViewFrame beside = LookAt(DirectionFromAngles(Degrees(azimuth), Degrees(near_pole)),
                                Vec3::Zero(), Degrees(azimuth));
      ExpectNear(at.down, beside.down, 1e-4);
      ExpectNear(at.right, beside.right, 1e-4);
    }
  }
}

// Turning the table by α turns everything that stands in the world by −α in the object frame.
TEST(ProjectorFrame, TurnsAgainstTheTable) {
  ProjectorGeometry projector;
  projector.present = true;
  projector.distance = Meters(1.5);
  projector.azimuth = Degrees(20);
  for (double tilt : {0.0, 30.0, 90.0}) {
    ViewFrame still = ProjectorFrame(projector, {Degrees(0), Degrees(tilt)});
    ViewFrame turned = ProjectorFrame(projector, {Degrees(50), Degrees(tilt)});
    ExpectNear(turned.position, RotateAboutZ(still.position, Degrees(-50)));
    ExpectNear(turned.right, RotateAboutZ(still.right, Degrees(-50)));
    ExpectNear(turned.down, RotateAboutZ(still.down, Degrees(-50)));
    EXPECT_NEAR(turned.position.norm(), 1.5, 1e-12);
  }
}

TEST(LampDirection, TurnsAgainstTheTable) {
  ExpectNear(LampDirection({Degrees(90), Degrees(90)}, Degrees(90)), Vec3::UnitX());
}

}  // namespace
}  // namespace lightstage
