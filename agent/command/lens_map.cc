// SPDX-License-Identifier: Apache-2.0
#include "agent/command/lens_map.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "absl/strings/str_format.h"

namespace rigcal::agent {
namespace {

constexpr int kLongSide = 960;  // of the map
constexpr int kLegend = 180;    // width
constexpr int kBarWidth = 24;
constexpr int kTicks = 4;
const cv::Scalar kInk(40, 40, 40), kPaper(255, 255, 255), kNoRay(128, 128, 128);

// 1, 2 or 5 times a power of ten, at least `value`.
double RoundUp(double value) {
  const double power = std::pow(10, std::floor(std::log10(std::max(value, 1e-6))));
  for (const double step : {1.0, 2.0, 5.0}) {
    if (step * power >= value) return step * power;
  }
  return 10 * power;
}

cv::Mat Coloured(const cv::Mat& share) {
  cv::Mat grey, colours;
  share.convertTo(grey, CV_8U, 255);
  cv::applyColorMap(grey, colours, cv::COLORMAP_VIRIDIS);
  return colours;
}

void Write(const std::string& text, const cv::Point& at, cv::Mat* image) {
  cv::putText(*image, text, at, cv::FONT_HERSHEY_SIMPLEX, 0.5, kInk, 1, cv::LINE_AA);
}

}  // namespace

absl::StatusOr<std::string> DrawLensMap(const BoardViews& views, const LensSolution& solution) {
  const LensUncertainty& uncertainty = solution.uncertainty;
  if (!std::isfinite(uncertainty.p95_px)) {
    return absl::FailedPreconditionError(
        "the views do not determine the lens, so there is no map of its uncertainty: tilt the "
        "board more, and hold it in other parts of the image");
  }
  cv::Mat sigmas(LensDifference::kRows, LensDifference::kColumns, CV_32F);
  cv::Mat has_ray(sigmas.size(), CV_8U);
  for (int i = 0; i < static_cast<int>(sigmas.total()); ++i) {
    const double sigma = uncertainty.map_px[static_cast<size_t>(i)];
    const int row = i / sigmas.cols, column = i % sigmas.cols;
    sigmas.at<float>(row, column) = std::isfinite(sigma) ? static_cast<float>(sigma) : 0;
    has_ray.at<uint8_t>(row, column) = std::isfinite(sigma) ? 255 : 0;
  }
  // The corners of the image may be far worse than the rest.
  const double top_px = RoundUp(uncertainty.p95_px);
  const double scale = static_cast<double>(kLongSide) /
                       std::max(views.image_size_px.width, views.image_size_px.height);
  const cv::Size size(
      std::max(1, static_cast<int>(std::lround(scale * views.image_size_px.width))),
      std::max(1, static_cast<int>(std::lround(scale * views.image_size_px.height))));
  // The grid reaches from border to border, so that its outer pixels are only half in the map.
  cv::Mat columns(size, CV_32F), rows(size, CV_32F);
  for (int row = 0; row < size.height; ++row) {
    for (int column = 0; column < size.width; ++column) {
      columns.at<float>(row, column) = static_cast<float>(column) *
                                       static_cast<float>(sigmas.cols - 1) /
                                       static_cast<float>(std::max(1, size.width - 1));
      rows.at<float>(row, column) = static_cast<float>(row) * static_cast<float>(sigmas.rows - 1) /
                                    static_cast<float>(std::max(1, size.height - 1));
    }
  }
  cv::Mat share, shown;
  cv::remap(sigmas / top_px, share, columns, rows, cv::INTER_LINEAR, cv::BORDER_REPLICATE);
  cv::remap(has_ray, shown, columns, rows, cv::INTER_NEAREST, cv::BORDER_REPLICATE);
  cv::Mat picture(size.height, size.width + kLegend, CV_8UC3, kPaper);
  cv::Mat map = picture(cv::Rect(cv::Point(0, 0), size));
  map.setTo(kNoRay);
  Coloured(share).copyTo(map, shown);
  for (const BoardView& view : views.views) {
    for (const BoardCorner& corner : view.corners) {
      cv::circle(map, cv::Point(cv::Point2d(scale * corner.pixel.x(), scale * corner.pixel.y())), 1,
                 kPaper, cv::FILLED, cv::LINE_AA);
    }
  }

  const int left = size.width + 16, top = 48, bottom = std::max(top + 40, size.height - 48);
  Write("one sigma, px", {left, 24}, &picture);
  for (int row = top; row < bottom && row < picture.rows; ++row) {
    const float value = static_cast<float>(bottom - row) / static_cast<float>(bottom - top);
    Coloured(cv::Mat(1, kBarWidth, CV_32F, cv::Scalar(value)))
        .copyTo(picture(cv::Rect(left, row, kBarWidth, 1)));
  }
  for (int tick = 0; tick <= kTicks; ++tick) {
    Write(absl::StrFormat("%.3g%s", top_px * tick / kTicks, tick == kTicks ? " and more" : ""),
          {left + kBarWidth + 8, bottom - (bottom - top) * tick / kTicks + 5}, &picture);
  }
  Write(absl::StrFormat("95 %%: %.3f", uncertainty.p95_px), {left, bottom + 28}, &picture);
  std::vector<uint8_t> bytes;
  if (!cv::imencode(".png", picture, bytes)) {
    return absl::InternalError("the map of the lens could not be written as a PNG");
  }
  return std::string(bytes.begin(), bytes.end());
}

}  // namespace rigcal::agent
