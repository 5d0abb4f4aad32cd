// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/frame/annotated_image.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "agent/detect/frame/colour_share.h"

namespace rigcal::agent {
namespace {

const cv::Scalar kMarkerColour(80, 255, 80);
const cv::Scalar kBlobColour(0, 220, 255);
const cv::Scalar kWindowColour(255, 160, 40);
const cv::Scalar kOutlineColour(0, 0, 0);
constexpr int kSubPixelBits = 4;                     // positions are drawn in steps of 1/16 px
constexpr std::array kQualities = {88, 72, 55, 40};  // in the order in which they are tried
constexpr int kLeastSide = 16;                       // px, of the smallest version
constexpr double kWorthSaying = 0.001;               // share of the image

cv::Mat ColourCopy(const ImageView& image) {
  if (image.data == nullptr || image.width <= 0 || image.height <= 0) return {};
  const int type = image.format == PixelFormat::kBgr8 ? CV_8UC3 : CV_8UC1;
  // OpenCV has no view of pixels that it must not write; it only reads these.
  const cv::Mat view(image.height, image.width, type, const_cast<uint8_t*>(image.data),
                     static_cast<size_t>(image.stride_bytes));
  cv::Mat copy;
  if (type == CV_8UC1) {
    cv::cvtColor(view, copy, cv::COLOR_GRAY2BGR);
  } else {
    copy = view.clone();
  }
  return copy;
}

// Points far outside of the image would overflow OpenCV's fixed-point numbers.
bool CanDraw(const cv::Mat& canvas, const Eigen::Vector2d& point_px) {
  return point_px.x() >= -canvas.cols && point_px.x() <= 2 * canvas.cols &&
         point_px.y() >= -canvas.rows && point_px.y() <= 2 * canvas.rows;
}

cv::Point SubPixel(const Eigen::Vector2d& point_px) {
  return {static_cast<int>(std::lround(point_px.x() * (1 << kSubPixelBits))),
          static_cast<int>(std::lround(point_px.y() * (1 << kSubPixelBits)))};
}

// Grows with the image, so that text can still be read in a smaller copy.
double Scale(const cv::Mat& canvas) { return std::clamp(canvas.cols / 1280.0, 0.4, 4.0); }

void Write(cv::Mat& canvas, const std::string& text, const cv::Point& where, double size,
           const cv::Scalar& colour) {
  const int thickness = std::max(1, static_cast<int>(std::lround(1.6 * size)));
  cv::putText(canvas, text, where, cv::FONT_HERSHEY_SIMPLEX, size, kOutlineColour, 3 * thickness,
              cv::LINE_AA);
  cv::putText(canvas, text, where, cv::FONT_HERSHEY_SIMPLEX, size, colour, thickness, cv::LINE_AA);
}

void DrawBlob(cv::Mat& canvas, const Blob& blob) {
  if (!CanDraw(canvas, blob.centre_px) || !blob.second_moment_px2.allFinite()) return;
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes;
  axes.computeDirect(blob.second_moment_px2);
  // A full ellipse has semi-axes of twice the square roots of its second moments.
  const double limit = canvas.cols + canvas.rows;
  const Eigen::Vector2d semi_px =
      (2 * axes.eigenvalues().cwiseMax(0).cwiseSqrt().array() + 2).min(limit);
  const Eigen::Vector2d major = axes.eigenvectors().col(1);
  cv::ellipse(canvas, SubPixel(blob.centre_px), SubPixel({semi_px[1], semi_px[0]}),
              std::atan2(major.y(), major.x()) * 180 / M_PI, 0, 360, kBlobColour, 1, cv::LINE_AA,
              kSubPixelBits);
}

void DrawMarkers(cv::Mat& canvas, const Observation& observation) {
  const double scale = Scale(canvas);
  const double arm_px = 14 * scale;
  const Eigen::Vector2d* before = nullptr;
  for (size_t m = 0; m < observation.markers.size(); ++m) {
    const MarkerObservation& marker = observation.markers[m];
    const Eigen::Vector2d& centre = marker.centre_px;
    if (!marker.visible || !CanDraw(canvas, centre)) continue;
    const auto line = [&](const Eigen::Vector2d& from, const Eigen::Vector2d& to) {
      cv::line(canvas, SubPixel(from), SubPixel(to), kMarkerColour, 1, cv::LINE_AA, kSubPixelBits);
    };
    if (before != nullptr) line(*before, centre);
    before = &centre;
    line(centre - Eigen::Vector2d(arm_px, 0), centre + Eigen::Vector2d(arm_px, 0));
    line(centre - Eigen::Vector2d(0, arm_px), centre + Eigen::Vector2d(0, arm_px));
    const cv::Point label(static_cast<int>(centre.x() + arm_px),
                          static_cast<int>(centre.y() - arm_px));
    Write(canvas, absl::StrCat(m), label, 0.8 * scale, kMarkerColour);
  }
}

std::string Summary(const Detection& detection) {
  const std::string_view outcome = DetectionOutcomeText(detection.outcome);
  std::string text(outcome);
  if (detection.outcome == DetectionOutcome::kWand) {
    absl::StrAppendFormat(&text, ", confidence %.2f, %d of %d markers", detection.confidence,
                          detection.observation.VisibleCount(),
                          detection.observation.markers.size());
  }
  absl::StrAppend(&text, ", ", detection.blob_count,
                  detection.blob_count == 1 ? " blob" : " blobs");
  if (detection.occluded_markers > 0) {
    absl::StrAppend(&text, ", ", detection.occluded_markers, " half occluded");
  }
  if (detection.tracked) absl::StrAppend(&text, ", tracked");
  return text;
}

// Describes what makes the wand hard to find; empty if nothing does.
std::string Light(const Detection& detection) {
  std::string text = ColourShareText(detection.passed_share, detection.white_share);
  if (detection.background_share < kWorthSaying) return text;
  absl::StrAppendFormat(&text, "%s%.2g %% does not move and is ignored", text.empty() ? "" : "; ",
                        100 * detection.background_share);
  return text;
}

// Returns the image with 1 / `divisor` of its columns and rows.
cv::Mat Shrunk(const cv::Mat& image, int divisor) {
  if (divisor == 1) return image;
  cv::Mat small;
  const cv::Size size(std::max(1, image.cols / divisor), std::max(1, image.rows / divisor));
  cv::resize(image, small, size, 0, 0, cv::INTER_AREA);
  return small;
}

}  // namespace

cv::Mat Annotate(const ImageView& image, const Detection& detection, const PixelRect& window,
                 absl::Span<const Blob> blobs) {
  cv::Mat canvas = ColourCopy(image);
  if (canvas.empty()) return canvas;
  const double scale = Scale(canvas);
  const cv::Rect shown = cv::Rect(window.x, window.y, window.width, window.height) &
                         cv::Rect(0, 0, canvas.cols, canvas.rows);
  if (!window.empty() && !shown.empty()) cv::rectangle(canvas, shown, kWindowColour, 1);
  for (const Blob& blob : blobs) DrawBlob(canvas, blob);
  DrawMarkers(canvas, detection.observation);
  const bool found = detection.outcome == DetectionOutcome::kWand;
  const auto margin = static_cast<int>(12 * scale);
  Write(canvas, Summary(detection), {margin, static_cast<int>(32 * scale)}, 0.8 * scale,
        found ? kMarkerColour : kBlobColour);
  Write(canvas, Light(detection), {margin, static_cast<int>(60 * scale)}, 0.6 * scale, kBlobColour);
  return canvas;
}

absl::StatusOr<JpegImage> EncodeJpeg(const cv::Mat& image, size_t max_bytes) {
  if (image.empty() || (image.type() != CV_8UC3 && image.type() != CV_8UC1)) {
    return absl::InvalidArgumentError(absl::StrCat("an image of ", image.cols, "x", image.rows,
                                                   " pixels and type ", image.type(),
                                                   " cannot be written as JPEG"));
  }
  try {
    std::vector<uint8_t> bytes;
    for (int divisor = 1;; divisor *= 2) {
      const cv::Mat small = Shrunk(image, divisor);
      for (const int quality : kQualities) {
        if (!cv::imencode(".jpg", small, bytes, {cv::IMWRITE_JPEG_QUALITY, quality})) {
          return absl::InternalError("OpenCV could not write the image as JPEG");
        }
        if (bytes.size() > max_bytes) continue;
        return JpegImage{std::string(bytes.begin(), bytes.end()), small.cols, small.rows};
      }
      if (std::min(small.cols, small.rows) < 2 * kLeastSide) break;
    }
  } catch (const cv::Exception& error) {
    return absl::InternalError(absl::StrCat("OpenCV could not write the image: ", error.what()));
  }
  return absl::ResourceExhaustedError(absl::StrCat("an image of ", image.cols, "x", image.rows,
                                                   " pixels cannot be made as small as ", max_bytes,
                                                   " bytes; allow more"));
}

}  // namespace rigcal::agent
