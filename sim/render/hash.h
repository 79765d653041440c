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

// One of the n! orders of 0 … n−1, chosen by `key`: where i goes. Odd factors and shifted exclusive ors go round within the next power of
// two, each of which can be undone, until the way leads inside (Black and Rogaway, "Ciphers with Arbitrary Finite Domains", 2002).
// n ≤ 2³⁰.
constexpr uint32_t Permute(uint32_t i, uint32_t n, uint64_t key) {
  if (n < 2) return 0;
  const int bits = std::bit_width(n - 1), shift = (bits + 1) / 2;
  const uint32_t mask = static_cast<uint32_t>((uint64_t{1} << bits) - 1);
  do {
    uint64_t k = key;
    for (int round = 0; round < 4; ++round, k = std::rotr(k, 17)) {
      i = ((i ^ static_cast<uint32_t>(k)) * (static_cast<uint32_t>(k >> 32) | 1)) & mask;
      i ^= i >> shift;
      i = (i * 0x2c1b3c6du) & mask;
      i ^= i >> shift;
    }
  } while (i >= n);
  return i;
}

}  // namespace lightstage::sim
