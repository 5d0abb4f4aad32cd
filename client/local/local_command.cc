// SPDX-License-Identifier: Apache-2.0
#include "client/local/local_command.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "client/commands/calibrate_command.h"
#include "client/local/capture_table.h"
#include "client/local/local_calibration.h"
#include "client/local/local_plan.h"
#include "client/local/local_rig.h"
#include "client/local/recorded_folder.h"
#include "client/local/run_folder.h"
#include "client/local/stop_signal.h"
#include "client/results/calibration_export.h"
#include "client/results/ground_truth_comparison.h"
#include "common/status/status_macros.h"

namespace rigcal::client {
namespace {

absl::Status Export(const LocalOutcome& outcome, const GroundTruthComparison* ground_truth,
                    const RunFolder& folder) {
  const v1::Calibration& calibration = outcome.calibration;
  RIGCAL_RETURN_IF_ERROR(
      WriteJsonExport(calibration, outcome.camera_covariance, folder.Export(), ground_truth)
          .status());
  if (!calibration.scale_known()) return absl::OkStatus();
  RIGCAL_ASSIGN_OR_RETURN(const auto* format, FindCalibrationExportFormat("opencv"));
  return WriteExport(*format, calibration, folder.Export()).status();
}

// Everything that needs the processes.
absl::StatusOr<LocalOutcome> Run(const LocalOptions& options, const LocalPlan& plan,
                                 const RunFolder& folder, const StopSignals& signals,
                                 Console& console) {
  std::filesystem::path programs = options.programs;
  if (programs.empty()) {
    RIGCAL_ASSIGN_OR_RETURN(programs, ProgramDirectory());
  }
  LocalRig rig(programs, folder);
  return CalibrateLocally(options, plan.cameras, rig, signals, console);
}

bool HasEventCamera(const v1::Session& session) {
  return std::ranges::any_of(session.cameras(), [](const v1::SessionCamera& camera) {
    return camera.description().sensor() == v1::CameraDescription::SENSOR_EVENT;
  });
}

// Prints the result. No process runs any more.
ExitCode Conclude(const LocalOutcome& outcome, const LocalPlan& plan, const RunFolder& folder,
                  CommandContext& context) {
  const v1::Calibration& calibration = outcome.calibration;
  absl::StatusOr<GroundTruthComparison> comparison;
  const GroundTruthComparison* ground_truth = nullptr;
  ExitCode code = ExitCode::kOk;
  const bool succeeded = calibration.state() == v1::Calibration::STATE_SUCCEEDED;
  if (succeeded && plan.world.has_value()) {
    comparison = CompareWithGroundTruth(calibration, *plan.world);
    if (comparison.ok()) ground_truth = &*comparison;
    if (!comparison.ok()) code = context.Fail(comparison.status());
  }
  if (succeeded && folder.stays()) {
    const absl::Status status = Export(outcome, ground_truth, folder);
    if (!status.ok()) code = context.Fail(status);
  }
  if (context.console.format == OutputFormat::kTable) {
    context.console.out << FormatCapture(outcome, plan.duration_s) << std::flush;
  }
  const ExitCode shown = ShowCalibration(calibration, context, ground_truth);
  if (context.console.format == OutputFormat::kTable && ground_truth &&
      HasEventCamera(outcome.session)) {
    context.console.out
        << "  the time offset of an event camera holds what its pixels' low pass does, "
           "too: docs/event_cameras.md\n"
        << std::flush;
  }
  return code == ExitCode::kOk ? shown : code;
}

}  // namespace

ExitCode RunLocal(const LocalOptions& options, CommandContext& context) {
  const StopSignals signals;
  // Reports a wrong data folder before the folder of the run is created.
  absl::StatusOr<RecordedFolder> recorded = RecordedFolder();
  if (!options.simulation.has_value()) {
    recorded = ReadRecordedFolder(options.data);
    if (!recorded.ok()) return context.Fail(recorded.status());
    for (const std::string& warning : recorded->warnings) context.console.Message(warning);
  }
  const absl::StatusOr<RunFolder> folder = RunFolder::Create(options.keep);
  if (!folder.ok()) return context.Fail(folder.status());
  const absl::StatusOr<LocalPlan> plan =
      options.simulation.has_value()
          ? PlanSimulated(*options.simulation, options.target, options.speed, options.lenses)
          : PlanRecorded(*recorded, options.speed, options.recording, folder->path());
  if (!plan.ok()) return context.Fail(plan.status());

  const absl::StatusOr<LocalOutcome> outcome =
      Run(options, *plan, *folder, signals, context.console);
  if (!outcome.ok()) context.Fail(outcome.status());
  // Whatever the status: a server of our own that cannot be reached is a failure like any other.
  const ExitCode code =
      outcome.ok() ? Conclude(*outcome, *plan, *folder, context) : ExitCode::kFailed;
  if (folder->stays()) {
    const char* what =
        code == ExitCode::kFailed ? "the store and the logs" : "the store, the logs and an export";
    context.console.Message(absl::StrCat(what, " are kept in ", folder->path().string()));
  }
  return code;
}

}  // namespace rigcal::client
