// SPDX-License-Identifier: Apache-2.0
#include "agent/command/board_views.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <opencv2/core.hpp>
#include <optional>

#include "absl/strings/str_cat.h"
#include "agent/detect/board/board_counts.h"
#include "agent/detect/board/board_detector.h"
#include "common/lens/view_choice.h"
#include "common/status/status_macros.h"
#include "common/target/target.h"

namespace rigcal::agent {
namespace {

namespace fs = std::filesystem;

constexpr double kSharpEdgePx = 4.5;    // wide; whatever other views have
constexpr size_t kKeptPictures = 10;    // to look for other counts in
constexpr int kMostBarePictures = 200;  // of a source without end

cv::Mat CopyOf(const ImageView& image) {
  const int type = image.format == PixelFormat::kMono8 ? CV_8UC1 : CV_8UC3;
  return cv::Mat(image.height, image.width, type, const_cast<uint8_t*>(image.data),
                 static_cast<size_t>(image.stride_bytes))
      .clone();
}

std::string CountsOf(const Board& board) { return absl::StrCat(board.columns, "x", board.rows); }

std::string NoBoardText(const Board& board, int looked_at) {
  return absl::StrCat("no ", CountsOf(board), " board in ", looked_at, " pictures");
}

// With counts that most of these pictures have, if that is so.
absl::Status CheckCounts(const Board& board, int looked_at, const std::vector<cv::Mat>& pictures) {
  const std::optional<CountsGuess> guess = GuessCounts(board, pictures);
  // Spots of anything make a few circles now and then.
  if (!guess ||
      (board.HasCircles() && 2 * static_cast<size_t>(guess->pictures) < pictures.size())) {
    return absl::OkStatus();
  }
  const Board& other = guess->board;
  const bool squares = board.kind == BoardKind::kChecker && other.columns + 1 == board.columns &&
                       other.rows + 1 == board.rows;
  const bool swapped = other.columns == board.rows && other.rows == board.columns;
  return absl::FailedPreconditionError(
      absl::StrCat(NoBoardText(board, looked_at), ", but one of ", CountsOf(other), " in ",
                   guess->pictures, " of the ", pictures.size(), " that were looked at again: ",
                   squares   ? "inner corners are counted, not squares; "
                   : swapped ? "the circles of a row come first, then the rows; "
                             : "",
                   "say --board ", FormatBoard(other)));
}

absl::Status NoBoard(const Board& board, int looked_at, const std::vector<cv::Mat>& pictures) {
  if (board.HasMarkers()) {
    return absl::FailedPreconditionError(absl::StrCat(
        "no ", FormatBoard(board), " in ", looked_at,
        " pictures: are the counts (of squares, or of tags), the sides and the dictionary those of "
        "the print, are its markers sharp and 15 pixels wide or more, and are the pictures not "
        "mirrored? A part of the board is enough"));
  }
  RIGCAL_RETURN_IF_ERROR(CheckCounts(board, looked_at, pictures));
  return absl::FailedPreconditionError(
      absl::StrCat(NoBoardText(board, looked_at),
                   ": the whole board must be seen, with a white margin around it, sharp and not "
                   "too dark; is it "
                   "the kind of board that --board says?"));
}

}  // namespace

absl::StatusOr<BoardViews> CollectBoardViews(const Board& board, const BoardViewsOptions& options,
                                             FrameSource* frames,
                                             const std::function<void(const BoardViews&)>& taken) {
  BoardViews result;
  result.image_size_px = frames->description().image_size_px;
  result.camera = frames->description().camera;
  ViewChoice choice(result.image_size_px, {.sharp = kSharpEdgePx});
  const auto points = board.Points();
  std::vector<cv::Mat> bare;
  // What a simulated camera shows; others ignore it.
  Target target;
  target.kind = TargetKind::kRigid;
  target.board = FormatBoard(board);
  RIGCAL_RETURN_IF_ERROR(frames->Start(target));
  while (options.views == 0 || static_cast<int>(result.views.size()) < options.views) {
    RIGCAL_ASSIGN_OR_RETURN(const std::optional<Frame> frame, frames->Next());
    if (!frame) break;
    ++result.pictures;
    RIGCAL_ASSIGN_OR_RETURN(const std::optional<SeenBoard> seen, FindBoard(board, frame->image));
    if (!seen) {
      if (result.with_board == 0 && bare.size() < kKeptPictures) {
        bare.push_back(CopyOf(frame->image));
        // Nobody waits for the rest of a thousand pictures to be told.
        if (bare.size() == kKeptPictures) {
          RIGCAL_RETURN_IF_ERROR(CheckCounts(board, result.pictures, bare));
        }
      }
      const bool is_bare = result.with_board == 0 && result.pictures >= kMostBarePictures;
      if (options.only_different && is_bare) break;
      continue;
    }
    ++result.with_board;
    bare.clear();
    BoardView view;
    view.name = frame->file.empty() ? absl::StrCat("picture ", result.pictures)
                                    : fs::path(frame->file).filename().string();
    for (size_t i = 0; i < points.size(); ++i) {
      if (!seen->Sees(i)) continue;
      view.corners.push_back({points[i], seen->pixels[i], 0.5 * board.CircleDiameter()});
    }
    if (options.only_different) {
      const ViewChoice::Verdict verdict = choice.Offer(view, seen->edge_width_px);
      result.alike = choice.alike();
      result.blurred = choice.blurred();
      if (verdict != ViewChoice::Verdict::kTaken) continue;
    }
    result.views.push_back(std::move(view));
    taken(result);
  }
  frames->Stop();
  result.refused = frames->Refused();
  if (result.pictures == 0) return absl::FailedPreconditionError("there were no pictures");
  if (result.with_board == 0) return NoBoard(board, result.pictures, bare);
  return result;
}

}  // namespace rigcal::agent
