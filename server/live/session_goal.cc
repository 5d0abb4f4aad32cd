// SPDX-License-Identifier: Apache-2.0
#include "server/live/session_goal.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"

namespace rigcal::server {
namespace {

constexpr double kOldestEstimateS = 10;

std::string CamerasWithoutPart(const Session& session, const LiveEstimate& estimate) {
  std::vector<std::string> names;
  for (const SessionCamera& camera : session.cameras) {
    const std::string& name = camera.description.camera;
    if (std::ranges::find(estimate.cameras, name, &LiveEstimatedCamera::camera) ==
        estimate.cameras.end()) {
      names.push_back(name);
    }
  }
  return absl::StrJoin(names, ", ");
}

std::string WhyNot(const SessionGoal& goal, const Session& session, const LiveEstimate* estimate,
                   double elapsed_s, int64_t now_utc_ns) {
  if (estimate == nullptr || estimate->state == EstimateState::kWaiting) {
    if (estimate != nullptr && !estimate->needs.empty()) {
      const LivePairNeed& need = estimate->needs.front();
      return absl::StrCat("too little has been seen to solve: ", need.camera_a, " and ",
                          need.camera_b, " have ", need.common_count, " of ", need.needed_count,
                          " instants in common");
    }
    return "there is no estimate yet";
  }
  if (estimate->state == EstimateState::kFailed) {
    return absl::StrCat("the running estimate fails: ", estimate->problem);
  }
  const double age_s = 1e-9 * static_cast<double>(now_utc_ns - estimate->time_utc_ns);
  if (age_s > kOldestEstimateS) {
    return absl::StrFormat("the running estimate is %.0f s old", age_s);
  }
  if (!estimate->scale_known) return "the scale is not known, so no error in mm either";
  if (const std::string missing = CamerasWithoutPart(session, *estimate); !missing.empty()) {
    return absl::StrCat("no part in the estimate yet: ", missing);
  }
  if (!estimate->volume || !(estimate->volume->p95_mm > 0)) {
    return "the expected error is not known yet";
  }
  if (!(estimate->volume->p95_mm < goal.until_mm)) {
    return absl::StrFormat("the expected error is %.2f mm, the goal %.3g mm",
                           estimate->volume->p95_mm, goal.until_mm);
  }
  if (!estimate->held_out) return "no held-out check has been made yet";
  if (!estimate->held_out->agrees) {
    return absl::StrFormat("held-out data do not agree: %.2f px where %.2f px are expected",
                           estimate->held_out->rms_px, estimate->held_out->expected_rms_px);
  }
  if (elapsed_s < goal.min_duration_s) {
    return absl::StrFormat("it has captured for %.0f s; it goes on for at least %.0f s", elapsed_s,
                           goal.min_duration_s);
  }
  return "";
}

}  // namespace

LiveGoal JudgeGoal(const SessionGoal& goal, const Session& session, const LiveEstimate* estimate,
                   double elapsed_s, int64_t now_utc_ns) {
  LiveGoal result;
  result.until_mm = goal.until_mm;
  if (estimate != nullptr && estimate->volume) result.now_mm = estimate->volume->p95_mm;
  result.why_not = WhyNot(goal, session, estimate, elapsed_s, now_utc_ns);
  result.reached = result.why_not.empty();
  return result;
}

std::string StopReason(const LiveGoal& goal) {
  return absl::StrFormat("the expected error is %.2f mm, below %.3g mm", goal.now_mm,
                         goal.until_mm);
}

}  // namespace rigcal::server
