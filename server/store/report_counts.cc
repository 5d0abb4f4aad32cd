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
