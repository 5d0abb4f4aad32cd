// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/board/marker_growth.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "agent/detect/board/local_plane.h"
#include "agent/detect/board/marker_proof.h"
#include "agent/detect/board/pattern_fit.h"
#include "agent/detect/board/printed_pattern.h"
#include "agent/detect/board/seen_neighbours.h"
#include "common/statistics/robust_statistics.h"

namespace rigcal::agent {
namespace {

constexpr int kLeastCorners = 6;
constexpr double kFirstBlurPx = 0.9;
// A marker up to this side is fitted as a whole, which mends corners that are pixels off; a larger
// one is large for them.
constexpr double kMostWholeMarkerPx = 32;
constexpr double kMarkerWindowShare = 0.6;
constexpr int kLeastMarkerHalfPx = 5, kMostMarkerHalfPx = 18;
constexpr double kLeastMarkerCorrelation = 0.75, kSureMarkerCorrelation = 0.9;
constexpr int kMostStarts = 5;  // markers from which a board is grown
// As many times a grid that is not the board has been found, of which there is no third.
constexpr int kMostRefused = 2;

// Around a point: a window of a share of the mean distance to the next points, and how far a
// prediction is searched, a share of it.
constexpr double kPointWindowShare = 0.45;
constexpr int kLeastPointHalfPx = 4, kMostPointHalfPx = 6;
constexpr double kWindowRadiusShare = 0.7;  // rms of its weights, of its half width
constexpr double kSearchShare = 0.1;
constexpr int kLeastSearchPx = 1, kMostSearchPx = 4;
constexpr double kLeastPointCorrelation = 0.85;
// A misfit is no worse than this, or this multiple of that of most.
constexpr double kFineMisfit = 0.04, kMostMisfit = 4;
// From what a prediction may be off, pixels, or a share of the distance of points.
constexpr double kOffPx = 1.5, kOffShare = 0.15;
// How many points predict another one; how far the nearest of them may be, in squares or tags, and
// how much further the others (a ratio of squared distances).
constexpr size_t kLeastPredictors = 4, kMostPredictors = 8;
constexpr double kPredictorReach = 1.05, kFarPredictorReach = 6;
constexpr int kMostRounds = 60;
// A point is a stray where its neighbours expect it further away.
constexpr double kStrayPx = 0.7, kStrayBends = 6;  // of the rms by which they leave a plane
// Squares or tags from a marker to those beside it, and to its own points.
constexpr double kBesideReach = 2.1, kOwnReach = 1.1;

SeenBoard NothingSeen(size_t count) {
  SeenBoard seen;
  seen.pixels.assign(count, Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN()));
  seen.sigmas_px.assign(count, 0);
  return seen;
}

// Enough of it is seen for a pose.
bool IsEnough(const Board& board, const SeenBoard& seen) {
  int count = 0, first_row = board.rows, last_row = -1, first_column = board.columns,
      last_column = -1;
  for (int i = 0; i < board.point_count(); ++i) {
    if (!seen.Sees(static_cast<size_t>(i))) continue;
    ++count;
    first_row = std::min(first_row, i / board.columns);
    last_row = std::max(last_row, i / board.columns);
    first_column = std::min(first_column, i % board.columns);
    last_column = std::max(last_column, i % board.columns);
  }
  return count >= kLeastCorners && last_row > first_row && last_column > first_column;
}

std::optional<LocalPlane> PlaneOf(const FoundMarker& marker, const MarkerCorners& corners,
                                  double shift_px) {
  const Eigen::Vector2d middle_px = MiddleOf(marker.pixels);
  std::vector<PatternPixel> points;
  for (size_t k = 0; k < 4; ++k) {
    const Eigen::Vector2d from_middle = marker.pixels[k] - middle_px;
    points.emplace_back(corners[k], marker.pixels[k] + shift_px * from_middle.normalized());
  }
  return LocalPlane::Through(points);
}

class Growth {
 public:
  Growth(const Board& board, const cv::Mat& grey, const PrintedPattern& pattern)
      : board_(board),
        grey_(grey),
        pattern_(pattern),
        seen_(NothingSeen(pattern.points().size())),
        misfits_(pattern.points().size()) {}

  // False: it shows no such marker.
  bool Begin(const FoundMarker& marker) {
    const auto corners = pattern_.markers().find(marker.id);
    if (corners == pattern_.markers().end()) return false;
    const auto plane = FittedPlaneOf(marker, corners->second);
    if (!plane) return false;
    const Eigen::Vector2d middle = MiddleOf(corners->second);
    for (const Eigen::Vector2d& corner : corners->second) {
      support_.emplace_back(corner, plane->At(corner));
    }
    const double reach_m = 0.75 * board_.spacing_m;
    for (size_t i = 0; i < pattern_.points().size(); ++i) {
      if ((pattern_.points()[i] - middle).norm() < reach_m) Prove(i, *plane);
    }
    return true;
  }

  void Grow() {
    std::vector<size_t> known_before(pattern_.points().size(), 0);
    for (int round = 0; round < kMostRounds; ++round) {
      const SeenBoard known = seen_;
      bool has_more = false;
      for (size_t i = 0; i < pattern_.points().size(); ++i) {
        if (known.Sees(i)) continue;
        size_t nearby = 0;
        const auto plane = Predict(known, i, true, &nearby);
        // Nothing is new there since it was tried.
        if (!plane || nearby == known_before[i]) continue;
        known_before[i] = nearby;
        has_more = Prove(i, *plane) || has_more;
      }
      if (!has_more) return;
    }
  }

  // Each point once more, with neighbours to all sides that say how the pattern lies there.
  void Refine() {
    if (blurs_px_.empty()) return;
    blur_px_ = UpperMedian(blurs_px_);
    const SeenBoard known = seen_;
    for (size_t i = 0; i < pattern_.points().size(); ++i) {
      if (!known.Sees(i)) continue;
      size_t nearby = 0;
      const auto plane = Predict(known, i, false, &nearby);
      Forget(i);
      if (!plane) continue;
      const Eigen::Vector2d at = pattern_.points()[i];
      if (!Fit(i, plane->Moved(known.pixels[i] - plane->At(at)), 0)) continue;
      // A window shows a part of the bend that grows with the square of its size.
      const double part =
          kWindowRadiusShare * WindowOf(SpacingAt(*plane, at)) / SpacingAt(*plane, at);
      seen_.sigmas_px[i] =
          std::hypot(seen_.sigmas_px[i], part * part * BendAround(known, at, *plane));
    }
  }

  // Points that fit much worse than most do: of another shape than what is printed, or seen
  // edge-on.
  void DropMisfits() {
    std::vector<double> misfits;
    for (size_t i = 0; i < misfits_.size(); ++i) {
      if (seen_.Sees(i)) misfits.push_back(misfits_[i]);
    }
    if (misfits.empty()) return;
    const double most = std::max(kFineMisfit, kMostMisfit * UpperMedian(std::move(misfits)));
    for (size_t i = 0; i < misfits_.size(); ++i) {
      if (seen_.Sees(i) && misfits_[i] > most) Forget(i);
    }
  }

  // Points that are not where their neighbours expect them, the worst first.
  void DropStrays() {
    for (;;) {
      size_t worst = 0;
      double worst_ratio = 1;
      for (size_t i = 0; i < pattern_.points().size(); ++i) {
        if (!seen_.Sees(i)) continue;
        SeenBoard others = seen_;
        others.pixels[i].setConstant(std::numeric_limits<double>::quiet_NaN());
        size_t nearby = 0;
        const auto plane = Predict(others, i, false, &nearby);
        if (!plane) continue;
        const Eigen::Vector2d at = pattern_.points()[i];
        const double most_px = kStrayPx + kStrayBends * BendAround(others, at, *plane);
        const double ratio = (plane->At(at) - seen_.pixels[i]).norm() / most_px;
        if (ratio > worst_ratio) {
          worst_ratio = ratio;
          worst = i;
        }
      }
      if (!(worst_ratio > 1)) return;
      Forget(worst);
    }
  }

  const SeenBoard& seen() const { return seen_; }
  double blur_px() const { return blur_px_; }

 private:
  static int WindowOf(double spacing_px) {
    return std::clamp(static_cast<int>(kPointWindowShare * spacing_px), kLeastPointHalfPx,
                      kMostPointHalfPx);
  }

  double SpacingAt(const LocalPlane& plane, const Eigen::Vector2d& pattern_m) const {
    const Eigen::Matrix2d slope = plane.SlopeAt(pattern_m);
    return 0.5 * board_.spacing_m * (slope.col(0).norm() + slope.col(1).norm());
  }

  std::optional<LocalPlane> FittedPlaneOf(const FoundMarker& marker, const MarkerCorners& corners) {
    const double side_px = LongestSide(marker.pixels);
    const bool is_tag = board_.kind == BoardKind::kAprilGrid;
    const Eigen::Vector2d middle = MiddleOf(corners);
    PatternFitOptions options;
    options.half_px = std::clamp(static_cast<int>(kMarkerWindowShare * side_px), kLeastMarkerHalfPx,
                                 kMostMarkerHalfPx);
    options.is_rough = true;
    options.drawings = 3;
    options.move_px = 2;
    options.stretch = 0.15;
    options.perspective = 0.01;
    options.blur_share = 0.5;
    std::optional<FittedPattern> best;
    for (const double shift_px : kTagShiftsPx) {
      const auto plane = PlaneOf(marker, corners, shift_px);
      if (plane && side_px > kMostWholeMarkerPx) return plane;
      if (plane) {
        const auto fit = FitPattern(grey_, pattern_, *plane, middle, kFirstBlurPx, options);
        if (fit && (!best || fit->correlation > best->correlation)) best = fit;
      }
      if (!is_tag || (best && best->correlation > kSureMarkerCorrelation)) break;
    }
    if (!best || best->correlation < kLeastMarkerCorrelation) return std::nullopt;
    blur_px_ = best->blur_px;
    return best->plane;
  }

  // By the points around it. `beside`: only where one is next to it: a lens bends the plane further
  // away. `nearby`: how many are as near as the predictors may be.
  std::optional<LocalPlane> Predict(const SeenBoard& known, size_t point, bool beside,
                                    size_t* nearby) const {
    const Eigen::Vector2d at = pattern_.points()[point];
    const std::vector<PatternPixel> near =
        SeenNeighbours(pattern_, known, at, kMostPredictors, support_);
    if (near.size() < kLeastPredictors) return std::nullopt;
    const double reach_m2 = std::pow(kPredictorReach * board_.spacing_m, 2);
    if (beside && (near[0].first - at).squaredNorm() > reach_m2) return std::nullopt;
    if ((near[kLeastPredictors - 1].first - at).squaredNorm() > kFarPredictorReach * reach_m2) {
      return std::nullopt;
    }
    for (size_t k = 0; k < pattern_.points().size(); ++k) {
      if (known.Sees(k) &&
          (pattern_.points()[k] - at).squaredNorm() <= kFarPredictorReach * reach_m2) {
        ++*nearby;
      }
    }
    return LocalPlane::Through(near);
  }

  // By how much the points around a place leave a plane, rms: a lens bends them.
  double BendAround(const SeenBoard& known, const Eigen::Vector2d& pattern_m,
                    const LocalPlane& plane) const {
    const std::vector<PatternPixel> near =
        SeenNeighbours(pattern_, known, pattern_m, kMostPredictors);
    double squares_px2 = 0;
    for (const auto& [at, pixel] : near) squares_px2 += (plane.At(at) - pixel).squaredNorm();
    return std::sqrt(squares_px2 / static_cast<double>(near.size()));
  }

  // True: it is there, and near the prediction.
  bool Prove(size_t point, const LocalPlane& plane) {
    const double spacing_px = SpacingAt(plane, pattern_.points()[point]);
    const int search_px = std::clamp(static_cast<int>(std::lround(kSearchShare * spacing_px)),
                                     kLeastSearchPx, kMostSearchPx);
    return Fit(point, plane, search_px);
  }

  bool Fit(size_t point, const LocalPlane& plane, int search_px) {
    const Eigen::Vector2d at = pattern_.points()[point];
    const double spacing_px = SpacingAt(plane, at);
    Forget(point);
    if (!(spacing_px < grey_.cols)) return false;
    PatternFitOptions options;
    options.half_px = WindowOf(spacing_px);
    options.search_px = search_px;
    options.is_rough = search_px > 0;  // Refine follows
    const auto fit = FitPattern(grey_, pattern_, plane, at, blur_px_, options);
    const double most_px = std::max(kOffPx, kOffShare * spacing_px);
    if (!fit || fit->correlation < kLeastPointCorrelation ||
        (fit->centre_px - plane.At(at)).norm() > most_px) {
      return false;
    }
    seen_.pixels[point] = fit->centre_px;
    seen_.sigmas_px[point] = fit->Sigma();
    misfits_[point] = 1 - fit->correlation * fit->correlation;
    blurs_px_.push_back(fit->blur_px);
    return true;
  }

  void Forget(size_t point) {
    seen_.pixels[point].setConstant(std::numeric_limits<double>::quiet_NaN());
    seen_.sigmas_px[point] = 0;
  }

  const Board& board_;
  const cv::Mat& grey_;
  const PrintedPattern& pattern_;
  SeenBoard seen_;
  std::vector<PatternPixel> support_;
  std::vector<double> misfits_;  // of each point, the share of the variance that no fit explains
  std::vector<double> blurs_px_;
  double blur_px_ = kFirstBlurPx;
};

ptrdiff_t CountSeen(const SeenBoard& seen) {
  return std::count_if(seen.pixels.begin(), seen.pixels.end(),
                       [](const Eigen::Vector2d& pixel) { return pixel.allFinite(); });
}

struct GrownBoard {
  SeenBoard seen;
  bool is_proved = false;
};

// The first board that is proved, or the largest that is not.
GrownBoard GrowInLayout(const Board& board, BoardSide side, const cv::Mat& grey, int marker_parity,
                        const std::vector<FoundMarker>& markers) {
  const PrintedPattern pattern(board, side, marker_parity);
  std::vector<FoundMarker> starts;
  for (const FoundMarker& marker : markers) {
    if (AgreesWithThoseBeside(pattern, marker, markers, kBesideReach * board.spacing_m)) {
      starts.push_back(marker);
    }
  }
  // The largest marker has most pixels to prove it.
  std::stable_sort(starts.begin(), starts.end(), [](const FoundMarker& a, const FoundMarker& b) {
    return LongestSide(a.pixels) > LongestSide(b.pixels);
  });
  if (starts.size() > kMostStarts) starts.resize(kMostStarts);
  GrownBoard largest{NothingSeen(pattern.points().size()), false};
  int refused = 0;
  for (const FoundMarker& marker : starts) {
    Growth growth(board, grey, pattern);
    if (!growth.Begin(marker)) continue;
    growth.Grow();
    if (!IsEnough(board, growth.seen())) continue;
    growth.Refine();
    growth.DropMisfits();
    growth.DropStrays();
    const SeenBoard& seen = growth.seen();
    if (!IsEnough(board, seen)) continue;
    if (ShowsItsBits(pattern, grey, seen, growth.blur_px(), kOwnReach * board.spacing_m) &&
        HasItsMarkers(pattern, seen, markers)) {
      return {seen, true};
    }
    if (CountSeen(seen) > CountSeen(largest.seen)) largest.seen = seen;
    if (++refused == kMostRefused) break;
  }
  return largest;
}

}  // namespace

std::optional<SeenBoard> GrowBoard(const Board& board, BoardSide side, const cv::Mat& grey,
                                   const std::vector<FoundMarker>& markers) {
  if (markers.empty()) return std::nullopt;
  GrownBoard best = GrowInLayout(board, side, grey, 1, markers);
  // Where the squares in a row are odd in number, the layouts differ by a shift of one square, so
  // that both show most of the bits: the one of which more is seen is the board's.
  const bool has_old_layout = board.kind == BoardKind::kCharuco && (board.rows + 1) % 2 == 0;
  if (has_old_layout && CountSeen(best.seen) < board.point_count()) {
    GrownBoard old = GrowInLayout(board, side, grey, 0, markers);
    if (old.is_proved && CountSeen(old.seen) > CountSeen(best.seen)) best = std::move(old);
  }
  if (!best.is_proved) return std::nullopt;
  return std::move(best.seen);
}

}  // namespace rigcal::agent
