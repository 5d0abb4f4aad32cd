// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include "client/commands/command_context.h"
#include "common/triangulate/triangulate_rows.h"

namespace rigcal::client {

struct TriangulateCommandOptions {
  std::string calibration;  // id, or the path of a file
  std::string data;         // folder of rows
  std::string output;       // to write: .parquet, .trc, .c3d, else CSV; "-": stdout
  bool force = false;       // replace the file that is there
  TriangulationOptions triangulation;
  std::optional<double> diameter_m;  // of the spheres; none: as in the calibration's target
};

// `rigcal triangulate`: prints what it came to. Returns the exit code.
ExitCode TriangulateData(const TriangulateCommandOptions& options, CommandContext& context);

}  // namespace rigcal::client
