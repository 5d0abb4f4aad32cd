// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "client/commands/command_context.h"
#include "client/local/local_plan.h"
#include "common/calibration/calibration_options.h"
#include "common/simulation/simulated_rig_options.h"
#include "common/target/target.h"

namespace rigcal::client {

inline constexpr const char* kDefaultTarget = "wand:0,0.13,0.39";

struct LocalOptions {
  // Exactly one of the two.
  std::string data;  // folder of a recording
  std::optional<SimulatedRigOptions> simulation;
  std::string lenses;  // folder with lenses for simulated cameras; empty: they know their own

  Target target;
  std::string keep;           // empty: nothing is kept
  std::string speed = "max";  // or a factor of the recorded pace
  RecordingOptionTexts recording;
  CalibrationOptions calibration;

  // Folder of rigcal-server and rigcal-agent; empty: beside this program.
  std::filesystem::path programs;
};

// `rigcal local`: a server and one agent per camera on this machine, one session, one calibration,
// printed; with a simulated rig also compared with ground truth. Leaves no process behind. For the
// main thread.
ExitCode RunLocal(const LocalOptions& options, CommandContext& context);

}  // namespace rigcal::client
