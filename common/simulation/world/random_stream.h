// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <cstdint>
#include <initializer_list>

namespace rigcal {

// Random numbers that follow from what they are for (a seed, a purpose, a camera, a frame) and not
// from what was asked before, and are the same with every standard library. SplitMix64 (Steele, Lea
// and Flood 2014, "Fast splittable pseudorandom number generators").
class RandomStream {
 public:
  RandomStream(std::initializer_list<uint64_t> key) {
    for (const uint64_t part : key) state_ = Mix(state_ ^ Mix(part + kGolden));
  }

  uint64_t Bits() { return Mix(state_ += kGolden); }
  // In [0, 1), 53 bits.
  double Uniform() { return static_cast<double>(Bits() >> 11) * 0x1p-53; }
  double Uniform(double low, double high) { return low + (high - low) * Uniform(); }
  // Of a number whose logarithm is uniform; both above 0.
  double LogUniform(double low, double high) { return low * std::pow(high / low, Uniform()); }
  // Mean 0, sigma 1, by Box and Muller; two draws of Bits each time, whatever the values.
  double Gaussian() {
    const double radius = std::sqrt(-2 * std::log(1 - Uniform()));
    return radius * std::cos(2 * 3.14159265358979323846 * Uniform());
  }

 private:
  static constexpr uint64_t kGolden = 0x9e3779b97f4a7c15u;
  static uint64_t Mix(uint64_t z) {
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
  }

  uint64_t state_ = 0;
};

}  // namespace rigcal
