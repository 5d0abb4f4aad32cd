// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/paper/paper_plot.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "absl/strings/str_cat.h"

namespace rigcal::accuracy {
namespace {

constexpr int kFigureWidthPx = 1200, kFigureHeightPx = 760;
constexpr int kBesidePx = 110, kAbovePx = 80, kBelowPx = 90;
constexpr int kLetters = cv::FONT_HERSHEY_SIMPLEX;
const cv::Scalar kInk(30, 30, 30), kGridLine(225, 225, 225);
// Blue, orange, green, vermilion, sky blue, purple: safe for colour-blind readers.
const std::array<cv::Scalar, 6> kCurveColours = {
    cv::Scalar(178, 114, 0), cv::Scalar(0, 159, 230),  cv::Scalar(115, 158, 0),
    cv::Scalar(0, 94, 213),  cv::Scalar(233, 180, 86), cv::Scalar(167, 121, 204)};

// Seconds to the right, the logarithm of millimetres upwards.
struct Axes {
  double most_s = 1, least_mm = 0.01, most_mm = 1;

  cv::Point2d At(double seconds, double mm) const {
    const double up = std::log(mm / least_mm) / std::log(most_mm / least_mm);
    return {kBesidePx + seconds / most_s * (kFigureWidthPx - 2 * kBesidePx),
            kFigureHeightPx - kBelowPx - up * (kFigureHeightPx - kAbovePx - kBelowPx)};
  }
};

Axes AxesFor(const std::vector<PaperRow>& rows) {
  Axes axes;
  double least = 1e9, most = 0;
  for (const PaperRow& row : rows) {
    for (const PaperShorterWave& shorter : row.course) {
      axes.most_s = std::max(axes.most_s, shorter.waved_s);
      if (shorter.solved == 0) continue;
      least = std::min(least, 1e3 * shorter.exact_path_m.Mean());
      most = std::max(most, 1e3 * shorter.exact_path_m.Mean());
    }
  }
  if (!(most > 0)) return axes;
  axes.least_mm = std::pow(10, std::floor(std::log10(std::max(least, 1e-4))));
  axes.most_mm = std::max(10 * axes.least_mm, std::pow(10, std::ceil(std::log10(most))));
  return axes;
}

void Write(cv::Mat* image, const std::string& text, cv::Point2d left, double scale) {
  cv::putText(*image, text, left, kLetters, scale, kInk, 1, cv::LINE_AA);
}

void DrawGrid(cv::Mat* image, const Axes& axes) {
  for (double decade = axes.least_mm; decade < 1.01 * axes.most_mm; decade *= 10) {
    for (int step = 1; step < 10 && step * decade < 1.01 * axes.most_mm; ++step) {
      const cv::Point2d left = axes.At(0, step * decade);
      cv::line(*image, left, axes.At(axes.most_s, step * decade), kGridLine, 1, cv::LINE_AA);
      if (step == 1 || step == 3) {
        Write(image, fmt::format("{:g}", step * decade), left - cv::Point2d(70, -5), 0.55);
      }
    }
  }
  for (const double share : kPaperShares) {
    const double seconds = share * axes.most_s;
    const cv::Point2d low = axes.At(seconds, axes.least_mm);
    cv::line(*image, low, axes.At(seconds, axes.most_mm), kGridLine, 1, cv::LINE_AA);
    Write(image, fmt::format("{:g}", seconds), low + cv::Point2d(-14, 24), 0.55);
  }
  cv::rectangle(*image, axes.At(0, axes.least_mm), axes.At(axes.most_s, axes.most_mm), kInk, 1,
                cv::LINE_AA);
  Write(image, "Error of a point in 3-D by the calibration alone, mm", {kBesidePx, 45}, 0.75);
  Write(image, "seconds of waving", {0.5 * kFigureWidthPx - 80, kFigureHeightPx - 30}, 0.65);
}

}  // namespace

absl::Status DrawPaper(const std::vector<PaperRow>& rows, const std::string& png_path) {
  cv::Mat image(kFigureHeightPx, kFigureWidthPx, CV_8UC3, cv::Scalar::all(255));
  const Axes axes = AxesFor(rows);
  DrawGrid(&image, axes);
  size_t curves = 0;
  for (const PaperRow& row : rows) {
    if (row.course.empty()) continue;
    const cv::Scalar& colour = kCurveColours[curves % kCurveColours.size()];
    const cv::Point2d legend(kFigureWidthPx - kBesidePx - 400,
                             kAbovePx + 28 + 28 * static_cast<double>(curves));
    cv::line(image, legend, legend + cv::Point2d(36, 0), colour, 3, cv::LINE_AA);
    Write(&image, NameOf(row.method), legend + cv::Point2d(48, 6), 0.55);
    ++curves;
    std::optional<cv::Point2d> last;
    for (const PaperShorterWave& shorter : row.course) {
      if (shorter.solved == 0 || !(shorter.exact_path_m.Mean() > 0)) {
        last.reset();
        continue;
      }
      const cv::Point2d at = axes.At(shorter.waved_s, 1e3 * shorter.exact_path_m.Mean());
      if (last) cv::line(image, *last, at, colour, 2, cv::LINE_AA);
      cv::circle(image, at, 5, colour, cv::FILLED, cv::LINE_AA);
      last = at;
    }
  }
  if (curves == 0) {
    return absl::FailedPreconditionError(
        absl::StrCat(png_path,
                     ": nothing to draw; no row has errors of shorter waves, which those "
                     "of \"",
                     kPaperConditions[0].name, "\" have"));
  }
  try {
    if (cv::imwrite(png_path, image)) return absl::OkStatus();
  } catch (const cv::Exception&) {
    // Reported below.
  }
  return absl::UnavailableError(absl::StrCat(
      png_path, ": cannot write the figure; does its folder exist, and does it end in .png?"));
}

}  // namespace rigcal::accuracy
