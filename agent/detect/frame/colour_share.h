// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "agent/identify/detection.h"

namespace rigcal::agent {

// As shares of an image, 0 to 1: more than this in the wand's colour is no wand, and makes the
// search leave things out.
inline constexpr double kCrowdedShare = 0.06;

// What is known of the light that a camera gets; 0: not known.
struct ExposureFacts {
  double exposure_s = 0;
  double blink_s = 0;      // the longest period of the target's LEDs
  double marker_grey = 0;  // of a sphere's middle, its brightest channel, where a wand was found
};

// For people: which exposure to set where too much is white, such that the spheres are still seen
// and no blink is missed.
std::string ShorterExposureText(const ExposureFacts& facts);

// For people: how much of the picture passes the colour test, and what that is. Empty where it is
// little. `passed`, `white`: see Detection.
std::string ColourShareText(double passed, double white);

// The same with what to do.
std::string CrowdedText(double passed, double white, const ExposureFacts& facts = {});

// The same of a picture whose search was cut short, however little passes.
std::string TooManyText(double passed, double white, const ExposureFacts& facts = {});

}  // namespace rigcal::agent
