// SPDX-License-Identifier: Apache-2.0
#include "agent/command/board_views.h"

#include <algorithm>
#include <opencv2/core.hpp>
#include <optional>

#include "absl/strings/str_cat.h"
#include "agent/detect/board/board_counts.h"
#include "agent/detect/board/board_detector.h"
#include "common/status/status_macros.h"
#include "common/target/target.h"

namespace rigcal::agent {
namespace {

constexpr double kMovedShare = 0.04;    // of the image's diagonal
constexpr double kBlurredRatio = 1.8;   // of the sharpest view's edges ...
constexpr double kBlurredEdgePx = 4.5;  // ... and wider than this
constexpr size_t kKeptPictures = 10;    // to look for other counts in
constexpr int kMostBarePictures = 200;  // of a source without end

cv::Mat CopyOf(const ImageView& image) {
  const int type = image.format == PixelFormat::kMono8 ? CV_8UC1 : CV_8UC3;
  return cv::Mat(image.height, image.width, type, const_cast<uint8_t*>(image.data),
                 static_cast<size_t>(image.stride_bytes))
      .clone();
}

// How far the corner has moved that has moved furthest.
double FurthestMove(const BoardView& a, const BoardView& b) {
  double furthest = 0;
  size_t k = 0;
  for (const BoardCorner& corner : a.corners) {
    // Both are in the order of the board's points, of which some may be missing.
    const auto same = std::find_if(
        b.corners.begin() + static_cast<ptrdiff_t>(k), b.corners.end(),
        [&](const BoardCorner& other) { return other.x_in_board_m == corner.x_in_board_m; });
    if (same == b.corners.end()) continue;
    k = static_cast<size_t>(same - b.corners.begin());
    furthest = std::max(furthest, (corner.pixel - same->pixel).norm());
  }
  return furthest;
}

std::string CountsOf(const Board& board) { return absl::StrCat(board.columns, "x", board.rows); }

absl::Status NoBoard(const Board& board, int looked_at, const std::vector<cv::Mat>& pictures) {
  if (board.HasMarkers()) {
    return absl::FailedPreconditionError(absl::StrCat(
        "no ", FormatBoard(board), " in ", looked_at,
        " pictures: are the counts (of squares, or of tags), the sides and the dictionary those of "
        "the print, are its markers sharp and 15 pixels wide or more, and are the pictures not "
        "mirrored? A part of the board is enough"));
  }
  const std::string none =
      absl::StrCat("no ", CountsOf(board), " board in ", looked_at, " pictures");
  std::optional<CountsGuess> guess = GuessCounts(board, pictures);
  // Spots of anything make a few circles now and then.
  if (guess && board.HasCircles() && 2 * static_cast<size_t>(guess->pictures) < pictures.size()) {
    guess.reset();
  }
  if (!guess) {
    return absl::FailedPreconditionError(absl::StrCat(
        none,
        ": the whole board must be seen, with a white margin around it, sharp and not too dark; is "
        "it the kind of board that --board says?"));
  }
  const bool is_checker = board.kind == BoardKind::kChecker;
  return absl::FailedPreconditionError(
      absl::StrCat(none, ", but one of ", CountsOf(guess->board), " in ", guess->pictures,
                   " of the ", pictures.size(), " that were looked at again: ",
                   is_checker ? "inner corners are counted, not squares"
                              : "the circles of a row come first, then the rows",
                   "; say --board ", FormatBoard(guess->board)));
}

}  // namespace

absl::StatusOr<BoardViews> CollectBoardViews(const Board& board, const BoardViewsOptions& options,
                                             FrameSource* frames,
                                             const std::function<bool(const BoardViews&)>& taken) {
  BoardViews result;
  result.image_size_px = frames->description().image_size_px;
  result.camera = frames->description().camera;
  const double moved_px =
      kMovedShare * std::hypot(result.image_size_px.width, result.image_size_px.height);
  const auto points = board.Points();
  std::vector<cv::Mat> bare;
  double sharpest = 0;
  // What a simulated camera shows; others ignore it.
  RIGCAL_ASSIGN_OR_RETURN(const Target target, ParseTarget("wand:0,0.13,0.39"));
  RIGCAL_RETURN_IF_ERROR(frames->Start(target));
  while (options.views == 0 || static_cast<int>(result.views.size()) < options.views) {
    RIGCAL_ASSIGN_OR_RETURN(const std::optional<Frame> frame, frames->Next());
    if (!frame) break;
    ++result.pictures;
    RIGCAL_ASSIGN_OR_RETURN(const std::optional<SeenBoard> seen, FindBoard(board, frame->image));
    if (!seen) {
      if (result.with_board == 0 && bare.size() < kKeptPictures) {
        bare.push_back(CopyOf(frame->image));
      }
      const bool is_bare = result.with_board == 0 && result.pictures >= kMostBarePictures;
      if (options.only_different && is_bare) break;
      continue;
    }
    ++result.with_board;
    bare.clear();
    BoardView view;
    view.name = absl::StrCat("picture ", result.pictures);
    for (size_t i = 0; i < points.size(); ++i) {
      if (!seen->Sees(i)) continue;
      view.corners.push_back({points[i], seen->pixels[i], 0.5 * board.CircleDiameter()});
    }
    if (options.only_different) {
      const double edge = seen->edge_width_px;
      if (edge > 0 && (sharpest == 0 || edge < sharpest)) sharpest = edge;
      if (edge > std::max(kBlurredEdgePx, kBlurredRatio * sharpest)) {
        ++result.blurred;
        continue;
      }
      const bool is_alike =
          std::any_of(result.views.begin(), result.views.end(),
                      [&](const BoardView& other) { return FurthestMove(view, other) < moved_px; });
      if (is_alike) {
        ++result.alike;
        continue;
      }
    }
    result.views.push_back(std::move(view));
    if (!taken(result)) break;
  }
  frames->Stop();
  if (result.pictures == 0) return absl::FailedPreconditionError("there were no pictures");
  if (result.with_board == 0) return NoBoard(board, result.pictures, bare);
  return result;
}

}  // namespace rigcal::agent
