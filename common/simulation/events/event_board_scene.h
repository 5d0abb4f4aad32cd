// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "common/board/board.h"
#include "common/camera/intrinsics.h"
#include "common/geometry/rigid_transform.h"
#include "common/simulation/events/event_noise.h"
#include "common/simulation/events/event_pixels.h"
#include "common/simulation/events/event_readout.h"
#include "common/simulation/events/event_render_options.h"

namespace rigcal {

// How a board of circles is lit, in linear light of which white is 1.
struct EventBoardLight {
  // A screen, white discs on black, drawn from top (y = 0 of the board) to bottom in 95 % of a
  // refresh. 0: a print, black discs on white, that is always there.
  double refresh_hz = 60;
  int blink_refreshes = 6;  // the discs are shown for so long, then hidden for as long
  double response_ms = 5;   // time constant of a liquid crystal; 0: an OLED
  double pwm_hz = 0;        // of the backlight, lit for one half of its periods ...
  double pwm_depth = 0;     // ... and so much darker in the other
  double oled_dip = 0;      // share of each refresh that a row of an OLED is dark for
  double black = 0.003;     // of the screen's black, or 0.04 of ink
  double ambient = 0.02;    // reflected
  // A lamp's reflection: its middle's light, and where in the image it is.
  double glare = 0;
  Eigen::Vector2d glare_px{800, 300};
  double glare_radius_px = 60;
  // A lamp beside the board.
  double lamp_hz = 0;
  Eigen::Vector2d lamp_px{60, 60};
};

// The board in frame `cam`.
using BoardPath = std::function<RigidTransform(double time_s)>;

// From pose to pose, `seconds` for each: `rest` of that it stands still but for a tremor of the
// hand of about 0.3 mm, then it moves on.
BoardPath HandHeld(std::vector<RigidTransform> poses, double seconds, double rest);
// The same without a rest and at an even speed: a board that is waved.
BoardPath Waved(std::vector<RigidTransform> poses, double seconds);

// What an event camera sees of a board of circles: the light of all pixels at the discs, with the
// lens's blur, through photoreceptors, comparators and the readout of common/simulation/events.
class EventBoardScene {
 public:
  EventBoardScene(const Board& board, const Intrinsics& lens, const ImageSize& image,
                  const EventBoardLight& light, const EventRenderOptions& pixels, BoardPath path);

  // Appends the events from the last call's end on.
  void Render(int64_t end_us, std::vector<SimulatedEvent>* events);
  // Centroids of the images of all discs, without the lens's blur.
  std::vector<Eigen::Vector2d> TruthAt(double time_s) const;

 private:
  struct Patch {
    int left = 0, top = 0, right = -1, bottom = -1;
  };
  Eigen::Vector3f RayAt(float x, float y) const;
  double ShownAt(double time_s, double row_share) const;  // 0 to 1
  double BacklightAt(double time_s, double row_share) const;
  int64_t StepUs(int64_t now_us) const;
  void Step(int64_t end_us);
  void AddLamp(double time_s);
  void DrawDisc(size_t disc, const RigidTransform& board_from_cam, const RigidTransform& pose,
                double time_s);
  float LogLight(int x, int y, float shown, float backlight) const;

  const Board board_;
  const Intrinsics lens_;
  const ImageSize size_;
  const EventBoardLight light_;
  const BoardPath path_;
  const std::vector<Eigen::Vector3d> points_;
  EventNoise noise_;
  EventPixels pixels_;
  EventReadout readout_;
  int ray_columns_ = 0;
  std::vector<Eigen::Vector3f> rays_;
  std::vector<float> glare_;      // by pixel
  std::vector<Patch> patches_;    // of the last step, by disc
  std::vector<Patch> drawn_;      // of this one, with the last one's
  std::vector<float> light_now_;  // ln, by pixel, where `stamp_` is that of this step
  std::vector<int64_t> stamp_, added_;
  std::vector<NoiseEvent> noise_events_;
  std::vector<PixelRequest> requests_;
  int64_t now_us_ = 0;
};

}  // namespace rigcal
