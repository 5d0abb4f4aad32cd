// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/frame/colour_share.h"

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

namespace rigcal::agent {

std::string CrowdedText(double passed, double white) {
  if (passed < kCrowdedShare) return "";
  const std::string share =
      absl::StrFormat("%.0f %% of the picture passes the colour test", 100 * passed);
  if (white > 0.5 * passed) {
    return absl::StrFormat(
        "%s, %.0f %% are white: windows or lamps. Learn a mask (rigcal-agent mask), shorten the "
        "exposure or turn the gain down",
        share, 100 * white);
  }
  return absl::StrCat(share,
                      ": surfaces of the wand's colour. Learn the colour (rigcal-agent tune) and a "
                      "mask (rigcal-agent mask), dim the room, or take a wand of another colour");
}

}  // namespace rigcal::agent
