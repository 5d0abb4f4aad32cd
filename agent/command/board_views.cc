// SPDX-License-Identifier: Apache-2.0
#include "agent/command/board_views.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "agent/detect/board/board_counts.h"
#include "agent/detect/board/marker_mistakes.h"
#include "common/lens/lens_solver.h"
#include "common/lens/view_choice.h"
#include "common/statistics/robust_statistics.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

namespace fs = std::filesystem;

constexpr double kSharpEdgePx = 4.5;    // wide; whatever other views have
constexpr size_t kKeptPictures = 10;    // to look for other counts in
constexpr int kMostBarePictures = 200;  // of a source without end
constexpr int kSpotGrey = 150;          // darker in a picture of events: a spot
constexpr double kLeastSpotPx = 5;
constexpr double kSamePx = 1;  // views of which every corner is that near are one

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
    const std::string none =
        absl::StrCat("no ", FormatBoard(board), " in ", looked_at, " pictures");
    if (const std::string why = ExplainMissingMarkers(board, pictures); !why.empty()) {
      return absl::FailedPreconditionError(absl::StrCat(none, "; ", why));
    }
    return absl::FailedPreconditionError(absl::StrCat(
        none,
        ": are the counts (of squares, or of tags), the sides and the dictionary those of "
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

// What most pictures show instead, where a few show the board by chance; empty: nothing known.
std::string WhatMostShow(const Board& board, const BoardViews& seen,
                         const std::vector<cv::Mat>& bare) {
  if (seen.with_board >= static_cast<int>(kLeastLensViews) || 2 * seen.with_board > seen.pictures) {
    return "";
  }
  const int without = seen.pictures - seen.with_board;
  if (!board.HasMarkers()) return std::string(CheckCounts(board, without, bare).message());
  const std::string why = ExplainMissingMarkers(board, bare);
  return why.empty() ? "" : absl::StrCat(NoBoardText(board, without), "; ", why);
}

// The same corners at the same places.
bool AreOneView(const BoardView& a, const BoardView& b) {
  if (a.corners.size() != b.corners.size()) return false;
  for (size_t i = 0; i < a.corners.size(); ++i) {
    if (a.corners[i].x_in_board_m != b.corners[i].x_in_board_m ||
        !((a.corners[i].pixel - b.corners[i].pixel).norm() < kSamePx)) {
      return false;
    }
  }
  return true;
}

// How wide dark spots of a picture are, median.
double SpotWidthPx(const cv::Mat& picture) {
  cv::Mat labels, stats, centroids;
  const int count =
      cv::connectedComponentsWithStats(picture < kSpotGrey, labels, stats, centroids, 8, CV_32S);
  std::vector<double> widths;
  for (int i = 1; i < count; ++i) {
    const int area = stats.at<int>(i, cv::CC_STAT_AREA);
    if (area >= 4) widths.push_back(std::sqrt(area * 4 / 3.14159265));
  }
  return widths.empty() ? 0 : UpperMedian(std::move(widths));
}

absl::Status NoBoardInEvents(const Board& board, const EventBoardCounts& counts,
                             const std::vector<cv::Mat>& pictures) {
  const std::string flicker =
      counts.flicker_hz > 0
          ? absl::StrFormat(" Something flickers at %.1f Hz: a lamp?", counts.flicker_hz)
          : "";
  if (counts.events == 0) return absl::FailedPreconditionError("there were no events");
  const std::string how =
      "open the page /pattern of rigcal-server on a screen, full screen, lower the lights, and "
      "hold it still before the camera for a second at a time; or move a printed board of circles "
      "without a rest";
  if (counts.pictures == 0 && counts.too_quick > counts.bursts) {
    return absl::FailedPreconditionError(absl::StrFormat(
        "no %s board: what changes does so %s, as a lamp does, and not a screen; %s",
        CountsOf(board),
        counts.flicker_hz > 0 ? absl::StrFormat("at %.1f Hz", counts.flicker_hz)
                              : std::string("every few milliseconds"),
        how));
  }
  if (counts.pictures == 0) {
    return absl::FailedPreconditionError(
        absl::StrCat("no ", CountsOf(board), " board: nothing blinks and next to nothing moves in ",
                     counts.events, " events.", flicker, " Now ", how));
  }
  const absl::Status none = NoBoard(board, static_cast<int>(counts.pictures), pictures);
  if (absl::StrContains(none.message(), "say --board")) return none;
  const std::string head =
      absl::StrFormat("no %s board in %u pictures of %s", CountsOf(board), counts.pictures,
                      counts.bursts > 0 && counts.blink_hz > 0
                          ? absl::StrFormat("what blinks at %.2f Hz", counts.blink_hz)
                          : std::string("what moves"));
  std::vector<double> widths;
  for (const cv::Mat& picture : pictures) widths.push_back(SpotWidthPx(picture));
  const double width_px = widths.empty() ? 0 : UpperMedian(std::move(widths));
  if (counts.bursts > 0 && width_px > 0 && width_px < kLeastSpotPx) {
    return absl::FailedPreconditionError(absl::StrFormat(
        "%s: its spots are %.0f px wide. Go nearer, or take a larger screen: a circle should be at "
        "least %.0f px wide in the image",
        head, width_px, kLeastSpotPx));
  }
  return absl::FailedPreconditionError(absl::StrCat(
      head,
      ": are the counts those of --board, is all of it in the image, and is it not a mirror "
      "image?",
      flicker, " If there is no such board yet, ", how));
}

}  // namespace

absl::StatusOr<BoardViews> CollectBoardViews(const Board& board, const BoardViewsOptions& options,
                                             BoardPictures* pictures,
                                             const std::function<bool(const BoardViews&)>& taken) {
  BoardViews result;
  result.image_size_px = pictures->description().image_size_px;
  result.camera = pictures->description().camera;
  ViewChoice choice(result.image_size_px, {.sharp = kSharpEdgePx});
  const auto points = board.Points();
  std::vector<cv::Mat> bare;
  int moving = 0;  // views that a motion has blurred
  RIGCAL_RETURN_IF_ERROR(pictures->Start());
  while (options.views == 0 || static_cast<int>(result.views.size()) < options.views) {
    RIGCAL_ASSIGN_OR_RETURN(const BoardPicture* const picture, pictures->Next());
    if (picture == nullptr) break;
    ++result.pictures;
    const std::optional<SeenBoard>& seen = picture->seen;
    if (!seen) {
      if (bare.size() < kKeptPictures) {
        bare.push_back(CopyOf(picture->image));
        // Nobody waits for the rest of a thousand pictures to be told.
        if (result.with_board == 0 && bare.size() == kKeptPictures && !pictures->event_counts()) {
          RIGCAL_RETURN_IF_ERROR(CheckCounts(board, result.pictures, bare));
        }
      }
      const bool is_bare = result.with_board == 0 && result.pictures >= kMostBarePictures;
      if (options.only_different && is_bare) break;
      continue;
    }
    ++result.with_board;
    BoardView view;
    view.name = picture->file.empty() ? absl::StrCat("picture ", result.pictures)
                                      : fs::path(picture->file).filename().string();
    for (size_t i = 0; i < points.size(); ++i) {
      if (!seen->Sees(i)) continue;
      view.corners.push_back({points[i], seen->pixels[i], 0.5 * board.CircleDiameter()});
    }
    if (options.only_different) {
      if (picture->is_blurred) {
        ++moving;
        result.blurred = choice.blurred() + moving;
        continue;
      }
      const ViewChoice::Verdict verdict = choice.Offer(view, seen->edge_width_px);
      result.alike = choice.alike();
      result.blurred = choice.blurred() + moving;
      if (verdict != ViewChoice::Verdict::kTaken) continue;
    } else if (std::ranges::any_of(result.views, [&view](const BoardView& other) {
                 return AreOneView(view, other);
               })) {
      ++result.alike;
      continue;
    }
    result.views.push_back(std::move(view));
    if (!taken(result)) break;
  }
  pictures->Stop();
  result.refused = pictures->Refused();
  result.events = pictures->event_counts();
  if (result.with_board == 0 && result.events) return NoBoardInEvents(board, *result.events, bare);
  if (result.pictures == 0) return absl::FailedPreconditionError("there were no pictures");
  if (result.with_board == 0) return NoBoard(board, result.pictures, bare);
  if (!result.events) {
    const std::string instead = WhatMostShow(board, result, bare);
    if (!instead.empty()) return absl::FailedPreconditionError(instead);
  }
  return result;
}

}  // namespace rigcal::agent
