// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/camera/intrinsics.h"
#include "common/simulation/events/event_clutter.h"
#include "common/simulation/events/event_noise.h"
#include "common/simulation/events/event_pixels.h"
#include "common/simulation/events/event_readout.h"
#include "common/simulation/events/event_render_options.h"
#include "common/simulation/events/event_spheres.h"
#include "common/simulation/frames/frame_render_options.h"
#include "common/target/target.h"

namespace rigcal {

// An edge at the sensor's trigger input.
struct SimulatedTrigger {
  int64_t time_us = 0;
  bool rising = false;
};

// The view of one event camera of the world of SceneRenderer: the same room, lens, spheres and
// LEDs. Pixels near a sphere, a moving edge or a lamp are followed through their low pass; all
// others only make noise. Deterministic: equal arguments give equal events, however the time is cut
// into slices. One thread at a time.
class EventRenderer {
 public:
  // Pixels are followed by cells, cut so that spheres and edges move by at most 0.35 px and lamps
  // go on by a sixteenth of their period in a part, within which ln(light) is taken as linear.
  static constexpr int64_t kCellUs = 1000;

  // `scene`: light, lens blur, room and LEDs (exposure and sensor noise are not used but for the
  // scale of light); markers blink at the target's frequencies, or the scene's where it has none.
  // INVALID_ARGUMENT: intrinsics, image size (sides up to 2048), target or options not valid.
  static absl::StatusOr<EventRenderer> Create(const Intrinsics& intrinsics,
                                              const ImageSize& image_size, const Target& target,
                                              const FrameRenderOptions& scene,
                                              const EventRenderOptions& options);

  // Up to where time has been rendered; 0 at first.
  int64_t time_us() const { return now_us_; }
  // Renders up to `end_us`, a multiple of kCellUs, and appends in order of time.
  // INVALID_ARGUMENT: no such multiple, before time_us(), or the wand's motion is not finite.
  absl::Status Render(int64_t end_us, const WandPath& wand, std::vector<SimulatedEvent>* events,
                      std::vector<SimulatedTrigger>* triggers);

  // Projections of the spheres' centres, whether inside, and radius.
  std::vector<MarkerGroundTruth> TruthOf(const WandPose& wand) const {
    return spheres_.TruthOf(wand);
  }

 private:
  struct RowSpan {
    uint32_t y = 0;
    PixelSpan columns;
  };
  EventRenderer(SphereImager imager, const Target& target, const FrameRenderOptions& scene,
                const EventRenderOptions& options);
  void AddTriggers(int64_t end_us, std::vector<SimulatedTrigger>* triggers) const;
  absl::Status RenderCell(const WandPath& path, std::vector<SimulatedEvent>* events);
  void FollowClutter();
  void FollowSpans(std::span<const RowSpan> spans, std::span<const EventClutter::Instant> instants);
  void LogLight(std::span<const RowSpan> spans, const EventClutter::Instant& instant);
  void InstantsOf(std::span<EventClutter::Instant> instants) const;

  ImageSize size_;
  double trigger_hz_;
  EdgeProfile profile_;
  EventLight light_;
  EventSpheres spheres_;
  EventClutter clutter_;
  EventNoise noise_;
  EventPixels pixels_;
  EventReadout readout_;
  std::vector<EventClutter::Instant> sphere_instants_, bar_instants_, lamp_instants_;
  std::vector<PixelSpan> sphere_spans_, lamp_spans_, bar_spans_;
  std::vector<RowSpan> lamp_rows_, bar_rows_;
  std::vector<float> log_light_;
  std::vector<NoiseEvent> noise_events_;
  std::vector<PixelRequest> requests_;
  int64_t now_us_ = 0;
};

}  // namespace rigcal
