// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/board/board_counts.h"

#include <algorithm>
#include <map>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <set>
#include <tuple>
#include <utility>

#include "agent/detect/board/board_detector.h"

namespace rigcal::agent {
namespace {

constexpr int kSmallPx = 640;  // a chessboard is told at this size
constexpr int kLeastCheckerCorners = 3;

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

cv::Mat SmallGrey(const cv::Mat& picture) {
  cv::Mat grey = picture;
  if (picture.channels() != 1) cv::cvtColor(picture, grey, cv::COLOR_BGR2GRAY);
  const double scale = static_cast<double>(kSmallPx) / std::max(grey.cols, grey.rows);
  if (scale >= 1) return grey;
  cv::Mat small;
  cv::resize(grey, small, {}, scale, scale, cv::INTER_AREA);
  return small;
}

// The chessboard in a picture, whatever its counts, the larger one first; now and then it is a part
// of it only. {0, 0}: none.
std::pair<int, int> CheckerIn(const cv::Mat& grey) {
  std::vector<cv::Point2f> corners;
  cv::Mat meta;  // as large as the board that was found
  const bool found =
      cv::findChessboardCornersSB(grey, {kLeastCheckerCorners, kLeastCheckerCorners}, corners,
                                  cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_LARGER, meta);
  if (!found) return {0, 0};
  return {std::max(meta.cols, meta.rows), std::min(meta.cols, meta.rows)};
}

std::optional<CountsGuess> GuessChecker(const Board& board, const std::vector<cv::Mat>& pictures) {
  std::map<std::pair<int, int>, int> seen;
  for (const cv::Mat& picture : pictures) {
    const cv::Mat grey = SmallGrey(picture);
    std::set<std::pair<int, int>> here = {CheckerIn(grey)};
    if (here.contains({0, 0})) continue;  // there is none of any counts
    for (const auto& [columns, rows] : kOtherCounts) {
      const cv::Size size(board.columns + columns, board.rows + rows);
      std::vector<cv::Point2f> corners;
      if (std::min(size.width, size.height) >= kLeastCheckerCorners &&
          cv::findChessboardCornersSB(grey, size, corners, cv::CALIB_CB_NORMALIZE_IMAGE)) {
        here.insert({std::max(size.width, size.height), std::min(size.width, size.height)});
      }
    }
    for (const auto& counts : here) ++seen[counts];
  }
  std::optional<CountsGuess> best;
  for (const auto& [counts, times] : seen) {
    Board other = board;
    std::tie(other.columns, other.rows) = counts;
    if (board.columns < board.rows) std::swap(other.columns, other.rows);
    if (!other.Validate().ok()) continue;
    if (!best || times > best->pictures ||
        (times == best->pictures && other.point_count() > best->board.point_count())) {
      best = {other, times};
    }
  }
  // A part of the board that was said is no other board.
  const bool is_part = best && best->board.columns <= board.columns &&
                       best->board.rows <= board.rows &&
                       2 * static_cast<size_t>(best->pictures) < pictures.size();
  if (best && (best->board == board || is_part)) best.reset();
  return best;
}

}  // namespace

std::optional<CountsGuess> GuessCounts(const Board& board, const std::vector<cv::Mat>& pictures) {
  if (board.HasMarkers()) return std::nullopt;  // their numbers say where they are
  if (board.kind == BoardKind::kChecker) return GuessChecker(board, pictures);
  std::vector<Board> others;
  if (board.columns != board.rows) {
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
