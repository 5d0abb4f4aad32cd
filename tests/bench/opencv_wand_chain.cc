// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/opencv_wand_chain.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>

namespace rigcal::bench {
namespace {

constexpr double kMinArea = 6;
constexpr double kMinFilled = 0.6;  // of the circle around a contour
constexpr size_t kMostDiscs = 60;   // the largest
constexpr double kMostOff = 0.06;   // of the middle marker, of the wand's length

}  // namespace

void OpenCvWandChain::FindDiscs(const cv::Mat& bgr) {
  cv::cvtColor(bgr, hsv_, cv::COLOR_BGR2HSV);
  cv::inRange(hsv_, cv::Scalar(0, 90, 60), cv::Scalar(25, 255, 255), mask_);
  cv::findContours(mask_, contours_, cv::RETR_EXTERNAL, cv::CHAIN_APPROX_SIMPLE);
  discs_.clear();
  for (const std::vector<cv::Point>& contour : contours_) {
    const cv::Moments moments = cv::moments(contour);
    if (moments.m00 < kMinArea) continue;
    // A disc's spread is its area over 4 pi; that of anything else is larger.
    const double spread = (moments.mu20 + moments.mu02) / (2 * moments.m00);
    if (moments.m00 / (4 * std::numbers::pi) < kMinFilled * spread) continue;
    discs_.push_back({{moments.m10 / moments.m00, moments.m01 / moments.m00},
                      std::sqrt(moments.m00 / std::numbers::pi)});
  }
  std::ranges::sort(discs_, std::greater(), &Disc::radius);
  if (discs_.size() > kMostDiscs) discs_.resize(kMostDiscs);
}

std::optional<std::array<cv::Point2d, 3>> OpenCvWandChain::Find(const cv::Mat& bgr) {
  FindDiscs(bgr);
  std::optional<std::array<cv::Point2d, 3>> best;
  double best_off = kMostOff;
  for (const Disc& first : discs_) {
    for (const Disc& last : discs_) {
      const double length = cv::norm(last.centre - first.centre);
      if (length < 4 * first.radius || length > 60 * first.radius) continue;
      if (std::max(first.radius, last.radius) > 1.6 * std::min(first.radius, last.radius)) continue;
      const cv::Point2d expected = first.centre + middle_share_ * (last.centre - first.centre);
      for (const Disc& middle : discs_) {
        const double off = cv::norm(middle.centre - expected) / length;
        if (off >= best_off || &middle == &first || &middle == &last) continue;
        best_off = off;
        best = {first.centre, middle.centre, last.centre};
      }
    }
  }
  return best;
}

}  // namespace rigcal::bench
