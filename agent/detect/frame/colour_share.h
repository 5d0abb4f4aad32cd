// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "agent/identify/detection.h"

namespace rigcal::agent {

// As shares of an image, 0 to 1: more than this in the wand's colour is no wand, and makes the
// search leave things out.
inline constexpr double kCrowdedShare = 0.06;

// For people: how much of the picture passes the colour test, what that is and what to do. Empty
// where it is little. `passed`, `white`: see Detection.
std::string CrowdedText(double passed, double white);

}  // namespace rigcal::agent
