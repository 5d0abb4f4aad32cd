// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "absl/status/statusor.h"
#include "common/camera/camera_description.h"
#include "common/camera/frame_counts.h"
#include "common/status/refusal.h"
#include "common/target/detection_outcome.h"
#include "common/target/observation.h"
#include "common/target/target.h"

namespace rigcal::agent {

class DetectorControl;
class PreviewTap;

// One camera's observations in capture order. Recorded and simulated cameras yield them directly; a
// camera that yields frames or events has a detector between it and this interface.
//
// Start, Next, the takers and the getters are called by one thread; Stop,
// preview_tap and detector_control by any.
class ObservationSource {
 public:
  virtual ~ObservationSource() = default;

  // Valid from construction on, never changes.
  virtual const CameraDescription& description() const = 0;

  // Begins a capture of `target`, from the beginning where there is one.
  // INVALID_ARGUMENT: this source cannot show that target (a recording with another marker count).
  virtual absl::Status Start(const Target& target) = 0;

  // The next observation; waits for it where the source has a pace. None: the source has ended or
  // was stopped. An error ends the capture.
  virtual absl::StatusOr<std::optional<Observation>> Next() = 0;

  // Makes a waiting and every later Next return none, until the next Start.
  virtual void Stop() = 0;

  // Readings of the camera's clock since the last call; they belong to the epoch of the observation
  // yielded last.
  virtual std::vector<ClockSample> TakeClockSamples() { return {}; }

  // Refused since Start, by reason. `camera` is left empty.
  virtual std::vector<Refusal> Refused() const { return {}; }

  // Counts of frames and of detections since Start. None: the source has no frames, or no detector.
  virtual std::optional<FrameCounts> frame_counts() const { return std::nullopt; }
  virtual std::optional<DetectionCounts> detection_counts() const { return std::nullopt; }

  // For requests of frames by any thread; lives as long as the source. Null: the source has no
  // frames.
  virtual PreviewTap* preview_tap() { return nullptr; }

  // To change the detector while it runs, by any thread; lives as long as the source. Null: the
  // source has no detector of frames.
  virtual DetectorControl* detector_control() { return nullptr; }
};

}  // namespace rigcal::agent
