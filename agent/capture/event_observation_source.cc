// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/event_observation_source.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <limits>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

uint32_t Clamped(uint64_t count) {
  return static_cast<uint32_t>(std::min<uint64_t>(count, std::numeric_limits<uint32_t>::max()));
}

}  // namespace

absl::StatusOr<std::unique_ptr<EventObservationSource>> EventObservationSource::Create(
    std::unique_ptr<EventSource> events, BlinkWandDetectorOptions options) {
  if (const absl::Status status = options.Validate(); !status.ok()) {
    return absl::InvalidArgumentError(
        absl::StrCat("camera ", events->description().camera, ": ", std::string(status.message())));
  }
  return std::unique_ptr<EventObservationSource>(
      new EventObservationSource(std::move(events), std::move(options)));
}

EventObservationSource::EventObservationSource(std::unique_ptr<EventSource> events,
                                               BlinkWandDetectorOptions options)
    : events_(std::move(events)), options_(std::move(options)) {}

absl::Status EventObservationSource::Start(const Target& target) {
  ended_ = true;
  detector_.reset();
  found_.clear();
  next_ = 0;
  // Says at once what a detector cannot do, whatever the format will be.
  RIGCAL_RETURN_IF_ERROR(BlinkWandDetector::Create(options_, target, description(),
                                                   EventFormat::kEvt3, /*halves_swapped=*/false)
                             .status());
  if (target.blink_hz.empty()) {
    spdlog::warn(
        "camera {}: the target does not say how fast its markers blink; {} Hz are assumed: add "
        ";hz=RATE to the target",
        description().camera, options_.blink_hz);
  }
  target_ = target;
  RIGCAL_RETURN_IF_ERROR(events_->Start(target));
  ended_ = false;
  return absl::OkStatus();
}

absl::StatusOr<bool> EventObservationSource::TakeChunk() {
  found_.clear();
  next_ = 0;
  if (ended_) return false;
  RIGCAL_ASSIGN_OR_RETURN(const std::optional<EventChunk> chunk, events_->Next());
  if (!chunk) {
    ended_ = true;
    if (detector_) detector_->Finish(&found_);
    return true;
  }
  if (!detector_) {
    RIGCAL_ASSIGN_OR_RETURN(
        detector_, BlinkWandDetector::Create(options_, target_, description(), chunk->format,
                                             chunk->halves_swapped));
  }
  detector_->Take(chunk->bytes, &found_);
  return true;
}

absl::StatusOr<std::optional<Observation>> EventObservationSource::Next() {
  while (next_ == found_.size()) {
    RIGCAL_ASSIGN_OR_RETURN(const bool more, TakeChunk());
    if (!more) return std::nullopt;
  }
  return std::move(found_[next_++].observation);
}

std::optional<DetectionCounts> EventObservationSource::detection_counts() const {
  return detector_ ? detector_->counts().by_outcome : DetectionCounts();
}

std::vector<Refusal> EventObservationSource::Refused() const {
  RefusalCounter all;
  for (const Refusal& refusal : events_->Refused()) all.Add(refusal);
  if (!detector_) return all.List();
  const EventFaults& faults = detector_->faults();
  const BlinkWandCounts& counts = detector_->counts();
  all.Add("", "event_unknown_word", Clamped(faults.unknown_words),
          "words that the format does not have: damaged, or another format than the header says");
  all.Add(
      "", "event_outside_geometry", Clamped(faults.outside_geometry),
      absl::StrCat("events of pixels that a sensor of ", description().image_size_px.width, "x",
                   description().image_size_px.height, " does not have; is its geometry right?"));
  all.Add("", "event_before_time", Clamped(faults.before_time),
          "events ahead of the first word that tells the time");
  all.Add("", "event_truncated_bytes", Clamped(faults.truncated_bytes),
          "the stream ends within a word");
  all.Add("", "event_trigger_too_dense", Clamped(counts.dense_triggers),
          "triggers less than 0.4 ms apart: noise at the trigger input?");
  all.Add("", "event_out_of_order", Clamped(counts.out_of_order),
          "observations older than the one told before");
  return all.List();
}

}  // namespace rigcal::agent
