// SPDX-License-Identifier: Apache-2.0
#include <vector>

#include "absl/strings/str_format.h"
#include "server/solve/diagnose/finding_causes.h"
#include "server/solve/rig/stamp_jitter.h"

namespace rigcal::server {

std::vector<Cause> FindStampJitter(const CauseInput& input) {
  const BundleProblem& problem = input.evaluated.solution.built.problem;
  if (!input.evaluated.options.estimate_time_offsets || problem.HasRigidTarget()) return {};
  const std::vector<StampJitter> all = MeasureStampJitter(problem);
  const std::vector<bool> jitters = CamerasThatJitter(all);
  std::vector<Cause> causes;
  for (size_t c = 0; c < all.size(); ++c) {
    const StampJitter& jitter = all[c];
    if (!jitters[c]) continue;
    causes.push_back(
        {{FindingKind::kStampsJitter, problem.cameras[c].name, 1e3 * jitter.jitter_s, "ms",
          absl::StrFormat("the times of its rows scatter by about %.1f ms from one to the next (one "
                          "sigma), as stamps of arrival do; %.1f ms would be linear in the image "
                          "row, as of a rolling shutter. At the speed of this wave that is %.1f "
                          "px. Take the camera's own stamps, of the exposure",
                          1e3 * jitter.jitter_s, 1e3 * jitter.line_s, jitter.error_px)},
         jitter.error_px});
  }
  return causes;
}

}  // namespace rigcal::server
