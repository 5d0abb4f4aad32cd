// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/simulated_rig_options.h"

#include <string>
#include <vector>

#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "common/status/status_macros.h"

namespace rigcal {

absl::StatusOr<SimulatedRigOptions> ParseSimulatedRigOptions(std::string_view text) {
  bool pixels = false;
  std::vector<std::string> world, pictures, parts;
  for (const auto part : absl::StrSplit(std::string(text), ';', absl::SkipEmpty())) {
    if (part == "pixels=1") {
      pixels = true;
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
  if (pixels) {
    RIGCAL_ASSIGN_OR_RETURN(options.pictures,
                            ParseFrameRenderOptions(absl::StrJoin(pictures, ";")));
  }
  return options;
}

}  // namespace rigcal
