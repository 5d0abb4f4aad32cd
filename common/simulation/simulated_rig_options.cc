// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/simulated_rig_options.h"

#include <string>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "common/status/status_macros.h"

namespace rigcal {

absl::StatusOr<SimulatedRigOptions> ParseSimulatedRigOptions(std::string_view text) {
  bool pixels = false;
  int event_cameras = 0;
  std::vector<std::string> world, pictures, parts;
  const std::vector<std::string> given = absl::StrSplit(std::string(text), ';', absl::SkipEmpty());
  for (const std::string& part : given) {
    if (part == "pixels=1") {
      pixels = true;
    } else if (absl::StartsWith(part, "events=")) {
      if (!absl::SimpleAtoi(part.substr(7), &event_cameras) || event_cameras < 0) {
        return absl::InvalidArgumentError(
            absl::StrCat("\"", part, "\" is not a number of event cameras"));
      }
    } else if (part != "pixels=0") {
      parts.emplace_back(part);
    }
  }
  for (const std::string& part : parts) {
    const std::string name = part.substr(0, part.find('='));
    const bool of_pictures = pixels && IsFrameRenderOption(name);
    if (of_pictures) pictures.push_back(part);
    if (!of_pictures || name == "seed") world.push_back(part);
  }
  SimulatedRigOptions options;
  RIGCAL_ASSIGN_OR_RETURN(options.world, ParseSimulationOptions(absl::StrJoin(world, ";")));
  if (event_cameras > 0 && (!pixels || event_cameras > options.world.camera_count)) {
    return absl::InvalidArgumentError(
        absl::StrCat("events=", event_cameras,
                     " needs pixels=1 and at least as many cameras; example: "
                     "\"cameras=6;pixels=1;events=2\""));
  }
  options.event_cameras = event_cameras;
  if (pixels) {
    RIGCAL_ASSIGN_OR_RETURN(options.pictures,
                            ParseFrameRenderOptions(absl::StrJoin(pictures, ";")));
  }
  return options;
}

}  // namespace rigcal
