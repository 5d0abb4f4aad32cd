// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/board/printed_pattern.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace rigcal::agent {
namespace {

// The part of the print is drawn with so many places of the patch for each of its own, and is white
// at its rim. Edges are ramps as wide as a step of the patch, so that no step hides where they are.
constexpr double kDrawnStep = 1.2;
constexpr int kDrawnRim = 2;
constexpr double kMostDrawn = 1000;  // along a side; more is seen edge-on

// How much of pixel `index` a cell from `begin` to `end` covers, 0 to 1.
double Covered(int index, double begin, double end) {
  return std::max(0.0, std::min(end, index + 1.0) - std::max(begin, static_cast<double>(index)));
}

// `first`: the number of the first marker.
std::map<int, MarkerCorners> MarkersOf(const Board& board, int first, int marker_parity) {
  std::map<int, MarkerCorners> markers;
  const auto add = [&](int id, double x, double y, double side) {
    markers[id] = {Eigen::Vector2d(x, y), Eigen::Vector2d(x + side, y),
                   Eigen::Vector2d(x + side, y + side), Eigen::Vector2d(x, y + side)};
  };
  const double side_m = board.spacing_m;
  if (board.kind == BoardKind::kAprilGrid) {
    const int across = board.columns / 2, high = board.rows / 2;
    const double gap_m = board.gap_share * side_m;
    for (int id = 0; id < across * high; ++id) {
      add(first + id, gap_m + id % across * (side_m + gap_m),
          gap_m + (high - 1 - id / across) * (side_m + gap_m), side_m);
    }
    return markers;
  }
  const double inset_m = 0.5 * (side_m - board.marker_m);
  int id = first;
  for (int row = 0; row <= board.rows; ++row) {
    for (int column = 0; column <= board.columns; ++column) {
      if ((row + column) % 2 != marker_parity) continue;
      add(id++, column * side_m + inset_m, row * side_m + inset_m, board.marker_m);
    }
  }
  return markers;
}

std::vector<Eigen::Vector2d> PointsOf(const Board& board) {
  const double gap_m = board.gap_share * board.spacing_m;
  const double height_m = gap_m + board.rows / 2 * (board.spacing_m + gap_m);
  std::vector<Eigen::Vector2d> points;
  for (const Eigen::Vector3d& point : board.Points()) {
    if (board.kind == BoardKind::kAprilGrid) {  // whose y points up
      points.emplace_back(gap_m + point.x(), height_m - gap_m - point.y());
    } else {
      points.emplace_back(board.spacing_m + point.x(), board.spacing_m + point.y());
    }
  }
  return points;
}

}  // namespace

PrintedPattern::PrintedPattern(const Board& board, BoardSide side, int marker_parity)
    : cells_(MarkerCells(board, side, marker_parity)),
      points_(PointsOf(board)),
      markers_(MarkersOf(board, side == BoardSide::kBack ? board.side_marker_count() : 0,
                         marker_parity)) {}

PatternPatch PrintedPattern::Show(const LocalPlane& plane, const Eigen::Vector2d& pattern_m,
                                  double half_px, double blur_px, double per_pixel) const {
  PatternPatch patch;
  patch.per_pixel = per_pixel;
  patch.centre_px = plane.At(pattern_m);
  const int rim = static_cast<int>(std::ceil(3 * per_pixel * blur_px));
  const int half = static_cast<int>(std::ceil(per_pixel * half_px));
  const int count = 2 * (half + rim) + 1;
  Eigen::Matrix3d img_from_patch;
  img_from_patch << 1 / per_pixel, 0, patch.centre_px.x() - (half + rim) / per_pixel,  //
      0, 1 / per_pixel, patch.centre_px.y() - (half + rim) / per_pixel,                //
      0, 0, 1;
  const Eigen::Matrix3d pattern_from_patch = plane.img_from_pattern().inverse() * img_from_patch;
  // The part of the print that the patch shows.
  const double sign = (pattern_from_patch * Eigen::Vector3d(half + rim, half + rim, 1)).z();
  Eigen::Vector2d low_m = pattern_m, high_m = pattern_m;
  for (const double x : {0.0, count - 1.0}) {
    for (const double y : {0.0, count - 1.0}) {
      const Eigen::Vector3d at = pattern_from_patch * Eigen::Vector3d(x, y, 1);
      if (!(at.z() * sign > 0)) return {};
      low_m = low_m.cwiseMin(at.hnormalized());
      high_m = high_m.cwiseMax(at.hnormalized());
    }
  }
  const Eigen::Matrix2d slope = plane.SlopeAt(pattern_m);
  const Eigen::Vector2d step_m(kDrawnStep / per_pixel / slope.col(0).norm(),
                               kDrawnStep / per_pixel / slope.col(1).norm());
  const Eigen::Vector2d size = (high_m - low_m).cwiseQuotient(step_m);
  if (!(size.maxCoeff() < kMostDrawn)) return {};
  cv::Mat1f drawn(static_cast<int>(size.y()) + 1 + 2 * kDrawnRim,
                  static_cast<int>(size.x()) + 1 + 2 * kDrawnRim, 1.0f);
  for (const BlackCell& cell : cells_) {
    const double left = (cell.x_m - low_m.x()) / step_m.x() + kDrawnRim;
    const double top = (cell.y_m - low_m.y()) / step_m.y() + kDrawnRim;
    const double right = left + cell.side_m / step_m.x(), bottom = top + cell.side_m / step_m.y();
    if (right <= 0 || bottom <= 0 || left >= drawn.cols || top >= drawn.rows) continue;
    const int last_x = std::min(drawn.cols - 1, static_cast<int>(right));
    const int last_y = std::min(drawn.rows - 1, static_cast<int>(bottom));
    for (int y = std::max(0, static_cast<int>(top)); y <= last_y; ++y) {
      const double share = Covered(y, top, bottom);
      for (int x = std::max(0, static_cast<int>(left)); x <= last_x; ++x) {
        drawn(y, x) -= static_cast<float>(share * Covered(x, left, right));
      }
    }
  }
  Eigen::Matrix3d drawn_from_pattern;
  drawn_from_pattern << 1 / step_m.x(), 0, kDrawnRim - 0.5 - low_m.x() / step_m.x(),  //
      0, 1 / step_m.y(), kDrawnRim - 0.5 - low_m.y() / step_m.y(),                    //
      0, 0, 1;
  const Eigen::Matrix3d from = drawn_from_pattern * pattern_from_patch;
  const cv::Matx33d matrix(from(0, 0), from(0, 1), from(0, 2), from(1, 0), from(1, 1), from(1, 2),
                           from(2, 0), from(2, 1), from(2, 2));
  cv::Mat1f light;
  cv::warpPerspective(drawn, light, matrix, cv::Size(count, count),
                      cv::INTER_LINEAR | cv::WARP_INVERSE_MAP, cv::BORDER_REPLICATE);
  cv::GaussianBlur(light, light, cv::Size(2 * rim + 1, 2 * rim + 1), per_pixel * blur_px);
  patch.white = light(cv::Rect(rim, rim, 2 * half + 1, 2 * half + 1));
  return patch;
}

}  // namespace rigcal::agent
