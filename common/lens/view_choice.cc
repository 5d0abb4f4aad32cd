// SPDX-License-Identifier: Apache-2.0
#include "common/lens/view_choice.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace rigcal {
namespace {

constexpr double kMovedShare = 0.04;   // of the image's diagonal
constexpr double kBlurredRatio = 1.8;  // of the sharpest view's blur
constexpr double kMoreMoved = 1.15;    // where there are too many views

// How far the corner has moved that has moved furthest; without bound where they have none in
// common.
double FurthestMove(const BoardView& a, const BoardView& b) {
  double furthest = -1;
  size_t k = 0;
  for (const BoardCorner& corner : a.corners) {
    // Both are in the order of the board's points, of which some may be missing.
    const auto same = std::find_if(
        b.corners.begin() + static_cast<ptrdiff_t>(k), b.corners.end(),
        [&](const BoardCorner& other) { return other.x_in_board_m == corner.x_in_board_m; });
    if (same == b.corners.end()) continue;
    k = static_cast<size_t>(same - b.corners.begin());
    furthest = std::max(furthest, (corner.pixel - same->pixel).norm());
  }
  return furthest < 0 ? std::numeric_limits<double>::infinity() : furthest;
}

}  // namespace

ViewChoice::ViewChoice(const ImageSize& image_size_px, const ViewChoiceLimits& limits)
    : limits_(limits),
      moved_px_(kMovedShare * std::hypot(image_size_px.width, image_size_px.height)) {}

bool ViewChoice::IsAlike(const BoardView& view, size_t others) const {
  return std::any_of(views_.begin(), views_.begin() + static_cast<ptrdiff_t>(others),
                     [&](const BoardView& other) { return FurthestMove(view, other) < moved_px_; });
}

ViewChoice::Verdict ViewChoice::Offer(const BoardView& view, double blur) {
  if (blur > 0 && (sharpest_ == 0 || blur < sharpest_)) sharpest_ = blur;
  if (blur > std::max(limits_.sharp, kBlurredRatio * sharpest_)) {
    ++blurred_;
    return Verdict::kBlurred;
  }
  if (IsAlike(view, views_.size())) {
    ++alike_;
    return Verdict::kAlike;
  }
  views_.push_back(view);
  while (limits_.most > 0 && views_.size() > limits_.most) Thin();
  return Verdict::kTaken;
}

// Views that differ by less than from now on are let go; the first of two stays.
void ViewChoice::Thin() {
  moved_px_ *= kMoreMoved;
  size_t kept = 0;
  for (size_t i = 0; i < views_.size(); ++i) {
    if (IsAlike(views_[i], kept)) {
      ++alike_;
      continue;
    }
    if (kept != i) views_[kept] = std::move(views_[i]);
    ++kept;
  }
  views_.resize(kept);
}

}  // namespace rigcal
