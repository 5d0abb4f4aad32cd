// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/frame/background_learner.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

constexpr double kRestFactor = 3;     // a wand must rest this many times as long as a spot
constexpr double kLeastMovePx = 1.5;  // by a marker; less is noise, or a hand that holds still
constexpr double kAroundPx = 4;       // margin of the box around a marker
constexpr double kPale = 0.55;        // of saturation_min, as in the detector's palest level
constexpr size_t kMaxResting = 16;    // wands; the oldest ones are forgotten
// A resting wand is ignored if more than kIgnoredShare of each marker's area is background. It has
// moved if more than kMovedShare of a marker's area, and kLeastMoved pixels, look different.
constexpr double kIgnoredShare = 0.6, kMovedShare = 0.15, kLeastMoved = 6;

// Returns the area of the marker in its box, px^2.
double AreaIn(const PixelRect& box) {
  const double radius_px = std::max(1.0, 0.5 * (box.width - 1) - kAroundPx);
  return std::numbers::pi * radius_px * radius_px;
}

// Observations without a common marker count as moved.
bool HasMoved(const Observation& from, const Observation& to) {
  bool common = false;
  for (size_t k = 0; k < std::min(from.markers.size(), to.markers.size()); ++k) {
    if (!from.markers[k].visible || !to.markers[k].visible) continue;
    common = true;
    if ((from.markers[k].centre_px - to.markers[k].centre_px).norm() > kLeastMovePx) return true;
  }
  return !common;
}

}  // namespace

absl::StatusOr<BackgroundLearner> BackgroundLearner::Create(const ColourRange& colour,
                                                            const ImageSize& size_px,
                                                            double after_s) {
  ColourRange widest = colour;
  widest.saturation_min *= kPale;
  RIGCAL_ASSIGN_OR_RETURN(StaticBackground background,
                          StaticBackground::Create(widest, static_cast<int>(size_px.width),
                                                   static_cast<int>(size_px.height), after_s));
  return BackgroundLearner(std::move(background), size_px, after_s);
}

BackgroundLearner::BackgroundLearner(StaticBackground background, const ImageSize& size_px,
                                     double after_s)
    : background_(std::make_unique<StaticBackground>(std::move(background))),
      size_px_(size_px),
      after_s_(after_s),
      rest_s_(kRestFactor * after_s) {}

double BackgroundLearner::share() const {
  return static_cast<double>(background_->pixel_count()) /
         (static_cast<double>(size_px_.width) * static_cast<double>(size_px_.height));
}

BackgroundLearner::Boxes BackgroundLearner::BoxesOf(const Detection& detection) {
  const double reach = detection.marker_radius_px + kAroundPx;
  const int side = static_cast<int>(std::ceil(2 * reach)) + 1;
  Boxes boxes;
  for (const MarkerObservation& marker : detection.observation.markers) {
    if (!marker.visible) continue;
    boxes.push_back({static_cast<int>(std::floor(marker.centre_px.x() - reach)),
                     static_cast<int>(std::floor(marker.centre_px.y() - reach)), side, side});
  }
  return boxes;
}

// True after a rest so long that what is learnt from now on is background after rest_s_.
bool BackgroundLearner::Rests(const Observation& now) {
  if (!anchor_ || anchor_->clock_epoch != now.clock_epoch || anchor_->time_ns > now.time_ns ||
      HasMoved(*anchor_, now)) {
    anchor_ = now;
  }
  return 1e-9 * static_cast<double>(now.time_ns - anchor_->time_ns) >= rest_s_ - after_s_;
}

void BackgroundLearner::Look(const ImageView& image) {
  background_->BeginImage();
  ignores_wand_ = false;
  std::erase_if(resting_, [&](const Boxes& boxes) {
    bool moved = false, ignored = true;
    for (const PixelRect& box : boxes) {
      const StaticBackground::Pixels pixels = background_->Compare(image, box);
      const double area_px = AreaIn(box);
      moved |= static_cast<double>(pixels.changed) > std::max(kLeastMoved, kMovedShare * area_px);
      ignored &= static_cast<double>(pixels.count) > kIgnoredShare * area_px;
    }
    ignores_wand_ |= ignored && !moved;
    if (!moved) return false;
    for (const PixelRect& box : boxes) background_->Forget(box);
    return true;
  });
}

void BackgroundLearner::Learn(const ImageView& image, const Detection& detection) {
  Boxes kept;
  if (detection.outcome == DetectionOutcome::kWand) {
    kept = BoxesOf(detection);
    if (Rests(detection.observation)) {
      // Each rest is noted once.
      const bool known = std::any_of(resting_.begin(), resting_.end(), [&](const Boxes& boxes) {
        return std::equal(boxes.begin(), boxes.end(), kept.begin(), kept.end(),
                          [](const PixelRect& a, const PixelRect& b) {
                            return std::abs(a.x - b.x) <= kAroundPx &&
                                   std::abs(a.y - b.y) <= kAroundPx;
                          });
      });
      if (!known) {
        if (resting_.size() >= kMaxResting) resting_.erase(resting_.begin());
        resting_.push_back(kept);
      }
      kept.clear();
    }
  }
  background_->Learn(image, detection.observation.time_ns, kept);
}

}  // namespace rigcal::agent
