// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/frame/colour_share.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

namespace rigcal::agent {
namespace {

constexpr double kEnoughGrey = 100;     // grey levels that a sphere needs to be found
constexpr double kClippedGrey = 250;    // from here on the true brightness may be higher
constexpr double kUsualShare = 0.25;    // of the exposure, if no wand shows how much is enough
constexpr double kWorthSetting = 0.75;  // of the exposure; a smaller change helps little
constexpr double kMillisecond = 1e-3;

bool IsMostlyWhite(double passed, double white) { return white > 0.5 * passed; }

std::string WhatToDo(double passed, double white, const ExposureFacts& facts) {
  if (IsMostlyWhite(passed, white)) {
    return "Wait: what stands still is ignored after a few seconds. Or " +
           ShorterExposureText(facts);
  }
  return "Wait: what stands still is ignored after a few seconds. Or learn the colour "
         "(rigcal-agent "
         "tune), dim the room, or take a wand of another colour";
}

}  // namespace

std::string ShorterExposureText(const ExposureFacts& facts) {
  const std::string blinks = facts.blink_s > 0
                                 ? absl::StrFormat(" (not below one blink of the wand, %.3g ms)",
                                                   facts.blink_s / kMillisecond)
                                 : "";
  if (!(facts.exposure_s > 0)) return "shorten the exposure" + blinks;
  const bool knows_grey = facts.marker_grey > 0;
  double wanted_s = facts.exposure_s * (knows_grey ? kEnoughGrey / facts.marker_grey : kUsualShare);
  // With whole blinks the LEDs are equally bright whatever their phase.
  if (facts.blink_s > 0) {
    wanted_s = facts.blink_s * std::max(1.0, std::floor(wanted_s / facts.blink_s + 1e-6));
  }
  if (wanted_s > kWorthSetting * facts.exposure_s) {
    return absl::StrFormat(
        "the exposure of %.3g ms is as short as the wand allows: close the aperture, turn the gain "
        "down, draw the blinds or take a brighter wand",
        facts.exposure_s / kMillisecond);
  }
  std::string text = absl::StrFormat("shorten the exposure from %.3g to %.3g ms",
                                     facts.exposure_s / kMillisecond, wanted_s / kMillisecond);
  if (knows_grey) {
    absl::StrAppendFormat(&text, ", at which the spheres keep %.0f of %s%.0f grey levels",
                          facts.marker_grey * wanted_s / facts.exposure_s,
                          facts.marker_grey >= kClippedGrey ? "at least " : "", facts.marker_grey);
  }
  return text;
}

std::string ColourShareText(double passed, double white) {
  if (passed < kCrowdedShare) return "";
  const std::string share =
      absl::StrFormat("%.0f %% of the picture passes the colour test", 100 * passed);
  if (!IsMostlyWhite(passed, white)) return share + ": surfaces of the wand's colour";
  return absl::StrFormat("%s, %.0f %% are white: windows or lamps", share, 100 * white);
}

std::string CrowdedText(double passed, double white, const ExposureFacts& facts) {
  const std::string share = ColourShareText(passed, white);
  return share.empty() ? "" : absl::StrCat(share, ". ", WhatToDo(passed, white, facts));
}

std::string TooManyText(double passed, double white, const ExposureFacts& facts) {
  const std::string crowded = CrowdedText(passed, white, facts);
  if (!crowded.empty()) return crowded;
  return absl::StrFormat(
      "too many things look like a marker, so the search was cut short (%.2g %% of the picture "
      "passes the colour test). %s",
      100 * passed, WhatToDo(passed, white, facts));
}

}  // namespace rigcal::agent
