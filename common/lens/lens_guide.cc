// SPDX-License-Identifier: Apache-2.0
#include "common/lens/lens_guide.h"

#include <cmath>
#include <utility>

#include "absl/status/statusor.h"

namespace rigcal {
namespace {

// From nothing takes long: where these views make no lens, it is tried again after some more.
constexpr size_t kTriedEachTime = 10;
constexpr size_t kViewsBetweenTries = 4;

// A solve that goes on takes about 0.1 ms for each corner.
constexpr size_t kMostCorners = 2000;
constexpr size_t kLeastCornersLeft = 12;  // of a view

size_t CornersOf(const std::vector<BoardView>& views) {
  size_t corners = 0;
  for (const BoardView& view : views) corners += view.corners.size();
  return corners;
}

// Some of the corners of large boards.
std::vector<BoardView> Thinned(const std::vector<BoardView>& views) {
  const size_t stride = (CornersOf(views) + kMostCorners - 1) / kMostCorners;
  std::vector<BoardView> thinned = views;
  for (BoardView& view : thinned) {
    if (stride < 2 || view.corners.size() < stride * kLeastCornersLeft) continue;
    size_t kept = 0;
    for (size_t i = 0; i < view.corners.size(); i += stride) view.corners[kept++] = view.corners[i];
    view.corners.resize(kept);
  }
  return thinned;
}

// What would be known if there were so many times as many corners.
void Multiply(double times, LensSolution* solution) {
  solution->information *= times;
  solution->sigmas /= std::sqrt(times);
  LensUncertainty& uncertainty = solution->uncertainty;
  uncertainty.median_px /= std::sqrt(times);
  uncertainty.p95_px /= std::sqrt(times);
  for (double& sigma : uncertainty.map_px) sigma /= std::sqrt(times);
}

}  // namespace

LensGuide::LensGuide(std::vector<Eigen::Vector3d> points_m, const ImageSize& image_size_px,
                     const LensGuideOptions& options)
    : points_m_(std::move(points_m)), image_size_px_(image_size_px), options_(options) {
  next_ = AdviseNextView(points_m_, image_size_px_, {}, nullptr, options_.is_whole);
}

bool LensGuide::IsGood(const LensSolution& solution) const {
  return solution.views >= kLeastViews && solution.uncertainty.p95_px <= options_.until_px;
}

void LensGuide::Follow(const std::vector<BoardView>& views) {
  is_enough_ = false;
  const bool tries = views.size() <= kTriedEachTime || views.size() % kViewsBetweenTries == 0;
  if (views.size() >= kLeastLensViews && (solution_ || tries)) {
    LensOptions solving;
    solving.model = options_.model;
    solving.previous = solution_ ? &*solution_ : nullptr;
    const std::vector<BoardView> thinned = Thinned(views);
    absl::StatusOr<LensSolution> solved = SolveLens(thinned, image_size_px_, solving);
    if (solved.ok()) {
      Multiply(static_cast<double>(CornersOf(views)) / static_cast<double>(CornersOf(thinned)),
               &*solved);
    }
    if (solved.ok() && IsGood(*solved)) {
      // From nothing, another model may be as good.
      solving.previous = nullptr;
      absl::StatusOr<LensSolution> complete = SolveLens(views, image_size_px_, solving);
      is_enough_ = complete.ok() && IsGood(*complete);
      if (complete.ok()) solved = std::move(complete);
    }
    if (solved.ok()) solution_ = *std::move(solved);
  }
  next_ = AdviseNextView(points_m_, image_size_px_, views, solution_ ? &*solution_ : nullptr,
                         options_.is_whole);
}

}  // namespace rigcal
