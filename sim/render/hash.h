// Counter-based randomness: a number is a pure function of what it is for, so that results depend neither on order nor on threads.
#pragma once

#include <bit>
#include <cstdint>

namespace lightstage::sim {

// The finalizer of splitmix64 (Steele, Lea, Flood 2014): every input bit reaches every output bit.
constexpr uint64_t Mix(uint64_t x) {
  x += 0x9e3779b97f4a7c15u;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
  return x ^ (x >> 31);
}

// Folds `value` into a running hash.
constexpr uint64_t Fold(uint64_t hash, uint64_t value) { return Mix(hash ^ Mix(value)); }
constexpr uint64_t Fold(uint64_t hash, double value) {
  return Fold(hash, std::bit_cast<uint64_t>(value + 0.0));  // −0 becomes 0
}

// [0, 1) from the upper bits of a hash.
constexpr float UnitFloat(uint64_t hash) { return static_cast<float>(hash >> 40) * 0x1p-24f; }

}  // namespace lightstage::sim
