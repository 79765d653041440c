// A record and a geometry for tests, with values that would show a lost digit or a swapped field.
#pragma once

#include "dataset/shot.h"
#include "optics/rig_geometry.h"

namespace lightstage {

inline ShotRecord TestRecord(uint64_t id) {
  ShotRecord r;
  r.shot.id = id;
  r.shot.pose = {Degrees(5.625), Degrees(0.1)};
  r.shot.condition.lamps = {{7, 0.3}, {9, 1.0}};
  r.shot.exposures = {Duration(500'250), Duration(4'000'001)};
  r.reported_pose = {Degrees(5.6250001), Degrees(0.1000002)};
  r.direction = Vec3(0.6, 0.0, 0.8);
  r.exposures.resize(2);
  r.exposures[1].requested = Duration(4'000'001);
  r.exposures[1].used = Duration(3'999'999);
  r.exposures[1].gain_db = 1.5;
  r.exposures[1].start =
      TimePoint(Duration(9'007'199'254'740'993));  // 2^53 + 1: more than a double holds
  r.exposures[1].end = TimePoint(Duration(9'007'199'254'740'995));
  r.exposures[1].device_timestamp_ns = -5;
  r.exposures[1].frame_sequence = 18'446'744'073'709'551'615u;
  r.checks = {.saturated_share = 0.01,
              .black_share = 0.2,
              .mean = 0.3,
              .maximum = 4.5,
              .nothing_seen = true};
  r.attempts = 2;
  r.lit_at = TimePoint(Duration(123456789));
  r.captured_at = "2004-05-06T07:08:09.123456Z";
  r.file = "basis/000123.exr";
  r.bytes = 987654321;
  r.sha256 = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
  return r;
}

inline RigGeometry TestGeometry() {
  RigGeometry g;
  g.brace.radius = Meters(1);
  g.brace.lamp_radius = Meters(0.02);
  g.brace.lamps = {{Degrees(0), Degrees(2.25)}, {Degrees(180), Degrees(87.75)}};
  g.projector = {.present = true,
                 .distance = Meters(1.5),
                 .azimuth = Degrees(90),
                 .field_of_view = Degrees(20),
                 .width = 912,
                 .height = 1140};
  g.camera = {
      .position = Vec3(2, 0, 0), .look_at = Vec3(0, 0, 0.1), .field_of_view = Degrees(12.5)};
  return g;
}

}  // namespace lightstage
