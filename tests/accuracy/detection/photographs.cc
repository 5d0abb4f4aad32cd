// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/detection/photographs.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "common/simulation/world/random_stream.h"

namespace rigcal::accuracy {
namespace {

// Of mate-backgrounds and opencv-doc alone: figures must not depend on what else is installed.
constexpr const char* kFolders[] = {"/usr/share/backgrounds/mate",
                                    "/usr/share/doc/opencv-doc/examples/data"};
constexpr uint64_t kPhotographPurpose = 0x70686f746f;
constexpr int kLeastWidth = 512, kLeastHeight = 384;
constexpr double kMeanReflectance = 0.25;

// IEC 61966-2-1 (sRGB).
float Linear(int grey) {
  const double value = grey / 255.0;
  return static_cast<float>(value <= 0.04045 ? value / 12.92
                                             : std::pow((value + 0.055) / 1.055, 2.4));
}

}  // namespace

std::vector<std::string> FindPhotographs() {
  std::vector<std::string> folders(std::begin(kFolders), std::end(kFolders));
  if (const char* const own = std::getenv("RIGCAL_PHOTOGRAPHS")) folders = {own};
  std::vector<std::string> found;
  for (const std::string& folder : folders) {
    std::error_code error;
    for (auto entry = std::filesystem::recursive_directory_iterator(folder, error);
         !error && entry != std::filesystem::recursive_directory_iterator();
         entry.increment(error)) {
      if (entry->path().extension() != ".jpg") continue;
      const cv::Mat image = cv::imread(entry->path().string(), cv::IMREAD_REDUCED_COLOR_2);
      if (2 * image.cols >= kLeastWidth && 2 * image.rows >= kLeastHeight) {
        found.push_back(entry->path().string());
      }
    }
  }
  std::ranges::sort(found);
  return found;
}

std::vector<float> LoadPhotograph(const std::string& path, const ImageSize& size, uint32_t seed) {
  const cv::Mat3b image = cv::imread(path, cv::IMREAD_COLOR);
  if (image.empty()) return {};
  const double width = size.width, height = size.height;
  // The largest part of the image's shape, or down to half of that.
  const double largest = std::min(image.cols / width, image.rows / height);
  RandomStream random{kPhotographPurpose, seed};
  const double scale = largest * random.Uniform(0.5, 1);
  const cv::Size part(std::max(1, static_cast<int>(scale * width)),
                      std::max(1, static_cast<int>(scale * height)));
  const cv::Point corner(static_cast<int>(random.Uniform() * (image.cols - part.width)),
                         static_cast<int>(random.Uniform() * (image.rows - part.height)));
  cv::Mat3b resized;
  cv::resize(image(cv::Rect(corner, part)), resized,
             {static_cast<int>(size.width), static_cast<int>(size.height)}, 0, 0,
             scale > 1 ? cv::INTER_AREA : cv::INTER_CUBIC);
  std::vector<float> bgr;
  double sum = 0;
  for (const cv::Vec3b& pixel : resized) {
    for (int channel = 0; channel < 3; ++channel) {
      bgr.push_back(Linear(pixel[channel]));
      sum += static_cast<double>(bgr.back());
    }
  }
  const double mean = sum / static_cast<double>(bgr.size());
  if (mean > 0) {
    for (float& value : bgr) value *= static_cast<float>(kMeanReflectance / mean);
  }
  return bgr;
}

}  // namespace rigcal::accuracy
