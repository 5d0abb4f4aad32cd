// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/event_observation_source.h"

#include <spdlog/spdlog.h>

#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

constexpr uint64_t kSilentDetections = 1000;  // then it is not chance that nothing blinks
constexpr uint64_t kOneSwitchWands = 20;      // likewise that pixels answer one switch only

}  // namespace

absl::Status EventObservationSource::Start(const Target& target) {
  if (target.board.empty()) RIGCAL_RETURN_IF_ERROR(CheckIsLine(target));
  ended_ = true;
  board_.reset();
  detector_.reset();
  past_faults_ = EventFaults();
  past_counts_ = BlinkWandCounts();
  first_faults_.clear();
  first_epoch_ = 0;
  last_epoch_ = 0;
  without_blob_ = 0;
  has_blob_ = warned_of_two_ = warned_of_band_ = warned_of_one_switch_ = false;
  losses_ = EventLossReport();
  light_code_.Clear();
  lamp_samples_.clear();
  found_.clear();
  next_ = 0;
  if (!target.board.empty()) {
    RIGCAL_ASSIGN_OR_RETURN(board_, EventBoardWatch::Create(target, description()));
    RIGCAL_RETURN_IF_ERROR(events_->Start(target));
    ended_ = false;
    return absl::OkStatus();
  }
  // Fails now if the detector cannot work, whatever the format will be.
  RIGCAL_RETURN_IF_ERROR(BlinkWandDetector::Create(options_, target, description(),
                                                   EventFormat::kEvt3, /*halves_swapped=*/false)
                             .status());
  if (target.blink_hz.empty()) {
    spdlog::warn(
        "camera {}: the target has no blink frequency; {} Hz is assumed: add "
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
  if (chunk) {
    RIGCAL_RETURN_IF_ERROR(board_ ? board_->Take(*chunk, &found_) : Detect(*chunk));
  } else if (board_) {
    ended_ = true;
    RIGCAL_RETURN_IF_ERROR(board_->Finish(&found_));
  } else {
    ended_ = true;
    if (detector_) detector_->Finish(&found_);
    CountEpochs(0);
    LogLosses(/*is_end=*/true);
  }
  return true;
}

absl::Status EventObservationSource::Detect(const EventChunk& chunk) {
  if (chunk.clock_began_anew && detector_) FinishDetector();
  if (!detector_) {
    RIGCAL_ASSIGN_OR_RETURN(
        detector_, BlinkWandDetector::Create(options_, target_, description(), chunk.format,
                                             chunk.halves_swapped));
    detector_offset_ = chunk.byte_offset;
  }
  const size_t first_found = found_.size();
  const uint32_t epoch = last_epoch_;
  detector_->Take(chunk.bytes, &found_);
  CountEpochs(first_found);
  TakeLampReadings(/*is_one_epoch=*/last_epoch_ == epoch);
  // Now, while the source still knows the place of these bytes.
  for (const auto& [name, offset] : detector_->fault_places()) {
    if (first_faults_.contains(name)) continue;
    first_faults_.emplace(name, events_->PlaceOf(detector_offset_ + offset));
  }
  return absl::OkStatus();
}

void EventObservationSource::FinishDetector() {
  detector_->Finish(&found_);
  CountEpochs(0);
  past_faults_ = AllFaults();
  past_counts_ = AllCounts();
  detector_.reset();
  first_epoch_ = last_epoch_ + 1;
}

void EventObservationSource::CountEpochs(size_t first_found) {
  for (size_t i = first_found; i < found_.size(); ++i) {
    found_[i].observation.clock_epoch += first_epoch_;
    last_epoch_ = found_[i].observation.clock_epoch;
  }
  WarnOfScene(first_found);
}

// A sample is of the epoch of the observation that it goes with; where a chunk has two, it is not
// known which one that will be.
void EventObservationSource::TakeLampReadings(bool is_one_epoch) {
  for (const LampReading& reading : detector_->TakeLampReadings()) {
    if (!is_one_epoch || reading.time_us < 0) continue;
    lamp_samples_.push_back(
        {.device_ns = 1000 * reading.time_us,
         .uncertainty_ns = static_cast<uint32_t>(std::lround(1e3 * reading.sigma_us)),
         .light = kLamps,
         .light_ns = std::llround(1e3 * reading.period_us)});
  }
}

void EventObservationSource::WarnOfScene(size_t first_found) {
  const std::string& camera = description().camera;
  for (size_t i = first_found; i < found_.size(); ++i) {
    if (found_[i].outcome == DetectionOutcome::kAmbiguous) WarnOfRivals();
    has_blob_ |= found_[i].blob_count > 0;
    if (!has_blob_ && ++without_blob_ == kSilentDetections) {
      spdlog::warn(
          "camera {}: nothing blinks at the wand's frequency in the first {} detections; is the "
          "wand on, does it blink as the target's hz= says, and is it both lit and dark for longer "
          "than the sensor's refractory period in each blink?",
          camera, kSilentDetections);
    }
  }
  LogLosses(/*is_end=*/false);
  const BlinkWandCounts counts = AllCounts();
  if (counts.by_rise + counts.by_fall < kOneSwitchWands || warned_of_one_switch_) return;
  warned_of_one_switch_ = true;
  const bool is_rise = counts.by_rise > counts.by_fall;
  spdlog::warn(
      "camera {}: pixels answer only the {} of the wand's light: it is {} for a shorter time than "
      "the sensor's refractory period. Centres of a moving wand are known to 0.1 px along the "
      "motion, and the time offset to 0.2 ms. For more set the duty cycle nearer to 50 %, lower "
      "the blink frequency, or shorten the refractory period",
      camera, is_rise ? "rise" : "fall", is_rise ? "on" : "off");
}

void EventObservationSource::WarnOfRivals() {
  if (warned_of_two_ && warned_of_band_) return;
  const BlinkWandCounts counts = AllCounts();
  const uint64_t ambiguous = counts.by_outcome.Of(DetectionOutcome::kAmbiguous);
  const bool is_band = 2 * counts.banded > ambiguous;
  if (std::exchange(is_band ? warned_of_band_ : warned_of_two_, true)) return;
  if (is_band) {
    spdlog::warn(
        "camera {}: lights of about {} Hz are in view beside the wand, within the band of +-{:.0f} "
        "% around its blink frequency in which lights are taken for markers; such observations are "
        "left empty (counted as ambiguous). Add band={:.2g} to the camera's options, which leaves "
        "these lights out, or switch them off",
        description().camera, counts.other_hz / counts.banded, 100 * options_.band_rel,
        1e-4 * static_cast<double>(counts.band_10000) / static_cast<double>(counts.banded));
    return;
  }
  spdlog::warn(
      "camera {}: more than one wand of this blink frequency is in view, or a mirror image of it; "
      "such observations are left empty (counted as ambiguous). Leave one, or give the wands "
      "frequencies that differ by a quarter",
      description().camera);
}

void EventObservationSource::LogLosses(bool is_end) {
  for (const std::string& warning : losses_.Take(AllCounts(), is_end)) {
    spdlog::warn("camera {}: {}", description().camera, warning);
  }
}

EventFaults EventObservationSource::AllFaults() const {
  EventFaults all = past_faults_;
  if (detector_) all += detector_->faults();
  if (board_) all += board_->faults();
  return all;
}

BlinkWandCounts EventObservationSource::AllCounts() const {
  BlinkWandCounts all = past_counts_;
  if (detector_) all += detector_->counts();
  return all;
}

absl::StatusOr<std::optional<Observation>> EventObservationSource::Next() {
  while (next_ == found_.size()) {
    RIGCAL_ASSIGN_OR_RETURN(const bool more, TakeChunk());
    if (!more) return std::nullopt;
  }
  light_code_.Look(description().camera, found_[next_]);
  return std::move(found_[next_++].observation);
}

std::vector<ClockSample> EventObservationSource::TakeClockSamples() {
  std::vector<ClockSample> samples = events_->TakeClockSamples();
  const std::vector<ClockSample> of_light = light_code_.Take();
  samples.insert(samples.end(), of_light.begin(), of_light.end());
  samples.insert(samples.end(), lamp_samples_.begin(), lamp_samples_.end());
  lamp_samples_.clear();
  return samples;
}

std::optional<DetectionCounts> EventObservationSource::detection_counts() const {
  return board_ ? board_->by_outcome() : AllCounts().by_outcome;
}

std::vector<Refusal> EventObservationSource::Refused() const {
  RefusalCounter all;
  for (const Refusal& refusal : events_->Refused()) all.Add(refusal);
  const EventFaults faults = AllFaults();
  const BlinkWandCounts counts = AllCounts();
  const auto add = [&](RefusalReason reason, uint64_t count, const char* name,
                       const std::string& what) {
    const auto first = first_faults_.find(name);
    all.Add("", reason, count,
            first == first_faults_.end() ? what
                                         : absl::StrCat(what, "; the first one: ", first->second));
  };
  add(RefusalReason::kEventUnknownWord, faults.unknown_words, "unknown_words",
      "invalid words or times: damaged, or not the format of the header");
  add(RefusalReason::kEventOutsideGeometry, faults.outside_geometry, "outside_geometry",
      absl::StrCat("events of pixels that a sensor of ", description().image_size_px.width, "x",
                   description().image_size_px.height, " does not have; is its geometry right?"));
  add(RefusalReason::kEventBeforeTime, faults.before_time, "before_time",
      "events before the first time word");
  add(RefusalReason::kEventTruncatedBytes, faults.truncated_bytes, "truncated_bytes",
      "the stream ends within a word");
  all.Add("", RefusalReason::kEventTriggerTooDense, counts.dense_triggers,
          "triggers less than 0.4 ms apart: noise at the trigger input?");
  all.Add(
      "", RefusalReason::kEventDetectionWithoutData, counts.beyond_data,
      "observations at the fixed rate left out: the clock jumps ahead by more of them than there "
      "are events for");
  all.Add("", RefusalReason::kEventDetectionOutOfOrder, counts.out_of_order,
          "observations older than the previous one");
  return all.List();
}

}  // namespace rigcal::agent
