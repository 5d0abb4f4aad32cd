// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <fstream>
#include <iterator>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace rigcal::agent {

inline constexpr int kImageWidth = 64;
inline constexpr int kImageHeight = 48;

// OpenCV YAML of a camera with frames of that size.
inline constexpr std::string_view kSmallCameraYaml = R"(%YAML:1.0
image_width: 64
image_height: 48
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [60., 0., 32., 0., 60., 24., 0., 0., 1.]
distortion_model: plumb_bob
distortion_coefficients: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [0., 0., 0., 0., 0.]
)";

// A frame whose brightness says which one it is.
inline cv::Mat NumberedFrame(int number, int width = kImageWidth, int height = kImageHeight) {
  cv::Mat image(height, width, CV_8UC3, cv::Scalar(10, 20, 10 + 10 * number));
  // Something to encode, so that a truncated file lacks something.
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      image.at<cv::Vec3b>(y, x)[0] = static_cast<uchar>((37 * x + 91 * y + x * y) % 251);
    }
  }
  return image;
}

// Which one it is, from the red of its middle.
inline int NumberOf(const cv::Vec3b& pixel) { return (pixel[2] - 5) / 10; }

inline std::string WriteImage(const std::filesystem::path& path, const cv::Mat& image) {
  cv::imwrite(path.string(), image);
  return path.string();
}

inline void Truncate(const std::filesystem::path& path, double share) {
  const auto size = static_cast<double>(std::filesystem::file_size(path));
  std::filesystem::resize_file(path, static_cast<std::uintmax_t>(size * share));
}

}  // namespace rigcal::agent
