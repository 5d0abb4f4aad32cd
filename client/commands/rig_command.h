// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "client/commands/calibration_command.h"
#include "client/commands/command_context.h"
#include "client/net/server_connection.h"
#include "rigcal/v1/rig_service.pb.h"

namespace rigcal::client {

// `rigcal rig ...` and `rigcal calibration diff`. Each returns the exit code.

struct NoOptions {};
ExitCode ListRigs(const NoOptions& options, CommandContext& context);
ExitCode GetRig(const std::string& name, CommandContext& context);
ExitCode ShowHistory(const std::string& name, CommandContext& context);

struct ActivateOptions {
  std::string id;  // of the calibration, or of a rollback: the rig
  std::string reason;
  bool force = false;
};
ExitCode ActivateCalibration(const ActivateOptions& options, CommandContext& context);
ExitCode RollbackRig(const ActivateOptions& options, CommandContext& context);

ExitCode DiffCalibrations(const CalibrationPair& ids, CommandContext& context);

// The active calibration of a rig. FAILED_PRECONDITION: none is active, with what to do.
absl::StatusOr<std::string> ActiveCalibrationOf(ServerConnection& server, const std::string& rig);

absl::StatusOr<rigcal::v1::CompareCalibrationsResponse> FetchDifference(ServerConnection& server,
                                                                        const std::string& id_a,
                                                                        const std::string& id_b);
absl::StatusOr<rigcal::v1::Activation> Activate(ServerConnection& server, const std::string& id,
                                                const std::string& reason, bool force);

}  // namespace rigcal::client
