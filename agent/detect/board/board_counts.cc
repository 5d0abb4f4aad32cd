// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/board/board_counts.h"

#include <utility>

#include "agent/detect/board/board_detector.h"

namespace rigcal::agent {
namespace {

// By how much columns and rows may be off, with the likeliest first.
constexpr std::pair<int, int> kOtherCounts[] = {{-1, -1}, {1, 1}, {-1, 0}, {0, -1},
                                                {1, 0},   {0, 1}, {1, -1}, {-1, 1}};

int CountFound(const Board& board, const std::vector<cv::Mat>& pictures) {
  int found = 0;
  for (const cv::Mat& picture : pictures) {
    const ImageView view = {
        .data = picture.data,
        .width = picture.cols,
        .height = picture.rows,
        .stride_bytes = static_cast<ptrdiff_t>(picture.step),
        .format = picture.channels() == 1 ? PixelFormat::kMono8 : PixelFormat::kBgr8};
    const auto seen = FindBoard(board, view);
    if (seen.ok() && seen->has_value()) ++found;
  }
  return found;
}

}  // namespace

std::optional<CountsGuess> GuessCounts(const Board& board, const std::vector<cv::Mat>& pictures) {
  if (board.HasMarkers()) return std::nullopt;  // their numbers say where they are
  std::vector<Board> others;
  // A checker is found whichever of its sides is named first.
  if (board.kind != BoardKind::kChecker && board.columns != board.rows) {
    others.push_back(board);
    std::swap(others.back().columns, others.back().rows);
  }
  for (const auto& [columns, rows] : kOtherCounts) {
    others.push_back(board);
    others.back().columns += columns;
    others.back().rows += rows;
  }
  std::optional<CountsGuess> best;
  for (const Board& other : others) {
    if (!other.Validate().ok()) continue;
    const int found = CountFound(other, pictures);
    if (found == 0) continue;
    if (!best || found > best->pictures ||
        (found == best->pictures && other.point_count() > best->board.point_count())) {
      best = CountsGuess{other, found};
    }
  }
  return best;
}

}  // namespace rigcal::agent
