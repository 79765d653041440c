#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include "sim/scenes/builder.h"
#include "sim/scenes/shipped.h"

namespace lightstage::sim {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;
constexpr float kSquare = 0.030f, kTop = 0.016f, kYaw = 0.38f;
constexpr float kMiddleY = 0.022f;

// Pieces are described in millimetres.
constexpr float kMillimetre = 0.001f;

// What every piece stands on: a foot of radius `r` that runs up to a collar at the height `h`.
std::vector<Vec2f> Stem(float r, float h) {
  return {{r, 0},
          {r, 0},
          {r, 0.30f * r},
          {0.93f * r, 0.42f * r},
          {0.93f * r, 0.42f * r},
          {0.84f * r, 0.50f * r},
          {0.87f * r, 0.64f * r},
          {0.76f * r, 0.80f * r},
          {0.76f * r, 0.80f * r},
          {0.58f * r, 1.05f * r},
          {0.47f * r, 0.5f * h + 0.4f * r},
          {0.40f * r, h},
          {0.40f * r, h},
          {0.62f * r, h + 0.06f * r},
          {0.66f * r, h + 0.15f * r},
          {0.62f * r, h + 0.24f * r},
          {0.42f * r, h + 0.30f * r},
          {0.42f * r, h + 0.30f * r}};
}

Mesh Turned(std::vector<Vec2f> profile, const std::vector<Vec2f>& head) {
  profile.insert(profile.end(), head.begin(), head.end());
  return Lathe(Vec3f::Zero(), Rounded(profile, 5), 72);
}

Mesh King() {
  return Joined({Turned(Stem(13.5f, 52), {{5.6f, 58},
                                          {6.6f, 64},
                                          {9.2f, 75},
                                          {9.7f, 78},
                                          {9.7f, 78},
                                          {9.0f, 79.5f},
                                          {5.0f, 82},
                                          {2.0f, 83},
                                          {2.0f, 83},
                                          {1.8f, 85}}),
                 Box({0, 0, 90}, {1.5f, 1.5f, 6}), Box({0, 0, 91}, {4.6f, 1.45f, 1.5f})});
}

Mesh Queen() {
  std::vector<Mesh> parts = {Turned(Stem(13, 47), {{5.4f, 53},
                                                   {6.0f, 58},
                                                   {9.2f, 71},
                                                   {9.8f, 74},
                                                   {9.8f, 74},
                                                   {8.2f, 73},
                                                   {8.2f, 73},
                                                   {6.4f, 75.5f},
                                                   {3.0f, 77.5f},
                                                   {1.2f, 78}}),
                             Sphere({0, 0, 79.6f}, 2.4f, 32)};
  for (int i = 0; i < 9; ++i) {
    float a = 2 * kPi * static_cast<float>(i) / 9;
    parts.push_back(Sphere({9.0f * std::cos(a), 9.0f * std::sin(a), 74.6f}, 1.5f, 24));
  }
  return Joined(parts);
}

Mesh Bishop() {
  return Joined(
      {Turned(Stem(12, 37),
              {{5.0f, 42}, {7.4f, 47}, {7.9f, 51}, {6.3f, 57}, {3.0f, 62.5f}, {1.5f, 64}}),
       Sphere({0, 0, 65.5f}, 2.3f, 32)});
}

Mesh Rook() {
  std::vector<Mesh> parts = {Turned(Stem(12.5f, 31), {{5.6f, 37},
                                                      {7.0f, 40},
                                                      {9.4f, 42},
                                                      {9.4f, 42},
                                                      {9.4f, 46},
                                                      {9.4f, 46},
                                                      {6.4f, 46},
                                                      {6.4f, 46},
                                                      {6.4f, 43.5f},
                                                      {6.4f, 43.5f}})};
  for (int i = 0; i < 6; ++i) {
    float a = 2 * kPi * static_cast<float>(i) / 6;
    parts.push_back(Box({7.8f * std::cos(a), 7.8f * std::sin(a), 47.4f}, {1.4f, 2.7f, 2.4f}, a));
  }
  return Joined(parts);
}

Mesh Pawn() {
  return Joined({Turned(Stem(10.5f, 23), {{4.0f, 28}}), Sphere({0, 0, 32.5f}, 6.8f, 64)});
}

Mesh Knight() {
  // The neck rises to the poll and comes down to the muzzle, along +X.
  std::vector<Section> head = Rope({{1, 0, 9},
                                    {-1.5f, 0, 17},
                                    {-3.5f, 0, 27},
                                    {-2.0f, 0, 37},
                                    {3.5f, 0, 42},
                                    {8.5f, 0, 38.5f},
                                    {12.5f, 0, 33.5f},
                                    {14.0f, 0, 31.5f}},
                                   1, Vec3f::UnitY());
  constexpr float kHalf[][2] = {{7.5f, 8}, {6, 8},    {5, 7.5f},    {4.6f, 7},
                                {4.4f, 6}, {3.8f, 5}, {3.2f, 4.0f}, {2.4f, 3}};
  for (size_t i = 0; i < head.size(); ++i) {
    head[i].across *= kHalf[i][0];
    head[i].up *= kHalf[i][1];
  }
  std::vector<Mesh> parts = {Turned({{12, 0},
                                     {12, 0},
                                     {12, 3.6f},
                                     {11.2f, 5},
                                     {11.2f, 5},
                                     {10.2f, 6},
                                     {10.5f, 7.7f},
                                     {9.2f, 9.6f}},
                                    {{6, 11}}),
                             Loft(head, 48, 8, 2.4f)};
  for (float side : {-1.0f, 1.0f}) {
    // Ears, and a brow over where the eyes would be.
    parts.push_back(Blob({-1.5f, 2.2f * side, 47.5f}, {1.9f, 1.2f, 4.2f}, 24));
    parts.push_back(Blob({5.0f, 3.4f * side, 42.0f}, {2.2f, 1.5f, 1.5f}, 24));
  }
  // The mane, in locks.
  for (int i = 0; i < 7; ++i) {
    auto f = static_cast<float>(i);
    parts.push_back(Blob({-8.6f - 0.35f * f * (4 - f), 0, 19.5f + 3.6f * f},
                         {2.6f + 0.1f * f, 1.8f, 2.5f}, 24));
  }
  return Joined(parts);
}

Rgb Squares(const SurfacePoint& at) {
  // The board's own axes, in squares.
  const Vec2f q = at.position.head<2>() - Vec2f(0, kMiddleY);
  Vec2f p(std::cos(kYaw) * q.x() + std::sin(kYaw) * q.y(),
          std::cos(kYaw) * q.y() - std::sin(kYaw) * q.x());
  p /= kSquare;
  const float edge = p.cwiseAbs().maxCoeff();
  const Rgb grain = Wood({.position = {p.y() * kSquare, 0.7f * p.x() * kSquare, 0}});
  Rgb dark = Rgb(0.42f, 0.30f, 0.24f) * grain;
  if (edge > 4.05f || at.position.z() < kTop - 0.001f) return dark;
  if (edge > 4) return Rgb::Constant(0.75f) * Rgb(0.8f, 0.62f, 0.4f);  // an inlaid line
  const int parity = static_cast<int>(std::floor(p.x())) + static_cast<int>(std::floor(p.y()));
  return (parity & 1) != 0 ? Rgb(0.25f + 1.05f * grain) : dark;
}

struct Place {
  float file, rank;  // squares from the middle of the board
  float turn = 0;
};

void PutPieces(Builder* b, Mesh piece, int material, const std::vector<Place>& places) {
  const Eigen::AngleAxisf board(kYaw, Vec3f::UnitZ());
  for (const Place& place : places) {
    Eigen::Affine3f pose(Eigen::Translation3f(0, kMiddleY, kTop) * board *
                         Eigen::Translation3f(kSquare * place.file, kSquare * place.rank, 0) *
                         Eigen::AngleAxisf(place.turn, Vec3f::UnitZ()) *
                         Eigen::UniformScaling<float>(kMillimetre));
    piece.placements.push_back(pose);
  }
  b->Put(std::move(piece), material);
}

}  // namespace

SceneDescription Chess() {
  Builder b;
  PutGround(&b);
  b.Put(Box({0, kMiddleY, 0.5f * kTop}, {4.5f * kSquare, 4.5f * kSquare, 0.5f * kTop}, kYaw),
        b.Add({.diffuse = Rgb::Ones(),
               .specular = Rgb::Constant(0.04f),
               .roughness = 0.3f,
               .texture = Squares}));
  const int white = b.Plastic(Rgb(0.76f, 0.62f, 0.40f), 0.22f);
  const int black = b.Plastic(Rgb(0.055f, 0.030f, 0.022f), 0.18f);
  PutPieces(&b, King(), white, {{0.5f, -2.5f, 0.3f}});
  PutPieces(&b, King(), black, {{1.5f, 2.5f, 0.2f}});
  PutPieces(&b, Queen(), white, {{-0.5f, -1.5f}});
  PutPieces(&b, Queen(), black, {{-1.5f, 2.5f}});
  PutPieces(&b, Bishop(), white, {{2.5f, -1.5f}});
  PutPieces(&b, Bishop(), black, {{0.5f, 1.5f}, {-2.5f, 0.5f}});
  PutPieces(&b, Knight(), white, {{1.5f, 0.5f, 1.2f}, {-2.5f, -1.5f, 0.2f}});
  PutPieces(&b, Knight(), black, {{-0.5f, 0.5f, -2.6f}});
  PutPieces(&b, Rook(), white, {{3.5f, -3.5f}, {-1.5f, -3.5f}});
  PutPieces(&b, Rook(), black, {{3.5f, 3.5f}, {-3.5f, 2.5f}});
  PutPieces(&b, Pawn(), white,
            {{3.5f, -1.5f}, {1.5f, -2.5f}, {0.5f, -0.5f}, {-3.5f, -2.5f}, {-1.5f, -0.5f}});
  PutPieces(&b, Pawn(), black, {{3.5f, 1.5f}, {2.5f, 1.5f}, {-3.5f, 1.5f}, {2.5f, 0.5f}});
  return b.Take();
}

}  // namespace lightstage::sim
