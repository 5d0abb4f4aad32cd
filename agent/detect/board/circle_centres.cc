// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/board/circle_centres.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <optional>

#include "common/statistics/robust_statistics.h"

namespace rigcal::agent {
namespace {

constexpr double kRingBegins = 0.42;  // of the distance of the nearest neighbour: the background
constexpr double kRingEnds = 0.5;
constexpr int kCentreRounds = 3;
constexpr double kDiagonal = 1.4142135623730951;
constexpr double kMaxReachPx = 400;
constexpr double kLeastContrast = 8;  // grey levels
// Of the contrast, what counts as noise of the background.
constexpr double kBackgroundNoise = 0.1;
// The middle of a circle is darker than its surroundings by at least this share of the contrast.
constexpr double kDarkMiddle = 0.5;
constexpr double kOneCirclePx = 2;  // centres that are nearer to each other are of one circle

// d pixel / d x_in_board in metres around one point, from its neighbours.
Eigen::Matrix2d LocalScale(const Board& board, const std::vector<Eigen::Vector2d>& pixels,
                           int column, int row) {
  const auto at = [&](int c, int r) { return pixels[static_cast<size_t>(r * board.columns + c)]; };
  const int down = board.kind == BoardKind::kCircles ? 2 : 1;
  const double along_m = (board.kind == BoardKind::kCircles ? 2 : 1) * board.spacing_m;
  const int left = std::max(0, column - 1), right = std::min(board.columns - 1, column + 1);
  const int above = row - down >= 0 ? row - down : row;
  const int below = row + down < board.rows ? row + down : row;
  Eigen::Matrix2d scale;
  scale.col(0) = (at(right, row) - at(left, row)) / ((right - left) * along_m);
  scale.col(1) = (at(column, below) - at(column, above)) / ((below - above) * board.spacing_m);
  return scale;
}

// What is dark around a place.
struct DarkSpot {
  Eigen::Vector2d centroid;
  double middle_share = 0;  // how dark the place itself is, of the contrast
};

// None: its surroundings are not in the image, or are too large.
std::optional<DarkSpot> DarkSpotAt(const cv::Mat& grey, const Eigen::Vector2d& centre,
                                   const Eigen::Matrix2d& board_from_pixel, double nearest_m) {
  const Eigen::Matrix2d pixel_from_board = board_from_pixel.inverse();
  const double reach_x = kRingEnds * nearest_m * pixel_from_board.row(0).norm();
  const double reach_y = kRingEnds * nearest_m * pixel_from_board.row(1).norm();
  if (!(reach_x < kMaxReachPx) || !(reach_y < kMaxReachPx)) return std::nullopt;
  const int left = static_cast<int>(std::ceil(centre.x() - reach_x));
  const int right = static_cast<int>(std::floor(centre.x() + reach_x));
  const int top = static_cast<int>(std::ceil(centre.y() - reach_y));
  const int bottom = static_cast<int>(std::floor(centre.y() + reach_y));
  if (left < 0 || top < 0 || right >= grey.cols || bottom >= grey.rows) return std::nullopt;
  const auto radius = [&](int x, int y) {
    return (board_from_pixel * (Eigen::Vector2d(x, y) - centre)).norm() / nearest_m;
  };
  std::vector<double> ring;
  double darkest = 255;
  for (int y = top; y <= bottom; ++y) {
    for (int x = left; x <= right; ++x) {
      const double r = radius(x, y);
      if (r > kRingEnds) continue;
      darkest = std::min(darkest, 1.0 * grey.at<uint8_t>(y, x));
      if (r >= kRingBegins) ring.push_back(grey.at<uint8_t>(y, x));
    }
  }
  if (ring.size() < 8) return std::nullopt;
  const double background = Median(std::move(ring));
  const double contrast = background - darkest;
  if (contrast < kLeastContrast) return DarkSpot{centre, 0};
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  double weight = 0;
  for (int y = top; y <= bottom; ++y) {
    for (int x = left; x <= right; ++x) {
      const double darkness = background - grey.at<uint8_t>(y, x);
      if (darkness < kBackgroundNoise * contrast || radius(x, y) > kRingEnds) continue;
      sum += darkness * Eigen::Vector2d(x, y);
      weight += darkness;
    }
  }
  if (!(weight > 0)) return DarkSpot{centre, 0};
  const double middle = grey.at<uint8_t>(static_cast<int>(std::lround(centre.y())),
                                         static_cast<int>(std::lround(centre.x())));
  return DarkSpot{sum / weight, (background - middle) / contrast};
}

}  // namespace

bool RefineCircles(const Board& board, const cv::Mat& grey, std::vector<Eigen::Vector2d>* pixels) {
  const double nearest_m = (board.kind == BoardKind::kCircles ? kDiagonal : 1.0) * board.spacing_m;
  const std::vector<Eigen::Vector2d> rough = *pixels;
  bool are_circles = true;
  for (int row = 0; row < board.rows; ++row) {
    for (int column = 0; column < board.columns; ++column) {
      const Eigen::Matrix2d scale = LocalScale(board, rough, column, row);
      if (!(std::abs(scale.determinant()) > 0)) continue;
      const Eigen::Matrix2d board_from_pixel = scale.inverse();
      Eigen::Vector2d& pixel = (*pixels)[static_cast<size_t>(row * board.columns + column)];
      double middle_share = 1;
      for (int round = 0; round < kCentreRounds; ++round) {
        const auto spot = DarkSpotAt(grey, pixel, board_from_pixel, nearest_m);
        if (!spot) break;
        middle_share = spot->middle_share;
        pixel = spot->centroid;
      }
      are_circles = are_circles && middle_share >= kDarkMiddle;
    }
  }
  for (size_t i = 0; i < pixels->size(); ++i) {
    for (size_t k = 0; k < i; ++k) {
      are_circles = are_circles && !(((*pixels)[i] - (*pixels)[k]).norm() < kOneCirclePx);
    }
  }
  return are_circles;
}

}  // namespace rigcal::agent
