// SPDX-License-Identifier: Apache-2.0
#include "server/solve/unused_views.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

namespace rigcal::server {
namespace {

// Whether a refusal counts rows with views of the wand that were lost for the calibration.
bool LosesViews(RefusalReason reason) {
  switch (reason) {
    // Markers, not rows.
    case RefusalReason::kOutlier:
    case RefusalReason::kLabelsFlipped:
    // The same again.
    case RefusalReason::kDuplicateEqual:
    // Of a camera with more rows a second than the others.
    case RefusalReason::kNotNearestInInstant:
      return false;
    default:
      return true;
  }
}

FindingKind KindOf(StampFault::Kind kind) {
  switch (kind) {
    case StampFault::Kind::kSteps:
      return FindingKind::kClockSteps;
    case StampFault::Kind::kOutOfOrder:
      return FindingKind::kRowsOutOfOrder;
    case StampFault::Kind::kRepeat:
      return FindingKind::kStampsRepeat;
    case StampFault::Kind::kBursts:
      return FindingKind::kBursts;
  }
  return FindingKind::kUnspecified;
}

const char* UnitOf(StampFault::Kind kind) {
  switch (kind) {
    case StampFault::Kind::kSteps:
      return "s";
    case StampFault::Kind::kOutOfOrder:
      return "rows";
    case StampFault::Kind::kRepeat:
    case StampFault::Kind::kBursts:
      return "%";
  }
  return "";
}

}  // namespace

void NoteUnusedViews(const std::map<std::string, CameraCounts>& counts,
                     const std::vector<Refusal>& refused, CalibrationResult* result) {
  for (const CalibratedCamera& camera : result->cameras) {
    const auto count = counts.find(camera.camera);
    if (count == counts.end()) continue;
    const Refusal* most = nullptr;
    uint64_t lost = 0, unread = 0;
    for (const Refusal& refusal : refused) {
      if (refusal.camera != camera.camera || !LosesViews(refusal.reason)) continue;
      lost += refusal.count;
      // What an agent or the server could not read is not among the rows of the input.
      if (IsUnread(refusal.reason)) unread += refusal.count;
      if (most == nullptr || refusal.count > most->count) most = &refusal;
    }
    const uint64_t all = count->second.wand_count + unread;
    if (most == nullptr || all == 0) continue;
    const double share = std::min(1.0, static_cast<double>(lost) / static_cast<double>(all));
    if (share <= kGoodWithoutViews) continue;
    Finding& finding = result->findings.emplace_back();
    finding.kind = FindingKind::kViewsNotUsed;
    finding.camera = camera.camera;
    finding.value = 100 * share;
    finding.unit = "%";
    finding.severity =
        share > kUsableWithoutViews ? FindingSeverity::kError : FindingSeverity::kWarning;
    finding.advice = absl::StrCat(lost, " of its ", all, " wand views are not used, ", most->count,
                                  " of them as ", std::string(NameOf(most->reason)),
                                  most->example.empty() ? "" : absl::StrCat(": ", most->example));
  }
}

std::vector<Finding> FindingsOf(const std::vector<StampFault>& faults) {
  std::vector<Finding> findings;
  for (const StampFault& fault : faults) {
    findings.push_back({.kind = KindOf(fault.kind),
                        .camera = fault.camera,
                        .value = fault.size,
                        .unit = UnitOf(fault.kind),
                        .advice = fault.what});
  }
  return findings;
}

}  // namespace rigcal::server
