#include "sim/scenes/builder.h"
#include "sim/scenes/shipped.h"

namespace lightstage::sim {

SceneDescription Balls() {
  Builder b;
  PutGround(&b);
  constexpr float kTop = 0.012f;
  b.Put(Box({0, 0.015f, 0.5f * kTop}, {0.150f, 0.110f, 0.5f * kTop}),
        b.Matte(Rgb(0.52f, 0.50f, 0.46f)));
  // They do not touch: a thin shaft of light falls between any two.
  b.PutBall({-0.088f, 0.030f, kTop + 0.044f}, 0.044f, b.Matte(Rgb(0.72f, 0.24f, 0.13f)));
  b.PutBall({0.008f, 0.066f, kTop + 0.044f}, 0.044f, b.Mirror());
  b.PutBall({0.078f, -0.018f, kTop + 0.044f}, 0.044f, b.Glass());
  return b.Take();
}

}  // namespace lightstage::sim
