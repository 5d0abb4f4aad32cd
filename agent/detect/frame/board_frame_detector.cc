// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/frame/board_frame_detector.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "agent/detect/board/board_counts.h"
#include "agent/detect/board/circle_projection.h"
#include "agent/detect/frame/image_exposure.h"
#include "agent/identify/wand_finder.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

// Around a board, of its size: room for its margin and for a motion that changes.
constexpr double kRoomShare = 0.2;
// A board that is too small for a quick search is looked for in every so-many-th image.
constexpr int kImagesPerFullSearch = 4;
// One sigma of a circle that noise does not explain: it is round in the image only from the front.
constexpr double kCircleFloorPx = 0.02;
constexpr uint8_t kIgnoredGrey = 128;
// Pictures in which other counts are looked for, if the board was never seen.
constexpr size_t kPicturesOfOther = 4;

PixelRect BoxOf(const std::vector<Eigen::Vector2d>& pixels, const PixelRect& bounds, double room) {
  constexpr double kFar = std::numeric_limits<double>::infinity();
  Eigen::Array2d low(kFar, kFar), high(-kFar, -kFar);
  for (const Eigen::Vector2d& pixel : pixels) {
    if (!pixel.allFinite()) continue;
    low = low.min(pixel.array());
    high = high.max(pixel.array());
  }
  const double margin = room + kRoomShare * (high - low).maxCoeff();
  const int left = std::max(bounds.x, static_cast<int>(low[0] - margin));
  const int top = std::max(bounds.y, static_cast<int>(low[1] - margin));
  const int right = std::min(bounds.x + bounds.width, static_cast<int>(high[0] + margin) + 1);
  const int bottom = std::min(bounds.y + bounds.height, static_cast<int>(high[1] + margin) + 1);
  return {left, top, right - left, bottom - top};
}

ImageView PartOf(const ImageView& image, const PixelRect& part) {
  return {image.Row(part.y) + part.x * BytesPerPixel(image.format), part.width, part.height,
          image.stride_bytes, image.format};
}

// Of a grey image, it is the image itself.
cv::Mat GreyOf(const ImageView& image) {
  const int type = image.format == PixelFormat::kMono8 ? CV_8UC1 : CV_8UC3;
  // OpenCV does not write through it.
  const cv::Mat view(image.height, image.width, type, const_cast<uint8_t*>(image.data),
                     static_cast<size_t>(image.stride_bytes));
  if (image.format == PixelFormat::kMono8) return view;
  cv::Mat grey;
  cv::cvtColor(view, grey, cv::COLOR_BGR2GRAY);
  return grey;
}

}  // namespace

BoardFrameDetector::BoardFrameDetector(const Target& target, const CameraDescription& camera,
                                       const Board& board)
    : target_(target), camera_(camera), board_(board) {}

absl::StatusOr<BoardFrameDetector> BoardFrameDetector::Create(const Target& target,
                                                              const CameraDescription& camera) {
  absl::Status status = CheckTargetAndCamera(target, camera);
  absl::StatusOr<Board> board = ParseBoard(target.board);
  status.Update(board.status());
  if (!status.ok()) {
    return absl::InvalidArgumentError(
        absl::StrCat("camera ", camera.camera, ": ", std::string(status.message())));
  }
  return BoardFrameDetector(target, camera, *board);
}

std::optional<PixelRect> BoardFrameDetector::Expected(const PixelRect& bounds,
                                                      uint32_t clock_epoch) const {
  if (last_px_.empty() || clock_epoch != epoch_) return std::nullopt;
  std::vector<Eigen::Vector2d> moved = last_px_;
  for (Eigen::Vector2d& pixel : moved) pixel += moved_px_;
  const PixelRect part = BoxOf(moved, bounds, moved_px_.norm());
  if (part.empty()) return std::nullopt;
  return part;
}

absl::StatusOr<std::optional<SeenBoard>> BoardFrameDetector::FindIn(const ImageView& image,
                                                                    const PixelRect& part) {
  window_ = part;
  RIGCAL_ASSIGN_OR_RETURN(std::optional<SeenBoard> seen, FindBoard(board_, PartOf(image, part)));
  if (seen) {
    for (Eigen::Vector2d& pixel : seen->pixels) pixel += Eigen::Vector2d(part.x, part.y);
  }
  return seen;
}

absl::StatusOr<std::optional<SeenBoard>> BoardFrameDetector::Search(const ImageView& image) {
  window_ = image.Bounds();
  const bool is_thorough = missed_ % kImagesPerFullSearch == 0;
  return FindBoard(board_, image, is_thorough ? BoardSearch::kThorough : BoardSearch::kQuick);
}

// For the next image.
void BoardFrameDetector::Keep(const ImageView& image, const std::vector<Eigen::Vector2d>& pixels) {
  last_px_ = pixels;
  if (board_.kind != BoardKind::kChecker) return;
  GreyOf(image).copyTo(last_grey_);
}

absl::StatusOr<std::optional<SeenBoard>> BoardFrameDetector::FollowIn(const ImageView& image,
                                                                      const PixelRect& part) {
  if (board_.kind != BoardKind::kChecker) return FindIn(image, part);
  window_ = part;
  return FollowBoard(board_,
                     {last_grey_.data, last_grey_.cols, last_grey_.rows,
                      static_cast<ptrdiff_t>(last_grey_.step), PixelFormat::kMono8},
                     last_px_, image);
}

ImageView BoardFrameDetector::WithoutIgnored(const ImageView& image) {
  if (ignored_.CountPixels() == 0) return image;
  const int bytes = BytesPerPixel(image.format);
  const size_t row_bytes = static_cast<size_t>(image.width * bytes);
  unmasked_.resize(row_bytes * static_cast<size_t>(image.height));
  for (int y = 0; y < image.height; ++y) {
    uint8_t* const row = unmasked_.data() + row_bytes * static_cast<size_t>(y);
    std::copy_n(image.Row(y), row_bytes, row);
    for (int x = 0; x < image.width; ++x) {
      if (ignored_.Get(x, y)) std::fill_n(row + x * bytes, bytes, kIgnoredGrey);
    }
  }
  return {unmasked_.data(), image.width, image.height, static_cast<ptrdiff_t>(row_bytes),
          image.format};
}

void BoardFrameDetector::LookForOther(const ImageView& image) {
  if (was_seen_ || !other_target_.empty() || missed_ % images_between_ != 1) return;
  other_.push_back(GreyOf(image).clone());
  if (other_.size() < kPicturesOfOther) return;
  const std::optional<CountsGuess> guess = GuessCounts(board_, other_);
  other_.clear();
  if (!guess || static_cast<size_t>(guess->pictures) * 2 < kPicturesOfOther) {
    images_between_ *= 2;  // nobody holds one yet
    return;
  }
  other_target_ = absl::StrCat("the images show a board of ", guess->board.columns, "x",
                               guess->board.rows, ", not of ", board_.columns, "x", board_.rows,
                               ": say --target ", FormatBoard(guess->board));
}

absl::StatusOr<Detection> BoardFrameDetector::Detect(const ImageView& image, int64_t time_ns,
                                                     uint32_t clock_epoch) {
  RIGCAL_RETURN_IF_ERROR(CheckImage(camera_, image));
  Detection detection;
  detection.observation.time_ns = time_ns;
  detection.observation.clock_epoch = clock_epoch;
  detection.observation.markers.resize(static_cast<size_t>(target_.marker_count()));
  const ImageView searched = WithoutIgnored(image);
  std::optional<SeenBoard> seen;
  if (const auto part = Expected(image.Bounds(), clock_epoch)) {
    RIGCAL_ASSIGN_OR_RETURN(seen, FollowIn(searched, *part));
    detection.tracked = seen.has_value();
  }
  if (!seen) {
    RIGCAL_ASSIGN_OR_RETURN(seen, Search(searched));
  }
  if (!seen) {
    ++missed_;
    last_px_.clear();
    LookForOther(searched);
    detection.other_target = other_target_;
    const ImageExposure exposure = LookAtExposure(image);
    detection.outcome = exposure == ImageExposure::kSaturated ? DetectionOutcome::kSaturated
                        : exposure == ImageExposure::kBlack   ? DetectionOutcome::kBlack
                                                              : DetectionOutcome::kNoWand;
    return detection;
  }
  missed_ = 0;
  was_seen_ = true;
  other_.clear();
  other_target_.clear();
  moved_px_.setZero();
  int both = 0;
  for (size_t i = 0; detection.tracked && i < last_px_.size(); ++i) {
    const Eigen::Vector2d moved_px = seen->pixels[i] - last_px_[i];
    if (!moved_px.allFinite()) continue;
    moved_px_ += moved_px;
    ++both;
  }
  moved_px_ /= std::max(1, both);
  Keep(searched, seen->pixels);
  epoch_ = clock_epoch;
  detection.outcome = DetectionOutcome::kWand;
  detection.confidence = 1;
  if (camera_.intrinsics) CorrectCircles(board_, *camera_.intrinsics, &seen->pixels);
  const bool has_corners = !seen->sigmas_px.empty();
  const double circle_px =
      has_corners ? 0 : std::hypot(kCircleFloorPx, PointSigma(board_, seen->pixels));
  for (size_t i = 0; i < seen->pixels.size(); ++i) {
    MarkerObservation& marker = detection.observation.markers[i];
    if (!seen->Sees(i)) continue;
    marker.visible = true;
    marker.centre_px = seen->pixels[i];
    const double sigma_px = has_corners ? seen->sigmas_px[i] : circle_px;
    marker.covariance_px2 = sigma_px * sigma_px * Eigen::Matrix2d::Identity();
  }
  return detection;
}

}  // namespace rigcal::agent
