// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "agent/capture/event_board_watch.h"
#include "agent/capture/event_loss_report.h"
#include "agent/capture/light_code_reader.h"
#include "agent/capture/observation_source.h"
#include "agent/detect/event/blink_wand_detector.h"
#include "agent/event/event_source.h"
#include "common/status/refusal.h"

namespace rigcal::agent {

// Observations of a camera that yields events: one for each detection of BlinkWandDetector, or of
// EventBoardWatch where the target is a board; empty if it is not found. Refused counts faults of
// the stream (event_unknown_word, event_outside_geometry, event_before_time, event_truncated_bytes)
// and of the detections (event_trigger_too_dense, event_detection_without_data,
// event_detection_out_of_order).
class EventObservationSource : public ObservationSource {
 public:
  EventObservationSource(std::unique_ptr<EventSource> events, BlinkWandDetectorOptions options)
      : events_(std::move(events)), options_(std::move(options)) {}

  const CameraDescription& description() const override { return events_->description(); }
  absl::Status Start(const Target& target) override;
  absl::StatusOr<std::optional<Observation>> Next() override;
  void Stop() override { events_->Stop(); }
  std::vector<ClockSample> TakeClockSamples() override;
  std::vector<Refusal> Refused() const override;
  std::optional<DetectionCounts> detection_counts() const override;

 private:
  // More detections; false: there will be none.
  absl::StatusOr<bool> TakeChunk();
  absl::Status Detect(const EventChunk& chunk);
  void FinishDetector();  // keeps its counts
  void CountEpochs(size_t first_found);
  void TakeLampReadings(bool is_one_epoch);
  // Once each: two wands in view, nothing that blinks so.
  void WarnOfScene(size_t first_found);
  void WarnOfRivals();
  void LogLosses(bool is_end);
  EventFaults AllFaults() const;
  BlinkWandCounts AllCounts() const;

  const std::unique_ptr<EventSource> events_;
  const BlinkWandDetectorOptions options_;
  Target target_;
  std::optional<EventBoardWatch> board_;       // of a session whose target is a board
  std::optional<BlinkWandDetector> detector_;  // from the first chunk on, which has the format
  // Of earlier detectors: the clock restarted in between.
  EventFaults past_faults_;
  BlinkWandCounts past_counts_;
  uint64_t detector_offset_ = 0;  // in the stream, of the first byte the detector took
  std::map<std::string, std::string, std::less<>> first_faults_;  // by kind: its place
  uint32_t first_epoch_ = 0;                                      // of the detector
  uint32_t last_epoch_ = 0;                                       // emitted so far
  std::vector<Detection> found_;
  size_t next_ = 0;  // of found_
  bool ended_ = true;
  uint64_t without_blob_ = 0;  // detections in a row, from the first one on
  bool has_blob_ = false, warned_of_two_ = false, warned_of_band_ = false;
  bool warned_of_one_switch_ = false;
  EventLossReport losses_;
  LightCodeReader light_code_;
  std::vector<ClockSample> lamp_samples_;
};

}  // namespace rigcal::agent
