// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "client/commands/command_context.h"
#include "common/calibration/frame_options.h"
#include "common/triangulate/triangulate_rows.h"
#include "rigcal/v1/calibration_service.pb.h"

namespace rigcal::client {

// What the commands that change only frame or scale have in common: which calibration, and where
// the new one goes.
struct FrameTarget {
  std::string calibration;  // id, or the path of a file
  std::string rig;          // instead: its active calibration
  std::string output;       // calibration.json to write; empty: the server makes and keeps it
  std::string session;      // of the server: whose rows
  bool force = false;       // replace the file that is there
  bool activate = false;
  std::string reason, notes;
};

// `rig`: the argument is the name of a rig, whose active calibration is meant.
void AddFrameTarget(CLI::App* app, bool rig, FrameTarget* target);

// The id, or the path, of what is meant. FAILED_PRECONDITION: a file without --output, a session
// with it; the rig has no active calibration.
absl::StatusOr<std::string> WhichCalibration(const FrameTarget& target, CommandContext& context);

// Rows of a folder, of the cameras of the calibration. Errors of ReadMarkerRows.
absl::StatusOr<std::vector<CameraRows>> FolderRows(const CalibrationResult& calibration,
                                                   const std::string& folder,
                                                   CommandContext& context);

// Has the server make the calibration, waits for it, shows what it was made from, and activates it
// if asked for and good. `request` has the options but parent, session, reason and notes.
ExitCode DeriveOnServer(const FrameTarget& target, const std::string& parent_id,
                        rigcal::v1::CreateCalibrationRequest request, CommandContext& context);

}  // namespace rigcal::client
