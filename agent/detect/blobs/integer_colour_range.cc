// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/blobs/integer_colour_range.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/target/colour_range.h"

namespace rigcal::agent {
namespace {

constexpr int kLargest = 255;
constexpr int kOne = 1 << 16;

// Returns a multiple of 2^-16 above the fractions p/q with `below(p, q)` and below all others.
template <typename Below>
int Separate(Below below) {
  double highest_below = 0;
  double lowest_above = 1;
  for (int q = 1; q <= kLargest; ++q) {
    for (int p = 0; p <= q; ++p) {
      const double fraction = static_cast<double>(p) / q;
      if (below(p, q)) {
        highest_below = std::max(highest_below, fraction);
      } else {
        lowest_above = std::min(lowest_above, fraction);
      }
    }
  }
  return static_cast<int>(std::lround(0.5 * (highest_below + lowest_above) * kOne));
}

// The order of the channels for hues from 60 * sector to 60 * (sector + 1) degrees.
struct Sector {
  Channel largest, middle, smallest;
};
constexpr Sector kSectors[6] = {{kRed, kGreen, kBlue}, {kGreen, kRed, kBlue},
                                {kGreen, kBlue, kRed}, {kBlue, kGreen, kRed},
                                {kBlue, kRed, kGreen}, {kRed, kBlue, kGreen}};

// Takes the hues above 60 * (sector + fraction / 2^16) degrees. In the sector's own channels these
// are (middle - smallest) > f (largest - smallest) where the middle channel rises with the hue, and
// (largest - middle) > f (largest - smallest) where it falls. A slope above one half does not fit
// into 16 bits, so (largest - smallest) is subtracted from both sides then.
HueHalfPlane Above(int sector, int fraction) {
  const auto [largest, middle, smallest] = kSectors[sector];
  const bool rises = sector % 2 == 0;
  if (2 * fraction < kOne) {
    const auto slope = static_cast<int16_t>(fraction);
    if (rises) return {middle, smallest, largest, smallest, slope};
    return {largest, middle, largest, smallest, slope};
  }
  const auto slope = static_cast<int16_t>(kOne - fraction);
  if (rises) return {middle, largest, smallest, largest, slope};
  return {smallest, middle, smallest, largest, slope};
}

HueHalfPlane Reverse(HueHalfPlane plane) {
  std::swap(plane.plus, plane.minus);
  std::swap(plane.slope_plus, plane.slope_minus);
  return plane;
}

double HueDeg(int sector, int p, int q) { return 60.0 * (sector * q + p) / q; }

// Hues of at least `hue_deg`.
HueHalfPlane AtLeast(double hue_deg) {
  if (hue_deg == 0) hue_deg = 360;
  const int sector = static_cast<int>(std::ceil(hue_deg / 60)) - 1;
  return Above(sector, Separate([&](int p, int q) { return HueDeg(sector, p, q) < hue_deg; }));
}

// Hues above `hue_deg`.
HueHalfPlane MoreThan(double hue_deg) {
  if (hue_deg == 360) hue_deg = 0;
  const int sector = static_cast<int>(std::floor(hue_deg / 60));
  return Above(sector, Separate([&](int p, int q) { return HueDeg(sector, p, q) <= hue_deg; }));
}

void SetHue(const ColourRange& range, IntegerColourRange* integers) {
  const double walk_deg = range.hue_max_deg - range.hue_min_deg;
  const double width_deg = walk_deg < 0 ? walk_deg + 360 : walk_deg;
  if (width_deg >= 360) {
    integers->outside = true;  // both half planes are empty, so every hue is outside
  } else if (width_deg < 180) {
    integers->from = AtLeast(range.hue_min_deg);
    integers->to = Reverse(MoreThan(range.hue_max_deg));
  } else {
    integers->outside = true;
    integers->from = MoreThan(range.hue_max_deg);
    integers->to = Reverse(AtLeast(range.hue_min_deg));
  }
}

}  // namespace

IntegerColourRange ToIntegers(const ColourRange& range) {
  IntegerColourRange integers;
  integers.value_below = static_cast<uint8_t>(range.value_min - 1);
  integers.washed_out_below = static_cast<uint8_t>(range.washed_out_min - 1);
  SetHue(range, &integers);
  if (range.saturation_min > 0) {
    integers.grey_share =
        static_cast<uint16_t>(kOne - Separate([&](int p, int q) {
                                return static_cast<double>(p) / q < range.saturation_min;
                              }));
  } else {
    integers.takes_grey =
        range.hue_min_deg > range.hue_max_deg || range.hue_min_deg == 0 || range.hue_max_deg == 360;
  }
  return integers;
}

}  // namespace rigcal::agent
