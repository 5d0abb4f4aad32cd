// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/board/board_detector.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/calib3d.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>
#include <string>

#include "absl/strings/str_cat.h"
#include "agent/detect/board/board_order.h"
#include "agent/detect/board/circle_centres.h"
#include "agent/detect/board/corner_fit.h"
#include "agent/detect/board/marker_boards.h"
#include "common/statistics/robust_statistics.h"

namespace rigcal::agent {
namespace {

// 2 n + 1 pixels around a corner are looked at, which must show its four squares alone.
constexpr double kWindowShare = 0.4;  // n, of the distance to the nearest corner
constexpr int kLeastWindowPx = 2;
constexpr int kMostWindowPx = 8;
constexpr double kRoughSigmaPx = 0.2;  // one sigma of a corner that no model fits
constexpr int kSubPixSteps = 50;
constexpr double kSubPixStepPx = 1e-4;
constexpr double kMostSubPixMovePx = 1.5;  // more: it ran away to something else

// Circles that findCirclesGrid is given: of 4 pixels across up to a tenth of the picture.
constexpr float kLeastCircleAreaPx = 12;
constexpr float kMostCircleShare = 0.01f;
constexpr float kLeastCircleDistancePx = 4;

// Brightness along an edge is read at so many places.
constexpr int kEdgeSamples = 41;

cv::Mat GreyOf(const ImageView& image) {
  const bool is_mono = image.format == PixelFormat::kMono8;
  // OpenCV does not write through it.
  const cv::Mat view(image.height, image.width, is_mono ? CV_8UC1 : CV_8UC3,
                     const_cast<uint8_t*>(image.data), static_cast<size_t>(image.stride_bytes));
  if (is_mono) return view;
  cv::Mat grey;
  cv::cvtColor(view, grey, cv::COLOR_BGR2GRAY);
  return grey;
}

double NearestDistance(const Board& board, const std::vector<Eigen::Vector2d>& pixels, int column,
                       int row) {
  const auto at = [&](int c, int r) { return pixels[static_cast<size_t>(r * board.columns + c)]; };
  double nearest = std::numeric_limits<double>::infinity();
  for (const auto& [x, y] :
       {std::pair(-1, 0), std::pair(1, 0), std::pair(0, -1), std::pair(0, 1)}) {
    const int c = column + x, r = row + y;
    if (c < 0 || r < 0 || c >= board.columns || r >= board.rows) continue;
    nearest = std::min(nearest, (at(c, r) - at(column, row)).norm());
  }
  return nearest;
}

// From a corner to its neighbours along a row (x) or a column (y), as far as there are any.
Eigen::Vector2d DirectionAt(const Board& board, const std::vector<Eigen::Vector2d>& pixels,
                            int column, int row, bool along_row) {
  const auto at = [&](int c, int r) { return pixels[static_cast<size_t>(r * board.columns + c)]; };
  const int dc = along_row ? 1 : 0, dr = along_row ? 0 : 1;
  const bool has_next = column + dc < board.columns && row + dr < board.rows;
  const bool has_last = column >= dc && row >= dr;
  return at(column + (has_next ? dc : 0), row + (has_next ? dr : 0)) -
         at(column - (has_last ? dc : 0), row - (has_last ? dr : 0));
}

// cornerSubPix, for what is no sharp corner.
Eigen::Vector2d CornerByGradients(const cv::Mat& grey, const Eigen::Vector2d& rough, int half) {
  std::vector<cv::Point2f> corner = {
      cv::Point2f(static_cast<float>(rough.x()), static_cast<float>(rough.y()))};
  cv::cornerSubPix(grey, corner, cv::Size(half, half), cv::Size(-1, -1),
                   cv::TermCriteria(cv::TermCriteria::COUNT + cv::TermCriteria::EPS, kSubPixSteps,
                                    kSubPixStepPx));
  const Eigen::Vector2d refined(corner[0].x, corner[0].y);
  return (refined - rough).norm() < kMostSubPixMovePx ? refined : rough;
}

void RefineCorners(const Board& board, const cv::Mat& grey, SeenBoard* seen) {
  const std::vector<Eigen::Vector2d> rough = seen->pixels;
  seen->sigmas_px.assign(rough.size(), kRoughSigmaPx);
  for (int row = 0; row < board.rows; ++row) {
    for (int column = 0; column < board.columns; ++column) {
      const int half =
          std::clamp(static_cast<int>(kWindowShare * NearestDistance(board, rough, column, row)),
                     kLeastWindowPx, kMostWindowPx);
      const auto i = static_cast<size_t>(row * board.columns + column);
      Eigen::Vector2d& pixel = seen->pixels[i];
      if (pixel.x() < half + 1 || pixel.y() < half + 1 || pixel.x() > grey.cols - half - 2 ||
          pixel.y() > grey.rows - half - 2) {
        continue;
      }
      const auto corner = FitCorner(grey, pixel, DirectionAt(board, rough, column, row, true),
                                    DirectionAt(board, rough, column, row, false), half);
      if (corner) {
        pixel = corner->centre_px;
        seen->sigmas_px[i] = corner->Sigma();
      } else {
        pixel = CornerByGradients(grey, pixel, half);
      }
    }
  }
}

double BrightnessAt(const cv::Mat& grey, const Eigen::Vector2d& pixel) {
  const int x = std::clamp(static_cast<int>(std::floor(pixel.x())), 0, grey.cols - 2);
  const int y = std::clamp(static_cast<int>(std::floor(pixel.y())), 0, grey.rows - 2);
  const double a = std::clamp(pixel.x() - x, 0.0, 1.0), b = std::clamp(pixel.y() - y, 0.0, 1.0);
  return (1 - b) * ((1 - a) * grey.at<uint8_t>(y, x) + a * grey.at<uint8_t>(y, x + 1)) +
         b * ((1 - a) * grey.at<uint8_t>(y + 1, x) + a * grey.at<uint8_t>(y + 1, x + 1));
}

// Between the middles of two squares that share an edge: how long the brightness takes from 10 to
// 90 % of its step.
double EdgeWidth(const cv::Mat& grey, const Eigen::Vector2d& from, const Eigen::Vector2d& to) {
  double values[kEdgeSamples];
  for (int i = 0; i < kEdgeSamples; ++i) {
    values[i] = BrightnessAt(grey, from + (to - from) * i / (kEdgeSamples - 1));
  }
  const double low = std::min(values[0], values[kEdgeSamples - 1]);
  const double high = std::max(values[0], values[kEdgeSamples - 1]);
  int inside = 0;
  for (const double value : values) {
    if (value > low + 0.1 * (high - low) && value < high - 0.1 * (high - low)) ++inside;
  }
  return (to - from).norm() * inside / (kEdgeSamples - 1);
}

double MedianEdgeWidth(const Board& board, const cv::Mat& grey,
                       const std::vector<Eigen::Vector2d>& pixels) {
  const auto at = [&](int c, int r) { return pixels[static_cast<size_t>(r * board.columns + c)]; };
  const auto middle = [&](int c, int r) {
    return Eigen::Vector2d(0.25 * (at(c, r) + at(c + 1, r) + at(c, r + 1) + at(c + 1, r + 1)));
  };
  std::vector<double> widths;
  for (int row = 0; row + 2 < board.rows; ++row) {
    for (int column = 0; column + 2 < board.columns; ++column) {
      const Eigen::Vector2d here = middle(column, row);
      widths.push_back(EdgeWidth(grey, here, middle(column + 1, row)));
      widths.push_back(EdgeWidth(grey, here, middle(column, row + 1)));
    }
  }
  return widths.empty() ? 0 : UpperMedian(std::move(widths));
}

bool FindCircles(const Board& board, const cv::Mat& grey, const cv::Size& size,
                 std::vector<cv::Point2f>* found) {
  cv::SimpleBlobDetector::Params params;
  params.minArea = kLeastCircleAreaPx;
  params.maxArea = kMostCircleShare * static_cast<float>(grey.total());
  params.minDistBetweenBlobs = kLeastCircleDistancePx;
  const auto blobs = cv::SimpleBlobDetector::create(params);
  const int kind = board.kind == BoardKind::kCircles ? cv::CALIB_CB_ASYMMETRIC_GRID
                                                     : cv::CALIB_CB_SYMMETRIC_GRID;
  // Clustering bears more perspective and clutter, the other way more distortion.
  return cv::findCirclesGrid(grey, size, *found, kind, blobs) ||
         cv::findCirclesGrid(grey, size, *found, kind | cv::CALIB_CB_CLUSTERING, blobs);
}

// By the measured saddle of each corner; where that fails, of boards whose margin the border cuts
// or that are blurred, by the outlines of the black squares, which find a little more.
bool FindCorners(const cv::Mat& grey, const cv::Size& size, std::vector<cv::Point2f>* found) {
  return cv::findChessboardCornersSB(grey, size, *found, cv::CALIB_CB_NORMALIZE_IMAGE) ||
         cv::findChessboardCorners(
             grey, size, *found,
             cv::CALIB_CB_ADAPTIVE_THRESH | cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_FAST_CHECK);
}

std::optional<SeenBoard> Find(const Board& board, const cv::Mat& grey) {
  const cv::Size size(board.columns, board.rows);
  if (board.HasMarkers()) return FindMarkerBoard(board, grey);
  const bool is_checker = board.kind == BoardKind::kChecker;
  std::vector<cv::Point2f> found;
  const bool is_found =
      is_checker ? FindCorners(grey, size, &found) : FindCircles(board, grey, size, &found);
  if (!is_found || found.size() != static_cast<size_t>(board.point_count())) return std::nullopt;
  SeenBoard seen;
  for (const cv::Point2f& point : found) seen.pixels.emplace_back(point.x, point.y);
  OrderBoard(board, grey, &seen.pixels);
  if (is_checker) {
    RefineCorners(board, grey, &seen);
    seen.edge_width_px = MedianEdgeWidth(board, grey, seen.pixels);
  } else {
    RefineCircles(board, grey, &seen.pixels);
  }
  for (const Eigen::Vector2d& pixel : seen.pixels) {
    if (!pixel.allFinite()) return std::nullopt;
  }
  return seen;
}

}  // namespace

absl::StatusOr<std::optional<SeenBoard>> FindBoard(const Board& board, const ImageView& image) {
  try {
    return Find(board, GreyOf(image));
  } catch (const std::exception& exception) {
    return absl::InternalError(
        absl::StrCat("OpenCV cannot search a picture for the board: ", exception.what()));
  }
}

}  // namespace rigcal::agent
