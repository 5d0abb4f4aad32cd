// SPDX-License-Identifier: Apache-2.0
#include "server/store/report_counts.h"

#include <algorithm>
#include <array>
#include <variant>

namespace rigcal::server {
namespace {

struct CountName {
  std::string_view name;
  std::variant<uint64_t FrameCounts::*, DetectionOutcome> count;
};
constexpr std::array kCountNames = {
    CountName{"frames.received", &FrameCounts::received},
    CountName{"frames.damaged", &FrameCounts::damaged},
    CountName{"frames.lost", &FrameCounts::lost},
    CountName{"frames.reconnects", &FrameCounts::reconnects},
    CountName{"detections.wand", DetectionOutcome::kWand},
    CountName{"detections.no_blob", DetectionOutcome::kNoBlob},
    CountName{"detections.no_wand", DetectionOutcome::kNoWand},
    CountName{"detections.ambiguous", DetectionOutcome::kAmbiguous},
    CountName{"detections.too_many_blobs", DetectionOutcome::kTooManyBlobs},
    CountName{"detections.black", DetectionOutcome::kBlack},
    CountName{"detections.saturated", DetectionOutcome::kSaturated}};
static_assert(kCountNames.size() == 4 + kDetectionOutcomes.size());

constexpr std::string_view kSpoolLastSeq = "spool.last_seq";
constexpr std::string_view kSpoolAcknowledgedSeq = "spool.acknowledged_seq";
constexpr std::string_view kSpoolDropped = "spool.dropped.";
constexpr std::string_view kSpoolEndIsUnknown = "spool.end_is_unknown";

}  // namespace

std::vector<std::pair<std::string_view, uint64_t>> NamedCounts(const CameraReport& report) {
  std::vector<std::pair<std::string_view, uint64_t>> counts;
  for (const auto& [name, count] : kCountNames) {
    if (const auto* outcome = std::get_if<DetectionOutcome>(&count)) {
      if (report.detections) counts.emplace_back(name, report.detections->Of(*outcome));
    } else if (report.frames) {
      counts.emplace_back(name, (*report.frames).*std::get<uint64_t FrameCounts::*>(count));
    }
  }
  return counts;
}

std::vector<std::pair<std::string, uint64_t>> NamedCounts(const SpoolReport& report) {
  std::vector<std::pair<std::string, uint64_t>> counts = {
      {std::string(kSpoolLastSeq), report.last_seq},
      {std::string(kSpoolAcknowledgedSeq), report.acknowledged_seq},
      {std::string(kSpoolRows), report.spooled_count}};
  if (report.end_is_unknown) counts.emplace_back(std::string(kSpoolEndIsUnknown), 1);
  for (const Refusal& refusal : report.dropped) {
    counts.emplace_back(std::string(kSpoolDropped) + std::string(NameOf(refusal.reason)),
                        refusal.count);
  }
  return counts;
}

bool SetNamedCount(std::string_view name, uint64_t count, SpoolReport* report) {
  if (name == kSpoolLastSeq) {
    report->last_seq = static_cast<uint32_t>(count);
  } else if (name == kSpoolAcknowledgedSeq) {
    report->acknowledged_seq = static_cast<uint32_t>(count);
  } else if (name == kSpoolRows) {
    report->spooled_count = count;
  } else if (name == kSpoolEndIsUnknown) {
    report->end_is_unknown = count > 0;
  } else if (name.starts_with(kSpoolDropped)) {
    report->dropped.push_back({.camera = "",
                               .reason = RefusalReasonFromName(name.substr(kSpoolDropped.size())),
                               .count = count,
                               .example = ""});
  } else {
    return false;
  }
  return true;
}

void AddNamedCount(std::string_view name, uint64_t count, SessionCameraCounts* camera) {
  const auto known =
      std::find_if(kCountNames.begin(), kCountNames.end(),
                   [&](const CountName& candidate) { return candidate.name == name; });
  if (known == kCountNames.end()) return;
  if (const auto* outcome = std::get_if<DetectionOutcome>(&known->count)) {
    if (!camera->detections) camera->detections.emplace();
    camera->detections->Add(*outcome, count);
  } else {
    if (!camera->frames) camera->frames.emplace();
    (*camera->frames).*std::get<uint64_t FrameCounts::*>(known->count) += count;
  }
}

}  // namespace rigcal::server
