// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "client/commands/command_context.h"
#include "client/net/server_connection.h"
#include "common/calibration/calibration_options.h"
#include "rigcal/v1/calibration_service.pb.h"

namespace rigcal::client {

struct GroundTruthComparison;

struct CalibrateOptions {
  std::vector<std::string> sessions;
  CalibrationOptions calibration;
  bool wait = false;  // until it has succeeded or failed
  bool refine = false;
  bool activate = false;  // once it has succeeded, if it is good
  std::string prior;      // a calibration's id or another program's file: intrinsics to use
  std::string reason, notes;
};

// `rigcal calibrate`: queues a calibration and prints it; with `wait`, its result.
ExitCode Calibrate(const CalibrateOptions& options, CommandContext& context);

// Queues a calibration and waits for its end, which may be that it failed, with its progress on
// `err`. Errors: the server's.
absl::StatusOr<rigcal::v1::Calibration> CalibrateAndWait(
    ServerConnection& server, const rigcal::v1::CreateCalibrationRequest& request,
    CommandContext& context);

// The same; a calibration that failed is FAILED_PRECONDITION with its error.
absl::StatusOr<rigcal::v1::Calibration> CalibrateSuccessfully(
    ServerConnection& server, const rigcal::v1::CreateCalibrationRequest& request,
    CommandContext& context);

// Makes a calibration the active one if it is graded good; else says why it is not, and returns
// kBelowQualityGate.
ExitCode ActivateIfGood(ServerConnection& server, const rigcal::v1::Calibration& calibration,
                        const std::string& reason, CommandContext& context);

// Prints a calibration and returns the exit code for its state: FAILED is kFailed, with the error
// on `err`; SUCCEEDED but graded BAD is kBelowQualityGate; anything else kOk.
// `ground_truth`: printed with it, where there is one.
ExitCode ShowCalibration(const rigcal::v1::Calibration& calibration, CommandContext& context,
                         const GroundTruthComparison* ground_truth = nullptr);

bool HasEnded(const rigcal::v1::Calibration& calibration);
rigcal::v1::CreateCalibrationRequest MakeCalibrationRequest(
    const std::vector<std::string>& sessions, const CalibrationOptions& options);

}  // namespace rigcal::client
