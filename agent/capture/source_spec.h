// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <variant>

#include "absl/status/statusor.h"
#include "agent/capture/csv_observation_source.h"
#include "agent/capture/observation_source.h"
#include "agent/capture/simulated_observation_source.h"
#include "agent/capture/source_options.h"
#include "common/config/agent_config.h"

namespace rigcal::agent {

// Where one camera's observations come from.
using SourceSpec = std::variant<CsvSourceOptions, SimulatedSourceOptions>;

// Reads what a user types behind --source:
//
//   [NAME=]csv:PATH[;speed=max|FACTOR][;sigma=0.5][;calibration=FILE]
//   [NAME=]sim:camera=INDEX[;<simulation options>][;speed=max|FACTOR]
//
// csv: NAME is the file's stem and FILE the same stem with .yaml beside it, unless given; sigma in
// pixels. sim: NAME is sim_INDEX unless given; simulation options as in ParseSimulationOptions, but
// the wand's speed only as `wand_speed`, since `speed` is the pace, as it is for csv.
// speed: times the recorded pace, 1 unless given. PATH and FILE cannot hold a ';'.
//
// INVALID_ARGUMENT quotes the part that is wrong and shows a right example.
absl::StatusOr<SourceSpec> ParseSourceSpec(std::string_view text);

// The same from a [[camera]] of the configuration file, whose keys go before what its source says.
// INVALID_ARGUMENT begins with file and line.
absl::StatusOr<SourceSpec> ParseSourceSpec(const CameraConfig& camera);

// The camera's name within the rig.
const std::string& CameraNameOf(const SourceSpec& spec);

// The source itself; opens its files once to see that they are there. The message names the camera,
// the file and what to do.
absl::StatusOr<std::unique_ptr<ObservationSource>> CreateSource(const SourceSpec& spec);

}  // namespace rigcal::agent
