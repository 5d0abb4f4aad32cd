// SPDX-License-Identifier: Apache-2.0
#include "common/board/marker_cells.h"

#include <opencv2/aruco.hpp>
#include <string_view>
#include <utility>

#include "common/board/marker_dictionary.h"

namespace rigcal {
namespace {

constexpr int kAprilBorderBits = 2;  // kalibr's tags have a border of two bits, others of one

constexpr std::pair<std::string_view, int> kNumbers[] = {
    {"4x4_50", cv::aruco::DICT_4X4_50},
    {"4x4_100", cv::aruco::DICT_4X4_100},
    {"4x4_250", cv::aruco::DICT_4X4_250},
    {"4x4_1000", cv::aruco::DICT_4X4_1000},
    {"5x5_50", cv::aruco::DICT_5X5_50},
    {"5x5_100", cv::aruco::DICT_5X5_100},
    {"5x5_250", cv::aruco::DICT_5X5_250},
    {"5x5_1000", cv::aruco::DICT_5X5_1000},
    {"6x6_50", cv::aruco::DICT_6X6_50},
    {"6x6_100", cv::aruco::DICT_6X6_100},
    {"6x6_250", cv::aruco::DICT_6X6_250},
    {"6x6_1000", cv::aruco::DICT_6X6_1000},
    {"7x7_50", cv::aruco::DICT_7X7_50},
    {"7x7_100", cv::aruco::DICT_7X7_100},
    {"7x7_250", cv::aruco::DICT_7X7_250},
    {"7x7_1000", cv::aruco::DICT_7X7_1000},
    {"original", cv::aruco::DICT_ARUCO_ORIGINAL},
    {"apriltag_16h5", cv::aruco::DICT_APRILTAG_16h5},
    {"apriltag_25h9", cv::aruco::DICT_APRILTAG_25h9},
    {"apriltag_36h10", cv::aruco::DICT_APRILTAG_36h10},
    {"apriltag_36h11", cv::aruco::DICT_APRILTAG_36h11}};

// A marker of `side_m` with its upper left at (x, y). `turned`: by 180 degrees.
void AddMarker(const cv::aruco::Dictionary& dictionary, int id, int border_bits, bool turned,
               const BlackCell& marker, std::vector<BlackCell>* cells) {
  const cv::Mat bits = cv::aruco::Dictionary::getBitsFromByteList(dictionary.bytesList.row(id),
                                                                  dictionary.markerSize);
  const int size = dictionary.markerSize, count = size + 2 * border_bits;
  const double side_m = marker.side_m / count;
  for (int row = 0; row < count; ++row) {
    for (int column = 0; column < count; ++column) {
      const int r = row - border_bits, c = column - border_bits;
      const bool is_border = r < 0 || c < 0 || r >= size || c >= size;
      const bool is_white =
          !is_border && bits.at<uint8_t>(turned ? size - 1 - r : r, turned ? size - 1 - c : c) != 0;
      if (is_white) continue;
      cells->push_back({marker.x_m + column * side_m, marker.y_m + row * side_m, side_m});
    }
  }
}

// `first`: the number of the first marker.
std::vector<BlackCell> CharucoCells(const Board& board, int first, int marker_parity) {
  const auto dictionary = MarkerDictionary(DictionaryOf(board));
  const double side_m = board.spacing_m, inset_m = 0.5 * (side_m - board.marker_m);
  std::vector<BlackCell> cells;
  int id = first;
  for (int row = 0; row <= board.rows; ++row) {
    for (int column = 0; column <= board.columns; ++column) {
      if ((row + column) % 2 != marker_parity) {
        cells.push_back({column * side_m, row * side_m, side_m});
        continue;
      }
      if (id >= dictionary->bytesList.rows) continue;
      AddMarker(*dictionary, id++, 1, false,
                {column * side_m + inset_m, row * side_m + inset_m, board.marker_m}, &cells);
    }
  }
  return cells;
}

std::vector<BlackCell> AprilGridCells(const Board& board, int first) {
  const auto dictionary = MarkerDictionary(DictionaryOf(board));
  const int across = board.columns / 2, high = board.rows / 2;
  const double side_m = board.spacing_m, gap_m = board.gap_share * side_m;
  std::vector<BlackCell> cells;
  for (int row = 0; row <= high; ++row) {
    for (int column = 0; column <= across; ++column) {
      const double x_m = column * (side_m + gap_m), y_m = row * (side_m + gap_m);
      cells.push_back({x_m, y_m, gap_m});
      if (row == high || column == across) continue;
      // Numbered from the lower left; as kalibr prints them, upside down against OpenCV.
      const int id = first + (high - 1 - row) * across + column;
      if (id >= dictionary->bytesList.rows) continue;
      AddMarker(*dictionary, id, kAprilBorderBits, true, {x_m + gap_m, y_m + gap_m, side_m},
                &cells);
    }
  }
  return cells;
}

}  // namespace

int DictionaryOf(const Board& board) {
  for (const auto& [name, number] : kNumbers) {
    if (board.dictionary == name) return number;
  }
  return cv::aruco::DICT_APRILTAG_36h11;
}

std::vector<BlackCell> MarkerCells(const Board& board, BoardSide side, int marker_parity) {
  const int first = side == BoardSide::kBack ? board.side_marker_count() : 0;
  return board.kind == BoardKind::kCharuco ? CharucoCells(board, first, marker_parity)
                                           : AprilGridCells(board, first);
}

}  // namespace rigcal
