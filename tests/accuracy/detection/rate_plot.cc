// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/detection/rate_plot.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "absl/strings/str_cat.h"

namespace rigcal::accuracy {
namespace {

constexpr int kWidthPx = 1200, kHeightPx = 760;
constexpr int kLeftPx = 110, kRightPx = 40, kTopPx = 80, kBottomPx = 90;
constexpr double kMinRate = 0, kMaxRate = 1.05;
constexpr int kFont = cv::FONT_HERSHEY_SIMPLEX;
const cv::Scalar kBlack(30, 30, 30), kGrid(225, 225, 225), kGoal(150, 150, 150);

// Blue, orange, green, vermilion: safe for colour-blind readers.
const std::array<cv::Scalar, 4> kColours = {cv::Scalar(178, 114, 0), cv::Scalar(0, 159, 230),
                                            cv::Scalar(115, 158, 0), cv::Scalar(0, 94, 213)};

cv::Point2d At(const RatePlot& plot, double x, double rate) {
  const double across = plot.logarithmic_x
                            ? std::log(x / plot.min_x) / std::log(plot.max_x / plot.min_x)
                            : (x - plot.min_x) / (plot.max_x - plot.min_x);
  const double up = (rate - kMinRate) / (kMaxRate - kMinRate);
  return {kLeftPx + across * (kWidthPx - kLeftPx - kRightPx),
          kHeightPx - kBottomPx - up * (kHeightPx - kTopPx - kBottomPx)};
}

void Text(cv::Mat* image, const std::string& text, cv::Point2d middle, double scale) {
  int baseline = 0;
  const cv::Size size = cv::getTextSize(text, kFont, scale, 1, &baseline);
  cv::putText(*image, text, middle + cv::Point2d(-0.5 * size.width, 0.5 * size.height), kFont,
              scale, kBlack, 1, cv::LINE_AA);
}

void DrawUpwards(cv::Mat* image, const std::string& text, cv::Point2d middle, double scale) {
  int baseline = 0;
  const cv::Size size = cv::getTextSize(text, kFont, scale, 1, &baseline);
  cv::Mat strip(size.height + 2 * baseline, size.width + 10, CV_8UC3, cv::Scalar::all(255));
  cv::putText(strip, text, {5, size.height + baseline / 2}, kFont, scale, kBlack, 1, cv::LINE_AA);
  cv::rotate(strip, strip, cv::ROTATE_90_COUNTERCLOCKWISE);
  const cv::Point corner(static_cast<int>(middle.x) - strip.cols / 2,
                         static_cast<int>(middle.y) - strip.rows / 2);
  strip.copyTo((*image)(cv::Rect(corner, strip.size())));
}

void DrawAxes(cv::Mat* image, const RatePlot& plot) {
  for (int percent = 0; percent <= 100; percent += 10) {
    const cv::Point2d left = At(plot, plot.min_x, 0.01 * percent);
    cv::line(*image, left, At(plot, plot.max_x, 0.01 * percent), kGrid, 1, cv::LINE_AA);
    Text(image, absl::StrCat(percent), left - cv::Point2d(28, 0), 0.55);
  }
  for (const double x : plot.grid_x) {
    cv::line(*image, At(plot, x, kMinRate), At(plot, x, kMaxRate), kGrid, 1, cv::LINE_AA);
  }
  for (const double x : plot.labelled_x) {
    Text(image, absl::StrCat(x), At(plot, x, kMinRate) + cv::Point2d(0, 22), 0.55);
  }
  for (size_t i = 1; i < plot.goal.size(); ++i) {
    cv::line(*image, At(plot, plot.goal[i - 1].first, plot.goal[i - 1].second),
             At(plot, plot.goal[i].first, plot.goal[i].second), kGoal, 2, cv::LINE_AA);
  }
  const cv::Point2d low = At(plot, plot.min_x, kMinRate), high = At(plot, plot.max_x, kMaxRate);
  cv::rectangle(*image, low, high, kBlack, 1, cv::LINE_AA);
  Text(image, plot.title, {0.5 * kWidthPx, 38}, 0.85);
  Text(image, plot.x_title, {0.5 * (low.x + high.x), low.y + 58}, 0.65);
  DrawUpwards(image, plot.y_title, {34, 0.5 * (kTopPx + kHeightPx - kBottomPx)}, 0.65);
}

void DrawMark(cv::Mat* image, size_t curve, cv::Point2d at) {
  const cv::Scalar& colour = kColours[curve % kColours.size()];
  if (curve % 2 == 0) {
    cv::circle(*image, at, 6, colour, cv::FILLED, cv::LINE_AA);
  } else {
    cv::rectangle(*image, at - cv::Point2d(5, 5), at + cv::Point2d(5, 5), colour, 2, cv::LINE_AA);
  }
}

void DrawCurve(cv::Mat* image, const RatePlot& plot, size_t curve) {
  const cv::Scalar& colour = kColours[curve % kColours.size()];
  const auto& points = plot.curves[curve].points;
  for (size_t i = 0; i < points.size(); ++i) {
    const auto& [x, rate] = points[i];
    if (std::isnan(rate)) continue;
    if (i > 0 && !std::isnan(points[i - 1].second)) {
      cv::line(*image, At(plot, points[i - 1].first, points[i - 1].second), At(plot, x, rate),
               colour, 2, cv::LINE_AA);
    }
    DrawMark(image, curve, At(plot, x, rate));
  }
}

void DrawLegend(cv::Mat* image, const RatePlot& plot) {
  const double step = 30;
  const size_t lines = plot.curves.size() + plot.notes.size();
  const cv::Point2d corner =
      At(plot, plot.legend_x, 0.05) - cv::Point2d(0, step * static_cast<double>(lines));
  int width = 0, baseline = 0;
  for (size_t i = 0; i < lines; ++i) {
    const bool named = i < plot.curves.size();
    const std::string& text = named ? plot.curves[i].name : plot.notes[i - plot.curves.size()];
    width =
        std::max(width, cv::getTextSize(text, kFont, 0.6, 1, &baseline).width + (named ? 54 : 0));
  }
  cv::rectangle(*image, corner - cv::Point2d(16, 20),
                corner + cv::Point2d(width + 10, step * static_cast<double>(lines) - 8),
                cv::Scalar::all(255), cv::FILLED);
  for (size_t i = 0; i < lines; ++i) {
    const cv::Point2d at = corner + cv::Point2d(0, step * static_cast<double>(i));
    const bool named = i < plot.curves.size();
    if (named) {
      cv::line(*image, at, at + cv::Point2d(40, 0), kColours[i % kColours.size()], 2, cv::LINE_AA);
      DrawMark(image, i, at + cv::Point2d(20, 0));
    }
    cv::putText(*image, named ? plot.curves[i].name : plot.notes[i - plot.curves.size()],
                at + cv::Point2d(named ? 54 : 0, 6), kFont, 0.6, kBlack, 1, cv::LINE_AA);
  }
}

}  // namespace

absl::Status DrawRates(const RatePlot& plot, const std::string& png_path) {
  cv::Mat image(kHeightPx, kWidthPx, CV_8UC3, cv::Scalar::all(255));
  DrawAxes(&image, plot);
  DrawLegend(&image, plot);
  for (size_t i = 0; i < plot.curves.size(); ++i) DrawCurve(&image, plot, i);
  try {
    if (cv::imwrite(png_path, image)) return absl::OkStatus();
  } catch (const cv::Exception&) {
    // Reported below.
  }
  return absl::UnavailableError(absl::StrCat(
      png_path, ": cannot write the figure; does its folder exist, and does it end in .png?"));
}

}  // namespace rigcal::accuracy
