// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "client/commands/command_context.h"

namespace rigcal::client {

struct SessionObservationsOptions {
  std::string session;
  std::string camera;  // empty: all
  bool include_late = false;
};

// Writes what is stored of a session as CSV, in the order (camera, stream_epoch, seq): a head line,
// then `camera,stream_epoch,seq,clock_epoch,time_ns` and x, y (pixels, as many digits as it takes
// to read the same float again) of each marker; both empty for a marker that is not visible. As
// JSON: one ObservationBatch per line.
ExitCode WriteSessionObservations(const SessionObservationsOptions& options,
                                  CommandContext& context);

}  // namespace rigcal::client
