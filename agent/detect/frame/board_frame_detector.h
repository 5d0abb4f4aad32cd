// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "agent/detect/board/board_detector.h"
#include "agent/detect/frame/frame_detector.h"
#include "common/board/board.h"

namespace rigcal::agent {

// Finds a printed board in the images of one camera: marker m is point m of Board::Points(). A
// checker that is followed moves with the image, another board is looked for around where it was. A
// whole board is found or none. Movable; one thread at a time.
class BoardFrameDetector : public FrameDetector {
 public:
  // INVALID_ARGUMENT: target or camera not valid; names the camera.
  static absl::StatusOr<BoardFrameDetector> Create(const Target& target,
                                                   const CameraDescription& camera);

  // Masked pixels are grey for the search.
  void SetIgnored(const PixelMask& ignored) override { ignored_ = ignored; }
  // A board that rests is a board: nothing is ignored.
  void SetBackground(StaticBackground*) override {}
  absl::StatusOr<Detection> Detect(const ImageView& image, int64_t time_ns,
                                   uint32_t clock_epoch) override;
  PixelRect window() const override { return window_; }
  absl::Span<const Blob> blobs() const override { return {}; }

 private:
  BoardFrameDetector(const Target& target, const CameraDescription& camera, const Board& board);
  // Where the board may be now: around where it was, as far as it may have moved.
  std::optional<PixelRect> Expected(const PixelRect& bounds, uint32_t clock_epoch) const;
  absl::StatusOr<std::optional<SeenBoard>> FindIn(const ImageView& image, const PixelRect& part);
  absl::StatusOr<std::optional<SeenBoard>> FollowIn(const ImageView& image, const PixelRect& part);
  absl::StatusOr<std::optional<SeenBoard>> Search(const ImageView& image);
  void Keep(const ImageView& image, const std::vector<Eigen::Vector2d>& pixels);
  // Of boards that were never seen: whether there is one with other counts.
  void LookForOther(const ImageView& image);
  ImageView WithoutIgnored(const ImageView& image);

  Target target_;
  CameraDescription camera_;
  Board board_;
  PixelMask ignored_;
  PixelRect window_;
  std::vector<uint8_t> unmasked_;                       // the image without what is ignored
  std::vector<Eigen::Vector2d> last_px_;                // of the last image; empty: not found there
  cv::Mat last_grey_;                                   // that image, of a checker
  Eigen::Vector2d moved_px_ = Eigen::Vector2d::Zero();  // from the image before to the last one
  uint32_t epoch_ = 0;
  int missed_ = 0;  // images in a row
  bool was_seen_ = false;
  std::vector<cv::Mat> other_;  // images without the board, to look for another one in
  int images_between_ = 5;      // them; more the longer there is none
  std::string other_target_;    // Detection::other_target
};

}  // namespace rigcal::agent
