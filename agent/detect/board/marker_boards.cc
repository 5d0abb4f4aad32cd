// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/board/marker_boards.h"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <opencv2/aruco.hpp>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <utility>
#include <vector>

#include "agent/detect/board/corner_fit.h"
#include "common/board/marker_cells.h"

namespace rigcal::agent {
namespace {

constexpr int kAprilBorderBits = 2;
// The corners of ChArUco's markers, whole pixels by themselves, are refined in so small a window
// that it shows nothing else.
constexpr int kMarkerCornerPx = 3;
constexpr size_t kLeastTags = 4;  // kalibr's rule
constexpr int kLeastCorners = 6;
// A window that shows the four squares at a corner alone: of the width of the narrowest of them.
constexpr double kGapShare = 0.45, kInsetShare = 0.9;
constexpr int kLeastMarkerWindowPx = 2, kMostMarkerWindowPx = 8;
// OpenCV's corners of tags are up to 3 px off; windows from 4 px on lead to the right one.
constexpr int kRoughWindowPx = 4;
constexpr double kMostRoughMovePx = 5;
// Two markers agree about a corner between them within a pixel, or this share of a square.
// From which a missing point is told.
constexpr size_t kLeastNeighbours = 6, kMostNeighbours = 8;
constexpr int kCompletions = 12;
// The nearest of them is so many squares or tags away, the others not much further (a ratio of
// squared distances), and a plane explains them to so many pixels.
constexpr double kReach = 1.05, kFarReach = 6, kPlaneErrorPx = 0.7;
constexpr double kAgreePx = 1, kAgreeShare = 0.1;
// So many squares apart they are not where the board has them.
constexpr double kElsewhereShare = 0.7;

struct Marker {
  std::array<Eigen::Vector2d, 4> pixels;  // upper left, upper right, lower right, lower left
};
using Markers = std::map<int, Marker>;

Markers DetectMarkers(const Board& board, const cv::Mat& grey) {
  auto parameters = cv::aruco::DetectorParameters::create();
  if (board.kind == BoardKind::kAprilGrid) {
    parameters->markerBorderBits = kAprilBorderBits;
  } else {
    parameters->cornerRefinementMethod = cv::aruco::CORNER_REFINE_SUBPIX;
    parameters->cornerRefinementWinSize = kMarkerCornerPx;
  }
  std::vector<std::vector<cv::Point2f>> corners;
  std::vector<int> ids;
  cv::aruco::detectMarkers(grey, cv::aruco::getPredefinedDictionary(DictionaryOf(board)), corners,
                           ids, parameters);
  Markers markers;
  std::vector<int> repeated;
  for (size_t i = 0; i < ids.size(); ++i) {
    Marker marker;
    for (size_t k = 0; k < 4; ++k) {
      // kalibr's tags are upside down for OpenCV.
      const size_t from = board.kind == BoardKind::kAprilGrid ? (k + 2) % 4 : k;
      marker.pixels[k] = {corners[i][from].x, corners[i][from].y};
    }
    if (!markers.emplace(ids[i], marker).second) repeated.push_back(ids[i]);
  }
  // Two boards, or a false one: neither is certain.
  for (const int id : repeated) markers.erase(id);
  return markers;
}

// Where a homography shows a point of the plane, and how points move there.
class Plane {
 public:
  // By four points or more; invalid where there is none.
  Plane(const std::vector<cv::Point2d>& metres, const std::vector<cv::Point2d>& pixels) {
    const cv::Mat found = cv::findHomography(metres, pixels);
    is_valid_ = found.rows == 3 && cv::checkRange(found);
    if (is_valid_) homography_ = cv::Matx33d(found);
  }
  bool is_valid() const { return is_valid_; }
  Eigen::Vector2d At(double x_m, double y_m) const {
    const cv::Vec3d at = homography_ * cv::Vec3d(x_m, y_m, 1);
    return {at[0] / at[2], at[1] / at[2]};
  }

 private:
  cv::Matx33d homography_ = cv::Matx33d::eye();
  bool is_valid_ = false;
};

int WindowFor(double width_px, double share) {
  return std::clamp(static_cast<int>(share * width_px), kLeastMarkerWindowPx, kMostMarkerWindowPx);
}

SeenBoard Unseen(const Board& board) {
  const auto count = static_cast<size_t>(board.point_count());
  SeenBoard seen;
  seen.pixels.assign(count, Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN()));
  seen.sigmas_px.assign(count, 0);
  return seen;
}

void Add(const FittedCorner& corner, size_t point, SeenBoard* seen) {
  seen->pixels[point] = corner.centre_px;
  seen->sigmas_px[point] = corner.Sigma();
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

// From the corner that OpenCV tells to the one that is meant: cornerSubPix, which is pulled there
// from further away than a fit.
Eigen::Vector2d NearCorner(const cv::Mat& grey, const Eigen::Vector2d& rough, int half) {
  if (rough.x() < half + 2 || rough.y() < half + 2 || rough.x() > grey.cols - half - 3 ||
      rough.y() > grey.rows - half - 3) {
    return rough;
  }
  std::vector<cv::Point2f> corner = {
      cv::Point2f(static_cast<float>(rough.x()), static_cast<float>(rough.y()))};
  cv::cornerSubPix(grey, corner, cv::Size(half, half), cv::Size(-1, -1),
                   cv::TermCriteria(cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 30, 0.01));
  const Eigen::Vector2d near(corner[0].x, corner[0].y);
  return (near - rough).norm() < kMostRoughMovePx ? near : rough;
}

// Most tags see the next ones where the grid has them: it is not one of other counts.
bool AreWhereTold(const Board& board, const Markers& markers) {
  const int across = board.columns / 2;
  const double side_m = board.spacing_m, pitch_m = (1 + board.gap_share) * side_m;
  int told = 0, right = 0;
  for (const auto& [id, marker] : markers) {
    std::vector<cv::Point2d> pixels;
    for (const Eigen::Vector2d& pixel : marker.pixels) pixels.emplace_back(pixel.x(), pixel.y());
    // From the tag's upper left; y points down.
    const Plane plane({{0, 0}, {side_m, 0}, {side_m, side_m}, {0, side_m}}, pixels);
    if (!plane.is_valid()) continue;
    for (const bool is_beside : {true, false}) {
      if (is_beside && id % across == across - 1) continue;
      const auto next = markers.find(is_beside ? id + 1 : id + across);
      if (next == markers.end()) continue;
      const Eigen::Vector2d expected = is_beside ? plane.At(pitch_m, 0) : plane.At(0, -pitch_m);
      const Eigen::Vector2d side = marker.pixels[1] - marker.pixels[0];
      ++told;
      if ((next->second.pixels[0] - expected).norm() < 0.5 * side.norm()) ++right;
    }
  }
  return 2 * right >= told;
}

SeenBoard AprilCorners(const Board& board, const cv::Mat& grey, const Markers& markers) {
  SeenBoard seen = Unseen(board);
  const int across = board.columns / 2;
  for (const auto& [id, marker] : markers) {
    if (id >= across * board.rows / 2) continue;
    const int column = 2 * (id % across), row = 2 * (id / across);
    for (size_t k = 0; k < 4; ++k) {
      const Eigen::Vector2d& here = marker.pixels[k];
      // Along the tag's sides: upper left and lower left begin at the left, both lower ones below.
      const bool is_right = k == 1 || k == 2, is_upper = k < 2;
      const Eigen::Vector2d along =
          marker.pixels[is_upper ? 1 : 2] - marker.pixels[is_upper ? 0 : 3];
      const Eigen::Vector2d down =
          marker.pixels[is_right ? 2 : 3] - marker.pixels[is_right ? 1 : 0];
      const double gap_px = board.gap_share * std::min(along.norm(), down.norm());
      const int half = WindowFor(gap_px, kGapShare);
      const auto corner = FitCorner(grey, NearCorner(grey, here, std::max(kRoughWindowPx, half)),
                                    along, down, half);
      if (!corner) continue;
      const int c = column + (is_right ? 1 : 0), r = row + (is_upper ? 1 : 0);  // y points up
      Add(*corner, static_cast<size_t>(r * board.columns + c), &seen);
    }
  }
  return seen;
}

// Of a layout in which the squares with markers are those whose column and row add up to an even or
// an odd number.
SeenBoard CharucoCorners(const Board& board, const cv::Mat& grey, const Markers& markers,
                         int parity) {
  SeenBoard seen = Unseen(board);
  const double side_m = board.spacing_m, inset_m = 0.5 * (side_m - board.marker_m);
  // The planes of the markers, by square.
  std::map<std::pair<int, int>, Plane> planes;
  int id = 0;
  for (int row = 0; row <= board.rows; ++row) {
    for (int column = 0; column <= board.columns; ++column) {
      if ((row + column) % 2 != parity) continue;
      const auto marker = markers.find(id++);
      if (marker == markers.end()) continue;
      const double left = column * side_m + inset_m, top = row * side_m + inset_m;
      const double right = left + board.marker_m, bottom = top + board.marker_m;
      std::vector<cv::Point2d> pixels;
      for (const Eigen::Vector2d& pixel : marker->second.pixels) {
        pixels.emplace_back(pixel.x(), pixel.y());
      }
      const Plane plane({{left, top}, {right, top}, {right, bottom}, {left, bottom}}, pixels);
      if (plane.is_valid()) planes.emplace(std::pair(column, row), plane);
    }
  }
  int told = 0, elsewhere = 0;
  for (int row = 0; row < board.rows; ++row) {
    for (int column = 0; column < board.columns; ++column) {
      const double x_m = (column + 1) * side_m, y_m = (row + 1) * side_m;
      std::vector<const Plane*> beside;
      for (const auto& [dx, dy] :
           {std::pair(0, 0), std::pair(1, 0), std::pair(0, 1), std::pair(1, 1)}) {
        const auto plane = planes.find({column + dx, row + dy});
        if (plane != planes.end()) beside.push_back(&plane->second);
      }
      if (beside.size() != 2) continue;
      const Eigen::Vector2d a = beside[0]->At(x_m, y_m), b = beside[1]->At(x_m, y_m);
      const Eigen::Vector2d along = beside[0]->At(x_m + side_m, y_m) - a;
      const Eigen::Vector2d down = beside[0]->At(x_m, y_m + side_m) - a;
      const double side_px = std::min(along.norm(), down.norm());
      ++told;
      if (!((a - b).norm() < kElsewhereShare * side_px)) ++elsewhere;
      if (!((a - b).norm() < std::max(kAgreePx, kAgreeShare * side_px))) continue;
      const int half = WindowFor(side_px * inset_m / side_m, kInsetShare);
      const auto corner = FitCorner(grey, 0.5 * (a + b), along, down, half);
      if (corner) Add(*corner, static_cast<size_t>(row * board.columns + column), &seen);
    }
  }
  // The markers of a board of other counts are elsewhere.
  return 2 * elsewhere <= told ? seen : Unseen(board);
}

bool Explains(const Plane& plane, const std::vector<cv::Point2d>& metres,
              const std::vector<cv::Point2d>& pixels) {
  for (size_t i = 0; i < metres.size(); ++i) {
    const Eigen::Vector2d at = plane.At(metres[i].x, metres[i].y);
    if (!((at - Eigen::Vector2d(pixels[i].x, pixels[i].y)).norm() < kPlaneErrorPx)) return false;
  }
  return true;
}

// Points that were not found beside markers of their own: where their nearest neighbours say that
// they are, and a fit proves it.
void Complete(const Board& board, const cv::Mat& grey, SeenBoard* seen) {
  const std::vector<Eigen::Vector3d> points = board.Points();
  const bool is_april = board.kind == BoardKind::kAprilGrid;
  // What the window may show on each side of a corner, metres.
  const double free_m =
      is_april ? board.gap_share * board.spacing_m : 0.5 * (board.spacing_m - board.marker_m);
  const double share = is_april ? kGapShare : kInsetShare;
  const double reach_m2 = std::pow(kReach * board.spacing_m, 2);
  for (int round = 0; round < kCompletions; ++round) {
    const SeenBoard known = *seen;
    bool has_more = false;
    for (size_t i = 0; i < points.size(); ++i) {
      if (known.Sees(i)) continue;
      std::vector<std::pair<double, size_t>> near;
      for (size_t k = 0; k < points.size(); ++k) {
        if (known.Sees(k)) near.emplace_back((points[k] - points[i]).squaredNorm(), k);
      }
      if (near.size() < kLeastNeighbours) return;
      const auto count = std::min(kMostNeighbours, near.size());
      std::partial_sort(near.begin(), near.begin() + static_cast<ptrdiff_t>(count), near.end());
      std::vector<cv::Point2d> metres, pixels;
      for (size_t n = 0; n < count; ++n) {
        const size_t k = near[n].second;
        metres.emplace_back(points[k].x(), points[k].y());
        pixels.emplace_back(known.pixels[k].x(), known.pixels[k].y());
      }
      // Only beside what is known: a lens bends the plane further away.
      if (near[0].first > reach_m2 || near[kLeastNeighbours - 1].first > kFarReach * reach_m2) {
        continue;
      }
      const Plane plane(metres, pixels);
      if (!plane.is_valid() || !Explains(plane, metres, pixels)) continue;
      const double x_m = points[i].x(), y_m = points[i].y();
      const Eigen::Vector2d at = plane.At(x_m, y_m);
      const Eigen::Vector2d along = plane.At(x_m + free_m, y_m) - at;
      const Eigen::Vector2d down = plane.At(x_m, y_m + free_m) - at;
      if (!at.allFinite() || !along.allFinite() || !down.allFinite()) continue;
      const int half = WindowFor(std::min(along.norm(), down.norm()), share);
      const auto corner = FitCorner(grey, at, along, down, half);
      if (!corner) continue;
      Add(*corner, i, seen);
      has_more = true;
    }
    if (!has_more) return;
  }
}

ptrdiff_t CountSeen(const SeenBoard& seen) {
  return std::count_if(seen.pixels.begin(), seen.pixels.end(),
                       [](const Eigen::Vector2d& pixel) { return pixel.allFinite(); });
}

// A board of one side, whose markers are numbered from 0.
std::optional<SeenBoard> FindSide(const Board& board, const cv::Mat& grey, const Markers& markers) {
  SeenBoard seen;
  if (board.kind == BoardKind::kAprilGrid) {
    if (markers.size() < kLeastTags || !AreWhereTold(board, markers)) return std::nullopt;
    seen = AprilCorners(board, grey, markers);
  } else {
    seen = CharucoCorners(board, grey, markers, 1);
    SeenBoard legacy = CharucoCorners(board, grey, markers, 0);
    if (CountSeen(legacy) > CountSeen(seen)) seen = std::move(legacy);
  }
  if (!IsEnough(board, seen)) return std::nullopt;
  Complete(board, grey, &seen);
  return seen;
}

}  // namespace

std::optional<SeenBoard> FindMarkerBoard(const Board& board, const cv::Mat& grey) {
  const Markers markers = DetectMarkers(board, grey);
  if (!board.IsTwoSided()) return FindSide(board, grey, markers);
  // One camera sees one side: the one of which more markers are there.
  Markers front, back;
  const int count = board.side_marker_count();
  for (const auto& [id, marker] : markers) {
    if (id < 2 * count) (id < count ? front : back).emplace(id % count, marker);
  }
  const bool is_back = back.size() > front.size();
  const auto side = FindSide(board.OneSide(), grey, is_back ? back : front);
  if (!side) return std::nullopt;
  SeenBoard seen = Unseen(board);
  const size_t first = is_back ? side->pixels.size() : 0;
  for (size_t i = 0; i < side->pixels.size(); ++i) {
    seen.pixels[first + i] = side->pixels[i];
    seen.sigmas_px[first + i] = side->sigmas_px[i];
  }
  return seen;
}

}  // namespace rigcal::agent
