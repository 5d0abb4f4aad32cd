// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

namespace rigcal {
struct ColourRange;
}  // namespace rigcal

namespace rigcal::agent {

// A ColourRange as integer comparisons, without a division per pixel.
//
// Channels of 8 bits have only certain hues (60 (k + p/q) degrees, p <= q <= 255) and saturations
// (p/q). Two different fractions p/q differ by at least 1 / (255 * 254), more than 2^-16, so that a
// multiple of 2^-16 lies between them. Each limit is moved to such a multiple. The comparisons
// below are therefore exact: they take the pixels that a comparison of the quotients 60 (k q + p) /
// q and p / q, rounded to double, with the limits of the range would take.
//
// This header is compiled for instruction sets that the CPU may not have, so it contains no code.

enum Channel : uint8_t { kBlue = 0, kGreen = 1, kRed = 2 };

// The hues less than 180 degrees above, or below, a limit: those of the pixels p with p[plus] -
// p[minus] > floor((p[slope_plus] - p[slope_minus]) * slope / 2^16).
struct HueHalfPlane {
  Channel plus = kBlue;
  Channel minus = kBlue;
  Channel slope_plus = kBlue;
  Channel slope_minus = kBlue;
  int16_t slope = 0;
};

// With v the largest and m the smallest channel, a pixel is taken when
//   v > value_below  and  (m > washed_out_below
//                          or (m <= floor(v * grey_share / 2^16) and its hue is in range)
//                          or (m == v and takes_grey)).
// Its hue is in range if it lies in both half planes or, with `outside`, if it does not lie in
// both. A pixel without colour (m == v) has hue 0.
struct IntegerColourRange {
  uint8_t value_below = 0;
  uint8_t washed_out_below = 255;
  uint16_t grey_share = 65535;
  HueHalfPlane from;
  HueHalfPlane to;
  bool outside = false;
  bool takes_grey = false;
};

// `range` must be valid.
IntegerColourRange ToIntegers(const ColourRange& range);

}  // namespace rigcal::agent
