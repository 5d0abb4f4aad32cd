// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/board/marker_proof.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "agent/detect/board/local_plane.h"
#include "agent/detect/board/seen_neighbours.h"

namespace rigcal::agent {
namespace {

// So many sides away a marker is not where it should be.
constexpr double kElsewhereShare = 0.7;
constexpr double kRightShareBeside = 0.5, kRightShare = 0.7;
// Points that say where a marker should be; and of which a marker's own are the nearest.
constexpr size_t kPointsNearby = 8, kPointsOfMarker = 4;
// What bits show is correlated with what they should show, for one marker and for all.
constexpr double kLeastOwnCorrelation = 0.5, kLeastMeanCorrelation = 0.65;
constexpr int kLeastRightMarkers = 2;
// A marker is drawn with this many places along its side, but with no more for each pixel than
// this.
constexpr double kPlacesPerMarker = 45, kMostPlacesPerPixel = 3;
// Of these, a grid within the border is compared: its size, and where it begins and ends.
constexpr int kComparedPlaces = 15;
constexpr double kComparedBegin = 0.15, kComparedEnd = 0.85;

bool IsNear(const FoundMarker& marker, const Eigen::Vector2d& expected_px) {
  return (MiddleOf(marker.pixels) - expected_px).norm() <
         kElsewhereShare * LongestSide(marker.pixels);
}

// Sums over places, of their deviations from the means.
struct Comparison {
  double xx = 0, xy = 0, yy = 0;

  bool IsAbove(double correlation) const { return xy > correlation * std::sqrt(xx * yy); }
};

Comparison CompareBits(const PrintedPattern& pattern, const cv::Mat& grey, const LocalPlane& plane,
                       const MarkerCorners& corners, double blur_px) {
  MarkerCorners pixels;
  for (size_t k = 0; k < 4; ++k) pixels[k] = plane.At(corners[k]);
  const double side_px = LongestSide(pixels);
  if (!(side_px < grey.cols)) return {};
  const PatternPatch patch =
      pattern.Show(plane, MiddleOf(corners), side_px, blur_px,
                   std::min(kMostPlacesPerPixel, kPlacesPerMarker / side_px));
  std::vector<std::pair<double, double>> values;
  for (int k = 0; k < kComparedPlaces * kComparedPlaces; ++k) {
    const double step = (kComparedEnd - kComparedBegin) / (kComparedPlaces - 1);
    const double u = kComparedBegin + step * (k % kComparedPlaces);
    const double v = kComparedBegin + step * (k / kComparedPlaces);
    const Eigen::Vector2d pixel =
        plane.At(corners[0] + u * (corners[1] - corners[0]) + v * (corners[3] - corners[0]));
    const Eigen::Vector2d offset = pixel - patch.centre_px;
    const cv::Point at(static_cast<int>(std::lround(pixel.x())),
                       static_cast<int>(std::lround(pixel.y())));
    const cv::Point place(static_cast<int>(std::lround(patch.IndexOf(offset.x()))),
                          static_cast<int>(std::lround(patch.IndexOf(offset.y()))));
    if (!cv::Rect({}, grey.size()).contains(at) ||
        !cv::Rect({}, patch.white.size()).contains(place)) {
      continue;
    }
    values.emplace_back(grey.at<uint8_t>(at), patch.white(place));
  }
  double x = 0, y = 0;
  for (const auto& [shown, white] : values) {
    x += shown / static_cast<double>(values.size());
    y += white / static_cast<double>(values.size());
  }
  Comparison sums;
  for (const auto& [shown, white] : values) {
    sums.xx += (shown - x) * (shown - x);
    sums.xy += (shown - x) * (white - y);
    sums.yy += (white - y) * (white - y);
  }
  return sums;
}

}  // namespace

bool AgreesWithThoseBeside(const PrintedPattern& pattern, const FoundMarker& marker,
                           const std::vector<FoundMarker>& markers, double reach_m) {
  const auto corners = pattern.markers().find(marker.id);
  if (corners == pattern.markers().end()) return false;
  std::vector<PatternPixel> own;
  for (size_t k = 0; k < 4; ++k) own.emplace_back(corners->second[k], marker.pixels[k]);
  const auto plane = LocalPlane::Through(own);
  if (!plane) return false;
  int told = 0, right = 0;
  for (const FoundMarker& other : markers) {
    const auto there = pattern.markers().find(other.id);
    if (other.id == marker.id || there == pattern.markers().end()) continue;
    const Eigen::Vector2d middle = MiddleOf(there->second);
    if ((middle - MiddleOf(corners->second)).norm() > reach_m) continue;
    ++told;
    if (IsNear(other, plane->At(middle))) ++right;
  }
  return right >= kRightShareBeside * told;
}

bool HasItsMarkers(const PrintedPattern& pattern, const SeenBoard& seen,
                   const std::vector<FoundMarker>& markers) {
  int told = 0, right = 0;
  for (const FoundMarker& marker : markers) {
    const auto corners = pattern.markers().find(marker.id);
    if (corners == pattern.markers().end()) continue;
    const Eigen::Vector2d middle = MiddleOf(corners->second);
    const auto plane = LocalPlane::Through(SeenNeighbours(pattern, seen, middle, kPointsNearby));
    if (!plane) continue;
    ++told;
    if (IsNear(marker, plane->At(middle))) ++right;
  }
  return right >= kRightShare * told;
}

bool ShowsItsBits(const PrintedPattern& pattern, const cv::Mat& grey, const SeenBoard& seen,
                  double blur_px, double reach_m) {
  Comparison all;
  int right = 0;
  for (const auto& [id, corners] : pattern.markers()) {
    const Eigen::Vector2d middle = MiddleOf(corners);
    const std::vector<PatternPixel> near = SeenNeighbours(pattern, seen, middle, kPointsOfMarker);
    if (near.empty() || (near.back().first - middle).norm() > reach_m) continue;
    const auto plane = LocalPlane::Through(near);
    if (!plane) continue;
    const Comparison own = CompareBits(pattern, grey, *plane, corners, blur_px);
    if (own.IsAbove(kLeastOwnCorrelation)) ++right;
    all.xx += own.xx;
    all.xy += own.xy;
    all.yy += own.yy;
  }
  return right >= kLeastRightMarkers && all.IsAbove(kLeastMeanCorrelation);
}

}  // namespace rigcal::agent
