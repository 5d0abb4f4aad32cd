// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <opencv2/core/mat.hpp>
#include <opencv2/core/types.hpp>
#include <optional>
#include <vector>

namespace rigcal::bench {

// A wand by OpenCV's fastest functions: pixels of its colour, their contours, and of the blobs the
// three that are best in line and have the ratio of the wand's distances.
class OpenCvWandChain {
 public:
  // `middle_share`: where the middle marker is, of the wand's length from its first one.
  explicit OpenCvWandChain(double middle_share) : middle_share_(middle_share) {}

  // The centres in pixels, by marker.
  std::optional<std::array<cv::Point2d, 3>> Find(const cv::Mat& bgr);

 private:
  struct Disc {
    cv::Point2d centre;
    double radius = 0;
  };
  void FindDiscs(const cv::Mat& bgr);

  double middle_share_;
  cv::Mat hsv_, mask_;
  std::vector<std::vector<cv::Point>> contours_;
  std::vector<Disc> discs_;
};

}  // namespace rigcal::bench
