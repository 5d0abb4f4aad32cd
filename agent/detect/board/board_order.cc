// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/board/board_order.h"

#include <algorithm>

namespace rigcal::agent {
namespace {

// Positive: seen from its front. Twice the sum of the signed areas that rows and columns span.
double SignedArea(const Board& board, const std::vector<Eigen::Vector2d>& pixels) {
  const auto at = [&](int column, int row) -> const Eigen::Vector2d& {
    return pixels[static_cast<size_t>(row * board.columns + column)];
  };
  double area = 0;
  // Of `circles` the row after the next one is not shifted.
  const int down = board.kind == BoardKind::kCircles ? 2 : 1;
  for (int row = 0; row + down < board.rows; ++row) {
    for (int column = 0; column + 1 < board.columns; ++column) {
      const Eigen::Vector2d x = at(column + 1, row) - at(column, row);
      const Eigen::Vector2d y = at(column, row + down) - at(column, row);
      area += x.x() * y.y() - x.y() * y.x();
    }
  }
  return area;
}

void ReverseColumns(const Board& board, std::vector<Eigen::Vector2d>* pixels) {
  for (int row = 0; row < board.rows; ++row) {
    const auto begin = pixels->begin() + row * board.columns;
    std::reverse(begin, begin + board.columns);
  }
}

void ReverseRows(const Board& board, std::vector<Eigen::Vector2d>* pixels) {
  std::reverse(pixels->begin(), pixels->end());
  ReverseColumns(board, pixels);
}

// Mean brightness around the middle of the square between points (column, row) and (column + 1,
// row + 1).
double SquareBrightness(const Board& board, const cv::Mat& grey,
                        const std::vector<Eigen::Vector2d>& pixels, int column, int row) {
  const auto at = [&](int c, int r) { return pixels[static_cast<size_t>(r * board.columns + c)]; };
  const Eigen::Vector2d middle = 0.25 * (at(column, row) + at(column + 1, row) +
                                         at(column, row + 1) + at(column + 1, row + 1));
  double sum = 0;
  int count = 0;
  for (int y = -1; y <= 1; ++y) {
    for (int x = -1; x <= 1; ++x) {
      const int px = std::clamp(static_cast<int>(middle.x() + 0.5) + x, 0, grey.cols - 1);
      const int py = std::clamp(static_cast<int>(middle.y() + 0.5) + y, 0, grey.rows - 1);
      sum += grey.at<uint8_t>(py, px);
      ++count;
    }
  }
  return sum / count;
}

// The squares that must be black are darker than the others.
bool BeginsBlack(const Board& board, const cv::Mat& grey,
                 const std::vector<Eigen::Vector2d>& pixels) {
  double brighter = 0;
  for (int row = 0; row + 1 < board.rows; ++row) {
    for (int column = 0; column + 1 < board.columns; ++column) {
      const double brightness = SquareBrightness(board, grey, pixels, column, row);
      brighter += (row + column) % 2 == 0 ? -brightness : brightness;
    }
  }
  return brighter > 0;
}

}  // namespace

void OrderBoard(const Board& board, const cv::Mat& grey, std::vector<Eigen::Vector2d>* pixels) {
  if (SignedArea(board, *pixels) < 0) {
    // A mirror image that the pattern itself allows.
    if (board.kind == BoardKind::kCircles) {
      if (board.rows % 2 == 1) ReverseRows(board, pixels);
    } else {
      ReverseColumns(board, pixels);
    }
  }
  const bool has_twin = board.HasTwin();
  if (board.kind == BoardKind::kChecker && !has_twin) {
    if (!BeginsBlack(board, grey, *pixels)) std::reverse(pixels->begin(), pixels->end());
  } else if (has_twin && pixels->front().sum() > pixels->back().sum()) {
    std::reverse(pixels->begin(), pixels->end());
  }
}

}  // namespace rigcal::agent
