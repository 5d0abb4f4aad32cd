// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/board/marker_boards.h"

#include <Eigen/Core>
#include <array>
#include <limits>
#include <map>
#include <opencv2/aruco.hpp>
#include <vector>

#include "agent/detect/board/marker_growth.h"
#include "agent/detect/board/marker_reading.h"
#include "common/board/marker_cells.h"
#include "common/board/marker_dictionary.h"

namespace rigcal::agent {
namespace {

constexpr int kAprilBorderBits = 2;
// The corners of ChArUco's markers, whole pixels by themselves, are refined in so small a window
// that it shows nothing else.
constexpr int kMarkerCornerPx = 3;

// By number. `unread`: what looks like a marker but for its bits.
std::vector<FoundMarker> DetectMarkers(const Board& board, const cv::Mat& grey,
                                       std::vector<std::vector<cv::Point2f>>* unread) {
  auto parameters = cv::makePtr<cv::aruco::DetectorParameters>();
  if (board.kind == BoardKind::kAprilGrid) {
    parameters->markerBorderBits = kAprilBorderBits;
  } else {
    parameters->cornerRefinementMethod = cv::aruco::CORNER_REFINE_SUBPIX;
    parameters->cornerRefinementWinSize = kMarkerCornerPx;
  }
  std::vector<std::vector<cv::Point2f>> corners;
  std::vector<int> ids;
  cv::aruco::detectMarkers(grey, MarkerDictionary(DictionaryOf(board)), corners, ids, parameters,
                           *unread);
  std::map<int, FoundMarker> by_id;
  std::vector<int> repeated;
  for (size_t i = 0; i < ids.size(); ++i) {
    FoundMarker marker{.id = ids[i], .pixels = {}};
    for (size_t k = 0; k < 4; ++k) {
      // kalibr's tags are upside down for OpenCV.
      const size_t from = board.kind == BoardKind::kAprilGrid ? (k + 2) % 4 : k;
      marker.pixels[k] = {corners[i][from].x, corners[i][from].y};
    }
    if (!by_id.emplace(ids[i], marker).second) repeated.push_back(ids[i]);
  }
  // Two boards, or a false one: neither is certain.
  for (const int id : repeated) by_id.erase(id);
  std::vector<FoundMarker> markers;
  for (const auto& [id, marker] : by_id) markers.push_back(marker);
  return markers;
}

// Of a board with two sides a camera sees the one of which more markers are there.
std::optional<SeenBoard> FindSide(const Board& board, const cv::Mat& grey,
                                  const std::vector<FoundMarker>& markers) {
  if (!board.IsTwoSided()) return GrowBoard(board, BoardSide::kFront, grey, markers);
  std::vector<FoundMarker> front, back;
  const int count = board.side_marker_count();
  for (const FoundMarker& marker : markers) {
    if (marker.id < 2 * count) (marker.id < count ? front : back).push_back(marker);
  }
  const bool is_back = back.size() > front.size();
  auto seen = GrowBoard(board.OneSide(), is_back ? BoardSide::kBack : BoardSide::kFront, grey,
                        is_back ? back : front);
  if (!seen) return std::nullopt;
  // The points of the other side are not seen.
  const auto points = static_cast<ptrdiff_t>(board.side_point_count());
  const Eigen::Vector2d unseen =
      Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
  seen->pixels.insert(is_back ? seen->pixels.begin() : seen->pixels.end(), points, unseen);
  seen->sigmas_px.insert(is_back ? seen->sigmas_px.begin() : seen->sigmas_px.end(), points, 0);
  return seen;
}

}  // namespace

std::optional<SeenBoard> FindMarkerBoard(const Board& board, const cv::Mat& grey) {
  std::vector<std::vector<cv::Point2f>> unread;
  std::vector<FoundMarker> markers = DetectMarkers(board, grey, &unread);
  auto seen = FindSide(board, grey, markers);
  if (seen) return seen;
  markers.clear();
  const MarkerReader reader(board);
  for (const auto& quad : unread) {
    std::array<Eigen::Vector2d, 4> corners;
    for (size_t k = 0; k < 4; ++k) corners[k] = {quad[k].x, quad[k].y};
    if (const auto marker = reader.Read(grey, corners)) markers.push_back(*marker);
  }
  return FindSide(board, grey, markers);
}

}  // namespace rigcal::agent
