// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "agent/detect/event/blink_filter.h"
#include "agent/detect/event/blink_wand_counts.h"
#include "agent/detect/event/lamp_flicker.h"
#include "agent/detect/event/output_schedule.h"
#include "agent/event/fault_locator.h"
#include "agent/identify/detection.h"
#include "agent/identify/wand_finder.h"

namespace rigcal::agent {

struct BlinkWandDetectorOptions : BlinkTuning, WandLimits {
  OutputTimesOptions output;
  double blink_hz = 500;  // for a target without frequencies; 20 to 5000

  // Every fault.
  absl::Status Validate() const;
};

// Finds the wand in the events of one camera: encoded words to pixels that blink, to bursts of
// light of each marker, to the wand; at the times of OutputSchedule. Each detection
// holds the burst nearest to its time. At the fixed rate observation.time_ns is the time its light
// centred on; at a trigger it is the trigger's, and each marker's time_delta_ns leads to its light.
// A trigger and the fixed rate may yield the same burst. Markers that blink at frequencies of their
// own are identified by them, each in a burst of its own; frequencies within 2 % count as one.
// Where there is no wand every marker is invisible.
//
// With intrinsics and the spheres' diameter a centre is the projection of the sphere's centre. A
// clock that steps back begins a new clock epoch; within one, times strictly increase. Movable; one
// thread at a time.
class BlinkWandDetector {
 public:
  // INVALID_ARGUMENT: options, target or camera not valid, or markers that blink at frequencies
  // that differ but are too close (BlinkFilterOptions); names the camera.
  static absl::StatusOr<BlinkWandDetector> Create(const BlinkWandDetectorOptions& options,
                                                  const Target& target,
                                                  const CameraDescription& camera,
                                                  EventFormat format, bool halves_swapped);
  BlinkWandDetector(BlinkWandDetector&&) noexcept;
  BlinkWandDetector& operator=(BlinkWandDetector&&) noexcept;
  ~BlinkWandDetector();

  // Decodes whole words and appends detections, about four periods after their times.
  void Take(std::span<const uint8_t> bytes, std::vector<Detection>* found);
  // The stream has ended: appends what is still held back.
  void Finish(std::vector<Detection>* found);

  // When lamps flickered, in the order of the stream; those that were not taken before. Within a
  // clock epoch: a step back, or a silence of some blinks, begins anew.
  std::vector<LampReading> TakeLampReadings();

  const EventFaults& faults() const;
  // Of the first fault of each kind, counted from the first byte taken.
  const FaultPlaces& fault_places() const;
  const BlinkWandCounts& counts() const;

 private:
  struct Impl;
  explicit BlinkWandDetector(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace rigcal::agent
