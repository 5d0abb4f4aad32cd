// SPDX-License-Identifier: Apache-2.0
#include "server/solve/unsound_rows.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include "absl/strings/str_cat.h"
#include "server/associate/copied_rows.h"
#include "server/associate/frozen_rows.h"
#include "server/solve/spoiling_camera.h"
#include "server/solve/unused_views.h"

namespace rigcal::server {
namespace {

constexpr uint32_t kFewestViews = 20;  // fewer hold no camera

uint32_t ViewsOf(const std::map<std::string, CameraCounts>& counts, const std::string& camera) {
  const auto found = counts.find(camera);
  return found == counts.end() ? 0 : found->second.wand_count;
}

}  // namespace

absl::StatusOr<UnsoundRows> TakeUnsoundRows(const CalibrationOptions& options,
                                            const TargetOfSession& target_of,
                                            CalibrationInput* input, RefusalCounter* refused) {
  const auto is_needed = [&options](const std::string& camera) {
    return IsNeeded(camera, options);
  };
  std::vector<StampFault> faults = UseCopiedRowsOnce(is_needed, &input->tracks, refused);
  std::ranges::move(TakeFrozenRows(target_of, &input->tracks, refused), std::back_inserter(faults));
  UnsoundRows unsound;
  unsound.findings = FindingsOf(faults);
  const std::map<std::string, CameraCounts> counts = CountInput(*input);
  for (Finding& finding : unsound.findings) {
    if (ViewsOf(counts, finding.camera) >= kFewestViews) continue;
    if (is_needed(finding.camera)) {
      return absl::FailedPreconditionError(
          absl::StrCat("camera ", finding.camera, ": ", finding.advice,
                       ". The calibration cannot be without it, because the options name it"));
    }
    if (!unsound.left_out.insert(finding.camera).second) continue;
    if (finding.kind == FindingKind::kRowsFrozen) {
      finding.advice = absl::StrCat("the whole camera was left out: ", finding.advice);
    }
  }
  std::erase_if(input->tracks, [&unsound](const CameraTrack& track) {
    return unsound.left_out.contains(track.camera.camera);
  });
  std::set<std::string> left;
  for (const CameraTrack& track : input->tracks) left.insert(track.camera.camera);
  if (!unsound.left_out.empty() && left.size() < 2) {
    const Finding& first = unsound.findings.front();
    return absl::FailedPreconditionError(
        absl::StrCat("camera ", first.camera, ": ", first.advice, ". ", left.size(),
                     left.size() == 1 ? " camera is" : " cameras are", " left of ",
                     left.size() + unsound.left_out.size(), ", and a rig needs at least two"));
  }
  return unsound;
}

}  // namespace rigcal::server
