// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>

#include "absl/status/statusor.h"
#include "server/solve/diagnose/move_scan.h"
#include "server/solve/diagnose/session_timeline.h"
#include "server/solve/diagnose/trial_solve.h"

namespace rigcal::server {

// What a camera's residuals can be explained by instead of a move at one moment: a change of its
// image that is the same lens and pose but for a few numbers.
struct CameraChange {
  enum class Form : uint8_t {
    kZoom,   // its image is larger by `zoom` while `when.HasMoved`: focus or zoom was turned
    kDrift,  // its pose changes evenly by `drift` from the first instant to the last
  };
  Form form = Form::kZoom;
  ChangePoint when;  // of a zoom
  double zoom = 0;   // relative: 0.01 is 1 % larger
  PoseStep drift = PoseStep::Zero();
  int parameters = 1;
  // Share of the camera's residuals that it takes away, as ChangePoint::gain.
  double gain = 0;
};

// A zoom at the time of the move that explains most. None with too few markers.
std::optional<CameraChange> FitZoom(const TrialProblem& trial, const SessionTimeline& timeline,
                                    int camera, const ChangePoint& move);

// An even drift of the pose, where it also explains blocks of time that it was not fitted to.
std::optional<CameraChange> FitDrift(const TrialProblem& trial, const SessionTimeline& timeline,
                                     int camera);

// The trial solved with the change taken out of the measured centres, and fitted again to what is
// left until it stays (a few rounds). `change` becomes what was taken out. Errors of SolveTrial.
absl::StatusOr<TrialProblem> SolveWithout(const TrialProblem& trial,
                                          const SessionTimeline& timeline, int camera,
                                          CameraChange* change);

// Root mean square of how far the change moves the image where the target was seen; of a zoom,
// while it lasts. Pixels.
double ImageMotionPx(const TrialProblem& trial, const SessionTimeline& timeline, int camera,
                     const CameraChange& change);

}  // namespace rigcal::server
