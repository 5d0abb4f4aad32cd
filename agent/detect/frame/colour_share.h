// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "agent/identify/detection.h"

namespace rigcal::agent {

// Share of an image, 0 to 1. More in the wand's colour is no wand and makes the search incomplete.
inline constexpr double kCrowdedShare = 0.06;

// What is known of the light that a camera gets; 0 means not known.
struct ExposureFacts {
  double exposure_s = 0;
  double blink_s = 0;      // the longest period of the target's LEDs
  double marker_grey = 0;  // of a sphere's middle in its brightest channel, if a wand was found
};

// Text for people: an exposure that makes less white but still shows the spheres and every blink.
std::string ShorterExposureText(const ExposureFacts& facts);

// Text for people: how much of the picture passes the colour test, and what that is. It is empty if
// that is little. For `passed` and `white` see Detection.
std::string ColourShareText(double passed, double white);

// The same with advice.
std::string CrowdedText(double passed, double white, const ExposureFacts& facts = {});

// The same for a picture whose search was cut short, however little passes.
std::string TooManyText(double passed, double white, const ExposureFacts& facts = {});

}  // namespace rigcal::agent
