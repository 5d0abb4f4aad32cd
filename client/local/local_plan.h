// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "client/local/local_rig.h"
#include "client/local/recorded_folder.h"
#include "common/simulation/simulated_rig_options.h"
#include "common/simulation/world/simulated_world.h"
#include "common/target/target.h"

namespace rigcal::client {

// The cameras that `rigcal local` starts, and ground truth where it has some.
struct LocalPlan {
  std::vector<LocalCamera> cameras;
  std::optional<SimulatedWorld> world;  // ground truth of a simulated rig
  double duration_s = 0;                // of the wave; 0: not known
};

// Options behind the sources of a recording; empty: none.
struct RecordingOptionTexts {
  std::string events = {};  // of recordings of events: "rate=500;clock=cable"
  std::string frames = {};  // of images and videos: "fps=25"
};

// `speed`: "max" or a factor of the recorded pace, as the agent's source takes it.
// INVALID_ARGUMENT: options of recordings that are not there. A folder with a ';' in its path,
// which the agent's notation cannot carry, is reached through a link in `link_in`; INVALID_ARGUMENT
// where that path has one, too.
absl::StatusOr<LocalPlan> PlanRecorded(const RecordedFolder& folder, const std::string& speed,
                                       const RecordingOptionTexts& options,
                                       const std::filesystem::path& link_in);
// `lenses`: folder with <camera>.yaml for every camera, instead of their own lenses; empty: none.
absl::StatusOr<LocalPlan> PlanSimulated(const SimulatedRigOptions& rig, const Target& target,
                                        const std::string& speed, const std::string& lenses = "");

}  // namespace rigcal::client
