// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/event_board_watch.h"

#include <spdlog/spdlog.h>

#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "agent/detect/board/circle_projection.h"
#include "agent/identify/wand_finder.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

// One sigma of a disc along an axis, besides the scatter of all: of a burst's picture, and of what
// moves, whose discs are all ahead by about so much.
constexpr double kBurstFloorPx = 0.05, kMotionFloorPx = 1;
constexpr double kBurstTimeS = 2e-3;  // one sigma of a picture's time

}  // namespace

absl::Status CheckShownByEvents(const Board& board, const std::string& camera) {
  if (board.HasCircles()) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(
      "camera ", camera, " yields events, in which ", FormatBoard(board),
      " is not looked for: corners are not where edges have events. Take a board of circles, on a "
      "screen (the page /pattern of rigcal-server shows one that blinks) or printed and moved: "
      "board:circles,4x11,0.02"));
}

absl::StatusOr<EventBoardWatch> EventBoardWatch::Create(const Target& target,
                                                        const CameraDescription& camera) {
  RIGCAL_RETURN_IF_ERROR(CheckTargetAndCamera(target, camera));
  RIGCAL_ASSIGN_OR_RETURN(const Board board, ParseBoard(target.board));
  RIGCAL_RETURN_IF_ERROR(CheckShownByEvents(board, camera.camera));
  return EventBoardWatch(target, camera, board);
}

absl::Status EventBoardWatch::Take(const EventChunk& chunk, std::vector<Detection>* found) {
  if (chunk.clock_began_anew && detector_) {
    RIGCAL_RETURN_IF_ERROR(EndDetector(found));
    first_epoch_ = last_epoch_ + 1;
  }
  if (!detector_) {
    const ImageSize& size = camera_.image_size_px;
    detector_.emplace(board_, SensorGeometry{size.width, size.height}, chunk.format,
                      chunk.halves_swapped);
  }
  std::vector<EventBoardPicture> pictures;
  RIGCAL_RETURN_IF_ERROR(detector_->Take(chunk.bytes, &pictures));
  Tell(pictures, found);
  return absl::OkStatus();
}

absl::Status EventBoardWatch::EndDetector(std::vector<Detection>* found) {
  std::vector<EventBoardPicture> pictures;
  RIGCAL_RETURN_IF_ERROR(detector_->Finish(&pictures));
  Tell(pictures, found);
  past_faults_ += detector_->faults();
  detector_.reset();
  return absl::OkStatus();
}

absl::Status EventBoardWatch::Finish(std::vector<Detection>* found) {
  if (!detector_) return absl::OkStatus();
  const EventBoardCounts counts = detector_->counts();
  if (counts.blink_hz > 0) {
    spdlog::info("camera {}: the board blinks at {:.2f} Hz and was found in {} of {} changes",
                 camera_.camera, counts.blink_hz, counts.boards, counts.pictures);
  } else {
    spdlog::info(
        "camera {}: nothing blinks; the board was found in {} of {} pictures of what moves",
        camera_.camera, counts.boards, counts.pictures);
  }
  return EndDetector(found);
}

EventFaults EventBoardWatch::faults() const {
  EventFaults all = past_faults_;
  if (detector_) all += detector_->faults();
  return all;
}

void EventBoardWatch::Tell(const std::vector<EventBoardPicture>& pictures,
                           std::vector<Detection>* found) {
  for (const EventBoardPicture& picture : pictures) {
    const uint32_t epoch = first_epoch_ + picture.clock_epoch;
    if (epoch != std::exchange(last_epoch_, epoch)) last_ns_.reset();
    const int64_t time_ns = std::llround(1e3 * picture.time_us);
    if (last_ns_ && time_ns <= *last_ns_) continue;
    last_ns_ = time_ns;
    Detection detection;
    detection.outcome = picture.seen ? DetectionOutcome::kWand : DetectionOutcome::kNoWand;
    by_outcome_.Add(detection.outcome);
    detection.observation.time_ns = time_ns;
    detection.observation.clock_epoch = epoch;
    detection.observation.markers.resize(static_cast<size_t>(target_.marker_count()));
    if (picture.seen) {
      detection.confidence = 1;
      std::vector<Eigen::Vector2d> pixels = picture.seen->pixels;
      if (camera_.intrinsics) CorrectCircles(board_, *camera_.intrinsics, &pixels);
      const bool is_burst = picture.kind == EventBoardPicture::Kind::kBurst;
      const double late_px =
          is_burst && picture.speed_px_s > 0 ? kBurstTimeS * picture.speed_px_s : 0;
      const double sigma_px = std::hypot(is_burst ? kBurstFloorPx : kMotionFloorPx, late_px,
                                         PointSigma(board_, pixels));
      for (size_t i = 0; i < pixels.size(); ++i) {
        MarkerObservation& marker = detection.observation.markers[i];
        marker.visible = true;
        marker.centre_px = pixels[i];
        marker.covariance_px2 = sigma_px * sigma_px * Eigen::Matrix2d::Identity();
      }
    }
    found->push_back(std::move(detection));
  }
}

}  // namespace rigcal::agent
