// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "client/commands/command_context.h"
#include "client/net/server_connection.h"
#include "client/results/calibration_file.h"

namespace rigcal::client {

// A calibration of the server, by its id, or of a file, by its path (with a . or /); with its
// covariance, where there is one. The server is asked for an id only.
absl::StatusOr<CalibrationFile> FetchCalibrationFile(const std::string& which,
                                                     CommandContext& context);

// The joint covariance of the cameras of a calibration on the server. Empty: it has none, or the
// server does not hand it out.
std::vector<double> FetchCovariance(ServerConnection& server, const std::string& id);

}  // namespace rigcal::client
