// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/board/marker_reading.h"

#include <gtest/gtest.h>

#include <opencv2/aruco.hpp>
#include <opencv2/imgproc.hpp>

#include "common/board/marker_cells.h"
#include "common/board/marker_dictionary.h"
#include "tests/testing/marker_picture.h"

namespace rigcal::agent::marker_reading_test {
namespace {

constexpr int kId = 7;
constexpr double kSidePx = 14;  // bits of 2 px, blurred by 1.1 px
constexpr double kLeftPx = 24.3, kTopPx = 25.6;

cv::Mat BlurredMarker(const Board& board) {
  const cv::Mat marker = testing::MarkerPicture(*MarkerDictionary(DictionaryOf(board)), kId, 140);
  // Ten times as fine, then what a pixel sees of it.
  const double scale = 10 * kSidePx / 140, shift = 0.5 * scale - 0.5;
  const cv::Matx23d place(scale, 0, 10 * kLeftPx + shift, 0, scale, 10 * kTopPx + shift);
  cv::Mat fine(600, 600, CV_8UC1, cv::Scalar(215)), image;
  cv::warpAffine(marker, fine, place, fine.size(), cv::INTER_LINEAR, cv::BORDER_TRANSPARENT);
  cv::GaussianBlur(fine, fine, cv::Size(0, 0), 11);
  cv::resize(fine, image, cv::Size(60, 60), 0, 0, cv::INTER_AREA);
  return image;
}

std::array<Eigen::Vector2d, 4> Corners() {
  const double left = kLeftPx - 0.5, top = kTopPx - 0.5;
  return {Eigen::Vector2d(left, top), Eigen::Vector2d(left + kSidePx, top),
          Eigen::Vector2d(left + kSidePx, top + kSidePx), Eigen::Vector2d(left, top + kSidePx)};
}

TEST(MarkerReading, ReadsWhatIsTooBlurredForOpenCv) {
  const Board board = *ParseBoard("board:charuco,9x6,0.035,0.025,5x5_100");
  const cv::Mat image = BlurredMarker(board);
  std::vector<std::vector<cv::Point2f>> found;
  std::vector<int> ids;
  cv::aruco::detectMarkers(image, MarkerDictionary(DictionaryOf(board)), found, ids);
  EXPECT_TRUE(ids.empty());
  const MarkerReader reader(board);
  for (size_t turns = 0; turns < 4; ++turns) {
    std::array<Eigen::Vector2d, 4> corners;
    for (size_t k = 0; k < 4; ++k) corners[k] = Corners()[(k + turns) % 4];
    const auto marker = reader.Read(image, corners);
    ASSERT_TRUE(marker.has_value()) << turns;
    EXPECT_EQ(marker->id, kId);
    for (size_t k = 0; k < 4; ++k) EXPECT_EQ(marker->pixels[k], Corners()[k]) << turns;
  }
}

TEST(MarkerReading, ReadsNothingElse) {
  const Board board = *ParseBoard("board:charuco,9x6,0.035,0.025,5x5_100");
  const MarkerReader reader(board);
  const cv::Mat image = BlurredMarker(board);
  cv::Mat inverse, grey(60, 60, CV_8UC1, cv::Scalar(90)), noise(60, 60, CV_8UC1);
  cv::bitwise_not(image, inverse);
  cv::RNG random(3);
  EXPECT_FALSE(reader.Read(inverse, Corners()).has_value());
  EXPECT_FALSE(reader.Read(grey, Corners()).has_value());
  for (int i = 0; i < 200; ++i) {
    random.fill(noise, cv::RNG::UNIFORM, 0, 256);
    EXPECT_FALSE(reader.Read(noise, Corners()).has_value()) << i;
  }
  // The number is none of a smaller board's, and half of the marker is not in the image.
  const MarkerReader small(*ParseBoard("board:charuco,3x3,0.035,0.025,5x5_100"));
  EXPECT_FALSE(small.Read(image, Corners()).has_value());
  std::array<Eigen::Vector2d, 4> outside = Corners();
  for (Eigen::Vector2d& corner : outside) corner.x() -= 30;
  EXPECT_FALSE(reader.Read(image, outside).has_value());
  std::array<Eigen::Vector2d, 4> line = Corners();
  for (Eigen::Vector2d& corner : line) corner.y() = 30;
  EXPECT_FALSE(reader.Read(image, line).has_value());
}

}  // namespace
}  // namespace rigcal::agent::marker_reading_test
