// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "common/camera/intrinsics.h"
#include "common/simulation/events/event_clutter.h"
#include "common/simulation/events/event_pixels.h"
#include "common/simulation/frames/edge_profile.h"
#include "common/simulation/frames/frame_render_options.h"
#include "common/simulation/frames/scene_ground_truth.h"
#include "common/simulation/frames/sent_code.h"
#include "common/simulation/frames/sphere_image.h"
#include "common/simulation/world/simulated_world.h"
#include "common/target/target.h"

namespace rigcal {

// A part of a stretch of time during which an LED does not switch.
struct LightStep {
  double end_us = 0;  // since the stretch began
  bool lit = false;
};

// An LED that shines during the first `duty` of each of its periods.
struct BlinkingLed {
  double hz = 0;     // 0: it shines all the time
  double duty = 1;   // (0, 1]
  double phase = 0;  // where in its period it is at time 0, 0 to 1
  SentCode code;
  double clock_rate = 1;  // of the wand's clock, which `hz` has in it

  bool IsLit(double time_s) const;
  // Where in its period of that number it rises and falls.
  std::pair<double, double> TurnsOf(double cycle) const;
  // A stretch from switch to switch; replaces `steps`, which are never none.
  void StepsOf(double begin_us, double duration_us, std::vector<LightStep>* steps) const;
};

// The wand at a time of the simulation, in frame `cam`. None: it is not there.
using WandPath = std::function<std::optional<WandPose>(double time_s)>;

// Linear light, above nothing, of what an event camera sees.
struct EventLight {
  float led = 0;    // of a lit sphere, besides its shell
  float shell = 0;  // of a sphere's shell under the ambient light
  float dark = 0;   // of the deepest dark
};

// The blinking spheres of a wand before an event camera: their images, drawn so often in each cell
// of time that they move by at most 0.35 px in between (as far as kMaxParts allows), linear in
// ln(light) there; and the pixels they cover. One thread at a time.
class EventSpheres {
 public:
  static constexpr int kMaxParts = 8;

  EventSpheres(SphereImager imager, const EdgeProfile& profile, const Target& target,
               const FrameRenderOptions& scene, double led_phase, const EventLight& light);

  // Draws a cell. INVALID_ARGUMENT: the wand's pose is not finite.
  absl::Status DrawCell(int64_t begin_us, int64_t cell_us, const WandPath& path);
  // Into how many equal parts that cell is cut.
  int parts() const { return parts_; }
  // Appends the columns of a row that this cell's spheres take, with room for pixels to settle.
  void AddSpans(int y, std::vector<PixelSpan>* spans) const;
  // Follows those pixels through one part of the cell, 0 to parts() - 1, in order. `instants`: of
  // the clutter behind, at the part's beginning and end.
  void Follow(int part, const EventClutter& clutter, const EventClutter::Instant& begin,
              const EventClutter::Instant& end, EventPixels* pixels,
              std::vector<PixelRequest>* requests);

  std::vector<MarkerGroundTruth> TruthOf(const WandPose& wand) const;

 private:
  struct Marker {
    double position_m = 0;
    BlinkingLed led;
    SphereImage images[kMaxParts + 1];
    ImagePatch patch;             // of all, with room to settle
    std::vector<PixelSpan> rows;  // columns of each row of the patch that see anything of it
    bool alone = true;            // no other patch overlaps it
    // ln(light) at the beginning and end of a part, by pixel of the patch.
    std::vector<float> dark[2], lit[2];
    std::vector<LightStep> steps;
  };
  int PartsFor(int64_t begin_us, int64_t cell_us, const WandPath& path) const;
  absl::Status Draw(double time_s, const WandPath& path, int image);
  void Shine(const Marker& marker, const SphereImage& image, const EventClutter& clutter,
             const EventClutter::Instant& instant, std::vector<float>* dark,
             std::vector<float>* lit);
  void FindOwned(int part, const Marker& drawn);
  void FollowOwned(const Marker& marker, double begin_us, EventPixels* pixels,
                   std::vector<PixelRequest>* requests);
  void FindRows(Marker* marker) const;
  const Marker* OwnerOf(int x, int y, int part) const;

  SphereImager imager_;
  EdgeProfile profile_;
  SphereImageOptions sphere_options_;
  EventLight light_;
  int64_t begin_us_ = 0, cell_us_ = 0;
  int parts_ = 1;
  std::vector<Marker> markers_;
  struct OwnedSpan {
    int y = 0;
    PixelSpan columns;
  };
  std::vector<OwnedSpan> owned_;  // pixels that follow one marker in a part
  std::vector<float> from_, to_;
};

}  // namespace rigcal
