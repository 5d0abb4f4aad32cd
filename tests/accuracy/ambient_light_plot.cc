// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/ambient_light_plot.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

namespace rigcal::accuracy {
namespace {

constexpr int kWidthPx = 1200, kHeightPx = 760;
constexpr int kLeftPx = 110, kRightPx = 40, kTopPx = 80, kBottomPx = 90;
constexpr double kMinLux = 8, kMaxLux = 6000;
constexpr double kMinRate = 0, kMaxRate = 1.05;
constexpr double kGoalRate = 0.95, kGoalLux = 1000;
constexpr int kFont = cv::FONT_HERSHEY_SIMPLEX;
const cv::Scalar kBlack(30, 30, 30), kGrid(225, 225, 225), kGoal(150, 150, 150);

// Blue, orange, green, vermilion: told apart by colour-blind eyes too.
const std::array<cv::Scalar, 4> kColours = {cv::Scalar(178, 114, 0), cv::Scalar(0, 159, 230),
                                            cv::Scalar(115, 158, 0), cv::Scalar(0, 94, 213)};

cv::Point2d At(double lux, double rate) {
  const double across = std::log(lux / kMinLux) / std::log(kMaxLux / kMinLux);
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

void DrawAxes(cv::Mat* image) {
  for (int percent = 0; percent <= 100; percent += 10) {
    const cv::Point2d left = At(kMinLux, 0.01 * percent), right = At(kMaxLux, 0.01 * percent);
    cv::line(*image, left, right, kGrid, 1, cv::LINE_AA);
    Text(image, absl::StrCat(percent), left - cv::Point2d(28, 0), 0.55);
  }
  for (const double decade : {10, 100, 1000}) {
    for (int step = 1; step < 10; ++step) {
      const double lux = step * decade;
      if (lux > kMaxLux) break;
      cv::line(*image, At(lux, kMinRate), At(lux, kMaxRate), kGrid, 1, cv::LINE_AA);
      if (step != 1 && step != 2 && step != 5) continue;
      Text(image, absl::StrCat(lux), At(lux, kMinRate) + cv::Point2d(0, 22), 0.55);
    }
  }
  // What is asked for: this rate up to this much light.
  cv::line(*image, At(kMinLux, kGoalRate), At(kGoalLux, kGoalRate), kGoal, 2, cv::LINE_AA);
  cv::line(*image, At(kGoalLux, kGoalRate), At(kGoalLux, kMinRate), kGoal, 2, cv::LINE_AA);
  cv::rectangle(*image, At(kMinLux, kMinRate), At(kMaxLux, kMaxRate), kBlack, 1, cv::LINE_AA);
  Text(image, "Wand detection rate against ambient light", {0.5 * kWidthPx, 38}, 0.85);
  Text(image, "ambient light, lux", At(std::sqrt(kMinLux * kMaxLux), 0) + cv::Point2d(0, 58), 0.65);
  DrawUpwards(image, "wands found, % of those fully visible",
              {34, 0.5 * (kTopPx + kHeightPx - kBottomPx)}, 0.65);
}

void DrawMark(cv::Mat* image, size_t curve, cv::Point2d at) {
  const cv::Scalar& colour = kColours[curve % kColours.size()];
  if (curve % 2 == 0) {
    cv::circle(*image, at, 6, colour, cv::FILLED, cv::LINE_AA);
  } else {
    cv::rectangle(*image, at - cv::Point2d(5, 5), at + cv::Point2d(5, 5), colour, 2, cv::LINE_AA);
  }
}

void DrawCurve(cv::Mat* image, size_t curve, const std::vector<const AmbientLightPoint*>& points) {
  const cv::Scalar& colour = kColours[curve % kColours.size()];
  for (size_t i = 0; i < points.size(); ++i) {
    const double rate = points[i]->Rate();
    if (std::isnan(rate)) continue;
    if (i > 0 && !std::isnan(points[i - 1]->Rate())) {
      cv::line(*image, At(points[i - 1]->lux, points[i - 1]->Rate()), At(points[i]->lux, rate),
               colour, 2, cv::LINE_AA);
    }
    DrawMark(image, curve, At(points[i]->lux, rate));
  }
}

void DrawLegend(cv::Mat* image, const std::vector<std::string>& lines) {
  const double step = 30;
  const cv::Point2d corner =
      At(12, 0.05) - cv::Point2d(0, step * static_cast<double>(lines.size()));
  cv::rectangle(*image, corner - cv::Point2d(16, 20),
                corner + cv::Point2d(520, step * static_cast<double>(lines.size()) - 8),
                cv::Scalar::all(255), cv::FILLED);
  for (size_t i = 0; i < lines.size(); ++i) {
    const cv::Point2d at = corner + cv::Point2d(0, step * static_cast<double>(i));
    cv::line(*image, at, at + cv::Point2d(40, 0), kColours[i % kColours.size()], 2, cv::LINE_AA);
    DrawMark(image, i, at + cv::Point2d(20, 0));
    cv::putText(*image, lines[i], at + cv::Point2d(54, 6), kFont, 0.6, kBlack, 1, cv::LINE_AA);
  }
}

}  // namespace

absl::Status DrawAmbientLight(const std::vector<AmbientLightPoint>& points,
                              const std::string& png_path) {
  cv::Mat image(kHeightPx, kWidthPx, CV_8UC3, cv::Scalar::all(255));
  DrawAxes(&image);
  std::vector<std::string> names;
  std::map<std::string, std::vector<const AmbientLightPoint*>> curves;
  std::map<std::string, int> false_wands;
  for (const AmbientLightPoint& point : points) {
    if (!curves.contains(point.setting.name)) names.push_back(point.setting.name);
    curves[point.setting.name].push_back(&point);
    false_wands[point.setting.name] += point.FalseWands();
  }
  std::vector<std::string> lines;
  for (size_t i = 0; i < names.size(); ++i) {
    lines.push_back(absl::StrFormat("%s (%d false wands)", names[i], false_wands[names[i]]));
  }
  DrawLegend(&image, lines);
  for (size_t i = 0; i < names.size(); ++i) DrawCurve(&image, i, curves[names[i]]);
  try {
    if (cv::imwrite(png_path, image)) return absl::OkStatus();
  } catch (const cv::Exception&) {
    // Said below.
  }
  return absl::UnavailableError(absl::StrCat(
      png_path, ": cannot write the picture; does its folder exist, and does it end in .png?"));
}

}  // namespace rigcal::accuracy
