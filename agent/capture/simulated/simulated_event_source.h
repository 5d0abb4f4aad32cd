// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "agent/capture/simulated/simulated_camera.h"
#include "agent/event/event_source.h"
#include "agent/event/evt3_writer.h"
#include "common/simulation/events/event_board_scene.h"
#include "common/simulation/events/event_render_options.h"
#include "common/simulation/events/event_renderer.h"
#include "common/simulation/frames/frame_render_options.h"

namespace rigcal::agent {

struct SimulatedEventSourceOptions : SimulatedCameraOptions {
  FrameRenderOptions scene;      // its light and LEDs
  EventRenderOptions rendering;  // the sensor
  bool held_before = false;      // a blinking board is held right before this camera
  std::string clock_id;          // sensors on one sync cable share one; empty: the camera's own

  // INVALID_ARGUMENT with every fault.
  absl::Status Validate() const;
};

void AddOptions(SimulatedEventSourceOptions* options, OptionTable* table);

// The events of an event camera in the pose of one camera of a simulated world, as EVT 3.0 words
// with times of that camera's clock. The sensor has 1280x720 pixels and the vertical field of view
// of the frame camera. The target is a wand or a point; or a board of circles on a screen that
// blinks, which is held before the camera for its lens, a second at each of many places.
class SimulatedEventSource : public SimulatedSource<EventSource, SimulatedEventSourceOptions> {
 public:
  using SimulatedSource::SimulatedSource;
  static absl::StatusOr<std::unique_ptr<SimulatedEventSource>> Create(
      SimulatedEventSourceOptions options);

  absl::Status Start(const Target& target) override;
  absl::StatusOr<std::optional<EventChunk>> Next() override;

  // Everything before it was emitted, on the camera's clock. Once started.
  int64_t time_us() const { return StampUs(now_us()); }
  // Ground truth of the markers at a time of that clock; none in a gap. Once started.
  std::vector<MarkerGroundTruth> TruthAt(int64_t time_us) const;

 private:
  std::optional<WandPose> WandInCamera(double rig_time_s) const;
  int64_t StampUs(int64_t rig_time_us) const;
  absl::Status StartBoard(const Target& target);
  int64_t now_us() const { return board_ ? board_us_ : renderer_->time_us(); }
  void Encode();

  std::optional<EventRenderer> renderer_;  // of the wand
  std::optional<EventBoardScene> board_;
  int64_t board_us_ = 0;  // until when the board is rendered
  Evt3Writer writer_;
  std::vector<SimulatedEvent> events_;
  std::vector<SimulatedTrigger> triggers_;
  std::vector<CdEvent> run_;
  std::vector<uint8_t> bytes_;
  uint64_t byte_offset_ = 0;
  int next_sample_ = 0;  // second of the wave
};

}  // namespace rigcal::agent
