// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/board/board_detector.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/calib3d.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>
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
// Images from this width on are searched at half the resolution first.
constexpr int kLargeWidthPx = 1000;
constexpr double kLeastCornersShare = 0.6;  // of a checker that is found, those that fit
constexpr double kRoughSigmaPx = 0.2;       // one sigma of a corner that no model fits
constexpr int kSubPixSteps = 50;
constexpr double kSubPixStepPx = 1e-4;
constexpr double kMostSubPixMovePx = 1.5;  // more: it ran away to something else

// Circles that findCirclesGrid is given: of 4 pixels across up to a tenth of the picture.
constexpr float kLeastCircleAreaPx = 12;
constexpr float kMostCircleShare = 0.01f;
constexpr float kLeastCircleDistancePx = 4;
// The time of findCirclesGrid rises with the third power of what it is given: 0.2 s for 200 places,
// 4 s for 600; with clusters 0.1 s for 600. Noise of event cameras has thousands.
constexpr size_t kMostOtherCircles = 150, kMostCirclesInClusters = 1000;

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

// n of the 2 n + 1 pixels that show the four squares at a corner alone.
int WindowAt(const Board& board, const std::vector<Eigen::Vector2d>& pixels, int column, int row) {
  return std::clamp(static_cast<int>(kWindowShare * NearestDistance(board, pixels, column, row)),
                    kLeastWindowPx, kMostWindowPx);
}

bool IsInside(const cv::Mat& grey, const Eigen::Vector2d& pixel, int half) {
  return pixel.x() >= half + 1 && pixel.y() >= half + 1 && pixel.x() <= grey.cols - half - 2 &&
         pixel.y() <= grey.rows - half - 2;
}

// Those that are no corners of four squares are not seen. False: some are not, or are too near to
// the border to tell.
bool RefineCorners(const Board& board, const cv::Mat& grey, SeenBoard* seen) {
  const std::vector<Eigen::Vector2d> rough = seen->pixels;
  seen->sigmas_px.assign(rough.size(), kRoughSigmaPx);
  bool are_all_fitted = true;
  for (int row = 0; row < board.rows; ++row) {
    for (int column = 0; column < board.columns; ++column) {
      const int half = WindowAt(board, rough, column, row);
      const auto i = static_cast<size_t>(row * board.columns + column);
      Eigen::Vector2d& pixel = seen->pixels[i];
      if (!IsInside(grey, pixel, half)) {
        are_all_fitted = false;
        continue;
      }
      const auto corner = FitCorner(grey, pixel, DirectionAt(board, rough, column, row, true),
                                    DirectionAt(board, rough, column, row, false), half);
      if (corner) {
        pixel = corner->centre_px;
        seen->sigmas_px[i] = corner->Sigma();
      } else {
        pixel.setConstant(std::numeric_limits<double>::quiet_NaN());
        are_all_fitted = false;
      }
    }
  }
  return are_all_fitted;
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
  std::vector<cv::KeyPoint> seen;
  blobs->detect(grey, seen);
  std::vector<cv::Point2f> candidates;
  cv::KeyPoint::convert(seen, candidates);
  const size_t points = candidates.size(), wanted = static_cast<size_t>(size.area());
  if (points < wanted || points > kMostCirclesInClusters) return false;
  // Clustering bears more perspective and clutter, the other way more distortion.
  return (points <= wanted + kMostOtherCircles &&
          cv::findCirclesGrid(candidates, size, *found, kind, nullptr)) ||
         cv::findCirclesGrid(candidates, size, *found, kind | cv::CALIB_CB_CLUSTERING, nullptr);
}

// The corners of a checker to a pixel or so. First by the outlines of the black squares
// (findChessboardCorners), which finds boards that are cut by the border or blurred and is quick at
// half the resolution; without its equalised histogram, which takes noise for squares, minutes
// long. Then by the saddles of the corners (findChessboardCornersSB, Duda and Frese 2018), at half
// the resolution and, where there is `time`, in full, a small image at twice its resolution:
// squares of a few pixels are found where they are larger.
bool FindCorners(const Board& board, const cv::Mat& grey, BoardSearch time,
                 std::vector<Eigen::Vector2d>* pixels) {
  const cv::Size size(board.columns, board.rows);
  const bool is_large = grey.cols >= kLargeWidthPx;
  cv::Mat small = grey;
  double scale = 1;  // from a pixel of `small` to the next one in `grey`
  if (is_large) {
    scale = 2;
    cv::resize(grey, small, {}, 0.5, 0.5, cv::INTER_AREA);
  }
  std::vector<cv::Point2f> found;
  const bool by_squares = cv::findChessboardCorners(
      small, size, found, cv::CALIB_CB_ADAPTIVE_THRESH | cv::CALIB_CB_FAST_CHECK);
  if (!by_squares &&
      !cv::findChessboardCornersSB(small, size, found, cv::CALIB_CB_NORMALIZE_IMAGE)) {
    if (time == BoardSearch::kQuick) return false;
    small = grey;
    scale = 1;
    if (!is_large) {
      scale = 0.5;
      cv::resize(grey, small, {}, 2, 2, cv::INTER_CUBIC);
    }
    if (!cv::findChessboardCornersSB(small, size, found, cv::CALIB_CB_NORMALIZE_IMAGE)) {
      return false;
    }
  }
  if (found.size() != static_cast<size_t>(board.point_count())) return false;
  pixels->clear();
  for (const cv::Point2f& point : found) pixels->emplace_back(point.x, point.y);
  if (by_squares) {
    const std::vector<Eigen::Vector2d> rough = *pixels;
    for (int i = 0; i < board.point_count(); ++i) {
      const int half = WindowAt(board, rough, i % board.columns, i / board.columns);
      Eigen::Vector2d& pixel = (*pixels)[static_cast<size_t>(i)];
      if (IsInside(small, pixel, half)) pixel = CornerByGradients(small, pixel, half);
    }
  }
  // The centre of the first pixel is (0, 0), whatever the resolution.
  for (Eigen::Vector2d& pixel : *pixels) {
    pixel = scale * pixel + Eigen::Vector2d::Constant(0.5 * (scale - 1));
  }
  return true;
}

bool AllFinite(const std::vector<Eigen::Vector2d>& pixels) {
  return std::all_of(pixels.begin(), pixels.end(),
                     [](const Eigen::Vector2d& pixel) { return pixel.allFinite(); });
}

std::optional<SeenBoard> Find(const Board& board, const cv::Mat& grey, BoardSearch time) {
  if (board.HasMarkers()) return FindMarkerBoard(board, grey);
  SeenBoard seen;
  if (board.kind == BoardKind::kChecker) {
    if (!FindCorners(board, grey, time, &seen.pixels)) return std::nullopt;
    OrderBoard(board, grey, &seen.pixels);
    seen.edge_width_px = MedianEdgeWidth(board, grey, seen.pixels);
    RefineCorners(board, grey, &seen);
    const auto count =
        std::count_if(seen.pixels.begin(), seen.pixels.end(),
                      [](const Eigen::Vector2d& pixel) { return pixel.allFinite(); });
    if (static_cast<double>(count) < kLeastCornersShare * board.point_count()) return std::nullopt;
    return seen;
  }
  // Dark circles on white, as printed; else white ones on dark, as on a screen.
  std::vector<cv::Point2f> found;
  const cv::Size size(board.columns, board.rows);
  cv::Mat dark = grey;
  if (!FindCircles(board, dark, size, &found)) {
    if (time == BoardSearch::kQuick) return std::nullopt;
    cv::bitwise_not(grey, dark);
    if (!FindCircles(board, dark, size, &found)) return std::nullopt;
  }
  if (found.size() != static_cast<size_t>(board.point_count())) return std::nullopt;
  for (const cv::Point2f& point : found) seen.pixels.emplace_back(point.x, point.y);
  OrderBoard(board, dark, &seen.pixels);
  if (!RefineCircles(board, dark, &seen.pixels)) return std::nullopt;
  if (!AllFinite(seen.pixels)) return std::nullopt;
  return seen;
}

// Where the corners of the last image went, by the flow of the image, each proved by a fit.
std::optional<SeenBoard> Follow(const Board& board, const cv::Mat& last,
                                const std::vector<Eigen::Vector2d>& last_px, const cv::Mat& grey) {
  std::vector<cv::Point2f> from, to;
  for (const Eigen::Vector2d& pixel : last_px) {
    from.emplace_back(static_cast<float>(pixel.x()), static_cast<float>(pixel.y()));
  }
  std::vector<uint8_t> is_found;
  cv::calcOpticalFlowPyrLK(last, grey, from, to, is_found, cv::noArray(), cv::Size(15, 15));
  SeenBoard seen;
  for (size_t i = 0; i < to.size(); ++i) {
    if (is_found[i] == 0) return std::nullopt;
    seen.pixels.emplace_back(to[i].x, to[i].y);
  }
  if (!RefineCorners(board, grey, &seen) || !AllFinite(seen.pixels)) return std::nullopt;
  // A board that has slipped by a square is the other way round.
  std::vector<Eigen::Vector2d> ordered = seen.pixels;
  OrderBoard(board, grey, &ordered);
  if (ordered != seen.pixels) return std::nullopt;
  seen.edge_width_px = MedianEdgeWidth(board, grey, seen.pixels);
  return seen;
}

}  // namespace

absl::StatusOr<std::optional<SeenBoard>> FindBoard(const Board& board, const ImageView& image,
                                                   BoardSearch time) {
  try {
    return Find(board, GreyOf(image), time);
  } catch (const std::exception& exception) {
    return absl::InternalError(
        absl::StrCat("OpenCV cannot search a picture for the board: ", exception.what()));
  }
}

absl::StatusOr<std::optional<SeenBoard>> FollowBoard(const Board& board, const ImageView& last,
                                                     const std::vector<Eigen::Vector2d>& last_px,
                                                     const ImageView& image) {
  if (board.kind != BoardKind::kChecker || last.width != image.width ||
      last.height != image.height || last_px.size() != static_cast<size_t>(board.point_count()) ||
      !AllFinite(last_px)) {
    return std::nullopt;
  }
  try {
    return Follow(board, GreyOf(last), last_px, GreyOf(image));
  } catch (const std::exception& exception) {
    return absl::InternalError(absl::StrCat("OpenCV cannot follow the board: ", exception.what()));
  }
}

}  // namespace rigcal::agent
