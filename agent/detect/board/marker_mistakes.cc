// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/board/marker_mistakes.h"

#include <algorithm>
#include <limits>
#include <opencv2/aruco.hpp>
#include <opencv2/imgproc.hpp>
#include <set>
#include <string_view>

#include "absl/strings/str_cat.h"
#include "agent/detect/board/marker_boards.h"
#include "common/board/marker_cells.h"
#include "common/board/marker_dictionary.h"

namespace rigcal::agent {
namespace {

// Fewer in a picture may be anything.
constexpr int kLeastDistinctMarkers = 4;

// Dictionaries whose smaller ones are the beginning of this one, and how many bits their markers
// have as a border. Those of 16h5 are found where there is nothing.
struct MarkerFamily {
  std::string_view name;
  int number;
  int border_bits;
  std::vector<int> sizes;  // of the dictionaries; empty: there is one
};
const std::vector<MarkerFamily>& MarkerFamilies() {
  static const auto* const kFamilies =
      new std::vector<MarkerFamily>{{"4x4", cv::aruco::DICT_4X4_1000, 1, {50, 100, 250, 1000}},
                                    {"5x5", cv::aruco::DICT_5X5_1000, 1, {50, 100, 250, 1000}},
                                    {"6x6", cv::aruco::DICT_6X6_1000, 1, {50, 100, 250, 1000}},
                                    {"7x7", cv::aruco::DICT_7X7_1000, 1, {50, 100, 250, 1000}},
                                    {"original", cv::aruco::DICT_ARUCO_ORIGINAL, 1, {}},
                                    {"apriltag_25h9", cv::aruco::DICT_APRILTAG_25h9, 1, {}},
                                    {"apriltag_36h10", cv::aruco::DICT_APRILTAG_36h10, 1, {}},
                                    {"apriltag_36h11", cv::aruco::DICT_APRILTAG_36h11, 1, {}},
                                    {"apriltag_36h11", cv::aruco::DICT_APRILTAG_36h11, 2, {}}};
  return *kFamilies;
}

// Markers of a family in all pictures that show at least four.
struct SeenMarkers {
  int pictures = 0;
  size_t count = 0;
  int lowest = std::numeric_limits<int>::max(), highest = -1;
};
SeenMarkers CountMarkers(int dictionary, int border_bits, const std::vector<cv::Mat>& greys) {
  auto parameters = cv::makePtr<cv::aruco::DetectorParameters>();
  parameters->markerBorderBits = border_bits;
  SeenMarkers seen;
  for (const cv::Mat& grey : greys) {
    std::vector<std::vector<cv::Point2f>> corners;
    std::vector<int> ids;
    cv::aruco::detectMarkers(grey, MarkerDictionary(dictionary), corners, ids, parameters);
    const std::set<int> distinct(ids.begin(), ids.end());
    if (distinct.size() < kLeastDistinctMarkers) continue;
    ++seen.pictures;
    seen.count += distinct.size();
    seen.lowest = std::min(seen.lowest, *distinct.begin());
    seen.highest = std::max(seen.highest, *distinct.rbegin());
  }
  return seen;
}

// The smallest dictionary of a family that has a marker of this number.
std::string NameWith(const MarkerFamily& family, int highest) {
  for (const int size : family.sizes) {
    if (highest < size) return absl::StrCat(std::string(family.name), "_", size);
  }
  return std::string(family.name);
}

std::string OtherFamilyText(const Board& board, const MarkerFamily& family,
                            const SeenMarkers& seen) {
  const std::string numbers = absl::StrCat(" (numbers up to ", seen.highest, ")");
  if (family.border_bits == 2) {
    return absl::StrCat("their markers are kalibr's April tags", numbers,
                        ": say --board board:aprilgrid,...");
  }
  if (board.kind == BoardKind::kAprilGrid) {
    return absl::StrCat("their markers are those of ", std::string(family.name), numbers,
                        " with a border of one bit, and kalibr's grid has two: say --board "
                        "board:charuco,... if they are in the white squares of a chessboard, else "
                        "print another board");
  }
  return absl::StrCat("their markers are those of dictionary ", std::string(family.name), numbers,
                      ": say ", NameWith(family, seen.highest), " in --board");
}

std::string OtherLayoutText(const Board& board, const SeenMarkers& seen) {
  const bool is_april = board.kind == BoardKind::kAprilGrid;
  const int across = is_april ? board.columns / 2 : board.columns + 1;
  const int down = is_april ? board.rows / 2 : board.rows + 1;
  const int markers = (board.IsTwoSided() ? 2 : 1) * board.side_marker_count();
  if (!board.IsTwoSided() && seen.lowest >= markers && seen.highest < 2 * markers) {
    return absl::StrCat("they show markers ", seen.lowest, " to ", seen.highest,
                        ", the back of a board that is printed on both sides: say --board ",
                        FormatBoard(board), ",two-sided=THICKNESS, such as 0.004");
  }
  return absl::StrCat(
      "their markers are of the right kind, with numbers up to ", seen.highest,
      seen.highest >= markers ? ", and " : ", but not where ", across, "x", down,
      is_april ? " tags" : " squares", " have ",
      seen.highest >= markers ? absl::StrCat(markers, " of them: ") : std::string("them: "),
      "are the counts right (across first, of ", is_april ? "tags" : "squares",
      "), and are all markers of one board?");
}

}  // namespace

std::string ExplainMissingMarkers(const Board& board, const std::vector<cv::Mat>& pictures) {
  std::vector<cv::Mat> greys;
  int mirrored = 0;
  for (const cv::Mat& picture : pictures) {
    cv::Mat grey = picture, flipped;
    if (picture.channels() == 3) cv::cvtColor(picture, grey, cv::COLOR_BGR2GRAY);
    greys.push_back(grey);
    cv::flip(grey, flipped, 1);
    if (FindMarkerBoard(board, flipped)) ++mirrored;
  }
  if (mirrored > 0) {
    return absl::StrCat("in ", mirrored, " of the ", pictures.size(),
                        " that were looked at again it is there mirrored: turn off the mirroring "
                        "(flip) of the camera");
  }
  const int told_border_bits = board.kind == BoardKind::kAprilGrid ? 2 : 1;
  const SeenMarkers told = CountMarkers(DictionaryOf(board), told_border_bits, greys);
  const MarkerFamily* best = nullptr;
  SeenMarkers most = told;
  for (const MarkerFamily& family : MarkerFamilies()) {
    const SeenMarkers seen = CountMarkers(family.number, family.border_bits, greys);
    if (seen.count <= most.count) continue;
    best = &family;
    most = seen;
  }
  // A larger dictionary of the same family has the markers of the smaller one and more.
  if (best != nullptr) return OtherFamilyText(board, *best, most);
  return told.pictures > 0 ? OtherLayoutText(board, told) : "";
}

}  // namespace rigcal::agent
