// SPDX-License-Identifier: Apache-2.0
#include "client/commands/frame_command.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "client/commands/calibrate_command.h"
#include "client/commands/command_parser.h"
#include "client/commands/rig_command.h"
#include "client/net/server_connection.h"
#include "client/results/calibration_import.h"
#include "client/results/marker_rows.h"
#include "client/tables/frame_table.h"

namespace rigcal::client {

void AddFrameTarget(CLI::App* app, bool rig, FrameTarget* target) {
  if (rig) {
    AddArgument(app, "RIG", "Rig whose active calibration it is made from", &target->rig);
  } else {
    AddArgument(app, "CALIBRATION",
                "Id of a calibration, or the path (with a . or /) of an exported calibration.json",
                &target->calibration);
  }
  CLI::Option* const output =
      AddOption(app, "--output", "FILE", &target->output,
                "Write it as this calibration.json instead of keeping it on the server");
  AddForceOption(app, &target->force);
  CLI::Option* const activate = app->add_flag(
      "--activate", target->activate, "Make it the active calibration of the rig if it is good");
  activate->excludes(output);
  AddOption(app, "--session", "SESSION", &target->session,
            "Take the rows of this finished session of the server")
      ->excludes(output);
  AddOption(app, "--reason", "TEXT", &target->reason, "Why; it is kept with the calibration")
      ->excludes(output);
  AddOption(app, "--notes", "TEXT", &target->notes, "Free text, likewise")->excludes(output);
}

absl::StatusOr<std::string> WhichCalibration(const FrameTarget& target, CommandContext& context) {
  if (!target.rig.empty()) {
    ServerConnection server(context.server);
    return ActiveCalibrationOf(server, target.rig);
  }
  if (IsImportPath(target.calibration) && target.output.empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat(target.calibration,
                     " is a file, and what is made of it is one: name it with "
                     "--output"));
  }
  return target.calibration;
}

absl::StatusOr<std::vector<CameraRows>> FolderRows(const CalibrationResult& calibration,
                                                   const std::string& folder,
                                                   CommandContext& context) {
  std::vector<std::string> names;
  for (const CalibratedCamera& camera : calibration.cameras) names.push_back(camera.camera);
  absl::StatusOr<MarkerRows> rows = ReadMarkerRows(folder, names);
  if (!rows.ok()) return rows.status();
  for (const std::string& warning : rows->warnings) context.console.Message(warning);
  return std::move(rows->cameras);
}

ExitCode DeriveOnServer(const FrameTarget& target, const std::string& parent_id,
                        v1::CreateCalibrationRequest request, CommandContext& context) {
  if (!target.session.empty()) request.add_session_ids(target.session);
  request.set_reason(target.reason);
  request.set_notes(target.notes);
  request.mutable_options()->set_parent_id(parent_id);
  ServerConnection server(context.server);
  const absl::StatusOr<v1::Calibration> made = CalibrateSuccessfully(server, request, context);
  const ExitCode shown = context.Show(made, [](const v1::Calibration& calibration) {
    return absl::StrCat("calibration   ", calibration.id(), " (version ", calibration.version(),
                        " of rig ", calibration.rig(), ")\n", FormatScaleSources(calibration),
                        FormatFrame(calibration));
  });
  if (!made.ok() || !target.activate) return shown;
  return ActivateIfGood(server, *made, target.reason, context);
}

}  // namespace rigcal::client
