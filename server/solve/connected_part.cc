// SPDX-License-Identifier: Apache-2.0
#include "server/solve/connected_part.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "server/solve/diagnose/odd_camera.h"
#include "server/solve/initialize/overlap_graph.h"
#include "server/solve/spoiling_camera.h"

namespace rigcal::server {
namespace {

constexpr size_t kFewestCameras = 3;

using Group = std::vector<int>;

bool Has(const Group& group, int camera) { return std::ranges::count(group, camera) > 0; }

// The group to be calibrated; null: none.
const Group* Chosen(const std::vector<Group>& groups, int reference, bool asked_reference) {
  const Group* chosen = nullptr;
  for (const Group& group : groups) {
    if (group.size() < kFewestCameras) continue;
    const bool is_own = Has(group, reference);
    if (asked_reference && !is_own) continue;
    const bool is_better = chosen == nullptr || group.size() > chosen->size() ||
                           (group.size() == chosen->size() && is_own && !Has(*chosen, reference));
    if (is_better) chosen = &group;
  }
  return chosen;
}

// What would join the group of `camera` with the calibrated one.
std::string Advice(const UnconnectedGroups& unconnected, const Group& chosen, const Group& own,
                   const RigIndex& index) {
  const auto name = [&index](int camera) -> const std::string& {
    return index.cameras[static_cast<size_t>(camera)].camera;
  };
  std::string advice = absl::StrFormat(
      "it was left out, and the calibration is that of %d of %d cameras: ", chosen.size(),
      index.cameras.size());
  std::vector<std::string> names;
  for (const int camera : own) names.push_back(name(camera));
  advice += own.size() == 1 ? "no relative pose connects it with them"
                            : absl::StrCat("no relative pose connects its group (",
                                           absl::StrJoin(names, ", "), ") with them");
  for (const auto& pair : unconnected.nearest) {
    const bool is_this =
        (Has(chosen, pair.a) && Has(own, pair.b)) || (Has(chosen, pair.b) && Has(own, pair.a));
    if (!is_this) continue;
    const int here = Has(own, pair.a) ? pair.a : pair.b;
    const int there = here == pair.a ? pair.b : pair.a;
    advice += absl::StrFormat(
        ". %s and %s are nearest to it, with %d wand views at the same time: wave the wand where "
        "both see it, turning and moving it in depth, and calibrate again%s",
        name(here), name(there), pair.shared_count,
        pair.shared_count > 0 ? "; if they saw it together often, check their clocks and "
                                "intrinsics"
                              : "");
  }
  return advice;
}

}  // namespace

std::optional<ConnectedPart> FindConnectedPart(const absl::Status& failed, const RigIndex& index,
                                               const CalibrationOptions& options,
                                               bool asked_reference) {
  const auto unconnected = UnconnectedGroupsOf(failed);
  if (!unconnected) return std::nullopt;
  const int reference = CameraIndex(index, options.reference_camera);
  const Group* chosen = Chosen(unconnected->groups, reference, asked_reference);
  if (chosen == nullptr) return std::nullopt;
  const auto name = [&index](int camera) {
    return index.cameras[static_cast<size_t>(camera)].camera;
  };
  ConnectedPart part;
  part.reference_camera = name(Has(*chosen, reference) ? reference : chosen->front());
  CalibrationOptions needed = options;
  needed.reference_camera = part.reference_camera;
  for (const Group& group : unconnected->groups) {
    if (&group == chosen) continue;
    const std::string advice = Advice(*unconnected, *chosen, group, index);
    for (const int camera : group) {
      if (IsNeeded(name(camera), needed)) return std::nullopt;
      part.left_out.push_back(name(camera));
      part.findings.push_back({FindingKind::kWeakLink, name(camera), 0, "instants", advice});
    }
  }
  return part;
}

RigObservations WithoutCameras(const RigObservations& rig, const std::vector<std::string>& cameras,
                               std::vector<ClockCorrection>* clocks) {
  RigObservations rest = rig;
  for (const std::string& camera : cameras) {
    std::vector<ClockCorrection> remaining;
    rest = WithoutCamera(rest, *clocks, static_cast<size_t>(CameraIndex(rest.index, camera)),
                         &remaining);
    *clocks = std::move(remaining);
  }
  return rest;
}

}  // namespace rigcal::server
