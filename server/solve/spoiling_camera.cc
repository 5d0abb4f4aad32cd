// SPDX-License-Identifier: Apache-2.0
#include "server/solve/spoiling_camera.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"

namespace rigcal::server {

OddCamera SpoilingCamera(const absl::StatusOr<Solved>& solved, const RigObservations& rig,
                         const std::vector<ClockCorrection>& clocks, const RigSolveOptions& solve) {
  if (absl::IsFailedPrecondition(solved.status())) return FindOddCamera(rig, clocks, solve);
  OddCamera odd;
  if (!solved.ok()) return odd;
  int count = 0;
  for (const Finding& finding : solved->result.findings) {
    if (finding.candidate || (finding.kind != FindingKind::kInconsistentCamera &&
                              finding.kind != FindingKind::kMirroredImage)) {
      continue;
    }
    ++count;
    odd.camera = finding.camera;
    odd.kind = finding.kind;
    odd.error_px = finding.value;
    odd.advice = finding.advice;
  }
  return count == 1 ? odd : OddCamera{};
}

bool IsNeeded(const std::string& camera, const CalibrationOptions& options) {
  return camera == options.reference_camera ||
         (options.known_distance && (camera == options.known_distance->camera_a ||
                                     camera == options.known_distance->camera_b));
}

absl::StatusOr<Solved> SolveWithout(const OddCamera& odd, RigObservations* rig,
                                    const std::vector<ClockCorrection>& clocks,
                                    const CalibrationOptions& options,
                                    const CalibrationHooks& hooks,
                                    const std::map<std::string, CameraCounts>& counts,
                                    RefusalCounter refused) {
  std::vector<ClockCorrection> remaining;
  RigObservations rest = WithoutCamera(
      *rig, clocks, static_cast<size_t>(CameraIndex(rig->index, odd.camera)), &remaining);
  refused.Add(odd.camera, RefusalReason::kOutlier, counts.at(odd.camera).wand_count,
              "the whole camera was left out (see findings)");
  RIGCAL_ASSIGN_OR_RETURN(
      Solved solved, SolveAndReport(rest, remaining, SolveOptionsOf(rest, options, hooks, counts),
                                    options, counts, refused));
  Finding finding{
      odd.kind, odd.camera, odd.error_px, "px",
      absl::StrCat("it was left out, and the calibration is that of the others: ", odd.advice)};
  finding.severity = SeverityOf(solved.result, finding);
  solved.result.findings.insert(solved.result.findings.begin(), std::move(finding));
  *rig = std::move(rest);
  return solved;
}

}  // namespace rigcal::server
