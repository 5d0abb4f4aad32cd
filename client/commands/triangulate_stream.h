// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <istream>

#include "client/commands/command_context.h"
#include "client/commands/triangulate_command.h"

namespace rigcal::client {

// `rigcal triangulate ID --data -`: lines `camera;time_ns;x0;y0;...` as they come, points as CSV on
// stdout as soon as the server has made them. At the end of the input: what became of the rest.
ExitCode TriangulateLines(const TriangulateCommandOptions& options, std::istream& lines,
                          CommandContext& context);

}  // namespace rigcal::client
