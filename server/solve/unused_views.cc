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
    // The rows are used.
    case RefusalReason::kLightCodeTooFast:
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
    case StampFault::Kind::kTwice:
      return FindingKind::kRowsRepeated;
    case StampFault::Kind::kCopied:
      return FindingKind::kRowsCopied;
    case StampFault::Kind::kFrozen:
      return FindingKind::kRowsFrozen;
    case StampFault::Kind::kFarClock:
      return FindingKind::kClockFoundByMotion;
    case StampFault::Kind::kAtOrigin:
      return FindingKind::kMarkersAtOrigin;
    case StampFault::Kind::kLightContradicts:
      return FindingKind::kLightCodeContradicts;
    case StampFault::Kind::kOtherWand:
      return FindingKind::kOtherWandSeen;
    case StampFault::Kind::kSetByLight:
      return FindingKind::kClockByLightCode;
    case StampFault::Kind::kWandRate:
      return FindingKind::kWandClockWrong;
  }
  return FindingKind::kUnspecified;
}

const char* UnitOf(StampFault::Kind kind) {
  switch (kind) {
    case StampFault::Kind::kSteps:
    case StampFault::Kind::kSetByLight:
      return "s";
    case StampFault::Kind::kOutOfOrder:
    case StampFault::Kind::kTwice:
      return "rows";
    case StampFault::Kind::kAtOrigin:
      return "markers";
    case StampFault::Kind::kFarClock:
      return "ms";
    case StampFault::Kind::kRepeat:
    case StampFault::Kind::kBursts:
    case StampFault::Kind::kCopied:
    case StampFault::Kind::kFrozen:
    case StampFault::Kind::kLightContradicts:
    case StampFault::Kind::kWandRate:
      return "%";
    case StampFault::Kind::kOtherWand:
      return "";
  }
  return "";
}

// Something else says why views have no other camera's beside them.
bool IsExplained(const std::map<std::string, CameraCounts>& counts,
                 const CalibrationResult& result) {
  for (const auto& [name, count] : counts) {
    if (std::ranges::count(result.cameras, name, &CalibratedCamera::camera) == 0) return true;
  }
  return std::ranges::any_of(result.findings, [](const Finding& finding) {
    return finding.kind == FindingKind::kRowsCopied || finding.kind == FindingKind::kRowsFrozen ||
           finding.kind == FindingKind::kStampsJitter;
  });
}

}  // namespace

std::vector<UnusedViews> CountUnusedViews(const std::map<std::string, CameraCounts>& counts,
                                          const std::vector<Refusal>& refused) {
  std::vector<UnusedViews> all;
  for (const auto& [name, count] : counts) {
    UnusedViews views{.camera = name, .all = count.wand_count};
    for (const Refusal& refusal : refused) {
      if (refusal.camera != name || !LosesViews(refusal.reason)) continue;
      views.lost += refusal.count;
      // What an agent or the server could not read is not among the rows of the input.
      if (IsUnread(refusal.reason)) views.all += refusal.count;
      if (views.most == nullptr || refusal.count > views.most->count) views.most = &refusal;
    }
    views.lost = std::min(views.lost, views.all);
    all.push_back(views);
  }
  return all;
}

void NoteUnusedViews(const std::map<std::string, CameraCounts>& counts,
                     const std::vector<Refusal>& refused, CalibrationResult* result) {
  const bool is_explained = IsExplained(counts, *result);
  for (const UnusedViews& views : CountUnusedViews(counts, refused)) {
    // A camera that was left out has a finding of its own.
    if (std::ranges::count(result->cameras, views.camera, &CalibratedCamera::camera) == 0) continue;
    if (views.most == nullptr || views.all == 0) continue;
    if (is_explained && views.most->reason == RefusalReason::kAloneInInstant) continue;
    const double share = static_cast<double>(views.lost) / static_cast<double>(views.all);
    if (share <= kGoodWithoutViews) continue;
    Finding& finding = result->findings.emplace_back();
    finding.kind = FindingKind::kViewsNotUsed;
    finding.camera = views.camera;
    finding.value = 100 * share;
    finding.unit = "%";
    finding.severity =
        share > kUsableWithoutViews ? FindingSeverity::kError : FindingSeverity::kWarning;
    finding.advice =
        absl::StrCat(views.lost, " of its ", views.all, " wand views are not used, ",
                     views.most->count, " of them as ", std::string(NameOf(views.most->reason)),
                     views.most->example.empty() ? "" : absl::StrCat(": ", views.most->example));
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
