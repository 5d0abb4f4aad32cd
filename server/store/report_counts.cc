// SPDX-License-Identifier: Apache-2.0
#include "server/store/report_counts.h"

#include <array>

namespace rigcal::server {
namespace {

struct FrameName {
  std::string_view name;
  uint64_t FrameCounts::*count;
};
constexpr std::array kFrameNames = {FrameName{"frames.received", &FrameCounts::received},
                                    FrameName{"frames.damaged", &FrameCounts::damaged},
                                    FrameName{"frames.lost", &FrameCounts::lost},
                                    FrameName{"frames.reconnects", &FrameCounts::reconnects}};

struct OutcomeName {
  std::string_view name;
  DetectionOutcome outcome;
};
constexpr std::array kOutcomeNames = {
    OutcomeName{"detections.wand", DetectionOutcome::kWand},
    OutcomeName{"detections.no_blob", DetectionOutcome::kNoBlob},
    OutcomeName{"detections.no_wand", DetectionOutcome::kNoWand},
    OutcomeName{"detections.ambiguous", DetectionOutcome::kAmbiguous},
    OutcomeName{"detections.too_many_blobs", DetectionOutcome::kTooManyBlobs},
    OutcomeName{"detections.black", DetectionOutcome::kBlack},
    OutcomeName{"detections.saturated", DetectionOutcome::kSaturated}};
static_assert(kOutcomeNames.size() == kDetectionOutcomes.size());

}  // namespace

std::vector<std::pair<std::string_view, uint64_t>> NamedCounts(const CameraReport& report) {
  std::vector<std::pair<std::string_view, uint64_t>> counts;
  if (report.frames) {
    for (const FrameName& field : kFrameNames) {
      counts.emplace_back(field.name, (*report.frames).*field.count);
    }
  }
  if (report.detections) {
    for (const OutcomeName& field : kOutcomeNames) {
      counts.emplace_back(field.name, report.detections->Of(field.outcome));
    }
  }
  return counts;
}

void AddNamedCount(std::string_view name, uint64_t count, SessionCameraCounts* camera) {
  for (const FrameName& field : kFrameNames) {
    if (field.name != name) continue;
    if (!camera->frames) camera->frames.emplace();
    (*camera->frames).*field.count += count;
  }
  for (const OutcomeName& field : kOutcomeNames) {
    if (field.name != name) continue;
    if (!camera->detections) camera->detections.emplace();
    camera->detections->Add(field.outcome, count);
  }
}

}  // namespace rigcal::server
