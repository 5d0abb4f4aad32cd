// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/event/blink_detections.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

namespace rigcal::agent {

BlinkDetections::BlinkDetections(double period_us, absl::InlinedVector<double, 3> marker_period_us,
                                 BlinkWandCounts* counts)
    : hold_us_(static_cast<int64_t>(kHoldPeriods * period_us)),
      marker_period_us_(std::move(marker_period_us)),
      counts_(counts) {}

void BlinkDetections::Take(const OutputTime& asked, BlinkWand wand, std::vector<Detection>* found) {
  Detection detection;
  detection.outcome = wand.outcome;
  detection.confidence = wand.confidence;
  detection.blob_count = wand.blob_count;
  detection.light_level = wand.lit_share;
  Observation& observation = detection.observation;
  observation.time_ns = asked.time_us * 1000;
  observation.clock_epoch = clock_epoch_;
  if (wand.outcome == DetectionOutcome::kWand) {
    observation.markers = std::move(wand.markers);
    detection.occluded_markers =
        static_cast<int>(marker_period_us_.size()) - observation.VisibleCount();
    if (!SetTimes(asked, wand, &observation)) {
      ++counts_->same_burst;
      return;
    }
  } else {
    observation.markers.resize(marker_period_us_.size());
  }
  const auto after = std::upper_bound(
      held_.begin(), held_.end(), observation.time_ns,
      [](int64_t time_ns, const Detection& other) { return time_ns < other.observation.time_ns; });
  held_.insert(after, std::move(detection));
  Release((asked.due_us - hold_us_) * 1000, found);
}

void BlinkDetections::Finish(std::vector<Detection>* found) {
  Release(std::numeric_limits<int64_t>::max(), found);
}

void BlinkDetections::StepBack(std::vector<Detection>* found) {
  Finish(found);
  last_burst_us_.clear();
  last_emitted_ns_.reset();
  ++clock_epoch_;
}

bool BlinkDetections::SetTimes(const OutputTime& asked, const BlinkWand& wand,
                               Observation* observation) {
  constexpr double kWrapUs = 4294967296.0;
  const auto due = static_cast<double>(static_cast<uint32_t>(asked.due_us));
  absl::InlinedVector<double, 3> since_asked_us;
  double mean_us = 0;
  for (const double time_us : wand.times_us) {
    since_asked_us.push_back(std::remainder(time_us - due, kWrapUs) +
                             static_cast<double>(asked.due_us - asked.time_us));
    mean_us += since_asked_us.back() / static_cast<double>(wand.times_us.size());
  }
  const bool first = last_burst_us_.empty();
  if (first) last_burst_us_.resize(since_asked_us.size());
  if (!asked.trigger) {
    for (size_t k = 0; k < since_asked_us.size() && !first; ++k) {
      const double burst_us = static_cast<double>(asked.time_us) + since_asked_us[k];
      if (burst_us < last_burst_us_[k] + 0.5 * marker_period_us_[k]) return false;
    }
    observation->time_ns = asked.time_us * 1000 + std::llround(mean_us * 1e3);
  }
  for (size_t k = 0; k < since_asked_us.size(); ++k) {
    const double burst_us = static_cast<double>(asked.time_us) + since_asked_us[k];
    last_burst_us_[k] = first ? burst_us : std::max(last_burst_us_[k], burst_us);
  }
  const int64_t shift_ns = observation->time_ns - asked.time_us * 1000;
  for (size_t k = 0; k < observation->markers.size(); ++k) {
    observation->markers[k].time_delta_ns =
        static_cast<int32_t>(std::llround(since_asked_us[k] * 1e3) - shift_ns);
  }
  return true;
}

void BlinkDetections::Release(int64_t before_ns, std::vector<Detection>* found) {
  size_t count = 0;
  for (; count < held_.size() && held_[count].observation.time_ns < before_ns; ++count) {
    Detection& detection = held_[count];
    if (last_emitted_ns_ && detection.observation.time_ns <= *last_emitted_ns_) {
      ++counts_->out_of_order;
      continue;
    }
    last_emitted_ns_ = detection.observation.time_ns;
    counts_->by_outcome.Add(detection.outcome);
    found->push_back(std::move(detection));
  }
  held_.erase(held_.begin(), held_.begin() + static_cast<std::ptrdiff_t>(count));
}

}  // namespace rigcal::agent
