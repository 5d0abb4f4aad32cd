// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/frame/annotated_image.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <vector>

#include "tests/testing/status_matchers.h"

namespace rigcal::agent::annotated_image_test {
namespace {

using ::rigcal::testing::StatusIs;
using ::testing::HasSubstr;

ImageView ViewOf(const cv::Mat& image) {
  return {.data = image.data,
          .width = image.cols,
          .height = image.rows,
          .stride_bytes = static_cast<ptrdiff_t>(image.step),
          .format = image.channels() == 3 ? PixelFormat::kBgr8 : PixelFormat::kMono8};
}

// A wand of three markers, the last of which is hidden.
Detection TwoOfThree() {
  Detection detection;
  detection.outcome = DetectionOutcome::kWand;
  detection.confidence = 0.93;
  detection.blob_count = 4;
  detection.occluded_markers = 1;
  detection.observation.markers.resize(3);
  detection.observation.markers[0].visible = true;
  detection.observation.markers[0].centre_px = {200, 300};
  detection.observation.markers[1].visible = true;
  detection.observation.markers[1].centre_px = {300, 300};
  detection.observation.markers[2].centre_px = {500, 300};
  return detection;
}

bool IsGreen(const cv::Vec3b& pixel) { return pixel[1] > 150 && pixel[0] < 120 && pixel[2] < 120; }

int CountDifferent(const cv::Mat& a, const cv::Mat& b, const cv::Rect& where) {
  cv::Mat difference;
  cv::absdiff(a(where), b(where), difference);
  return cv::countNonZero(difference.reshape(1));
}

cv::Mat Noise(int columns, int rows) {
  cv::Mat image(rows, columns, CV_8UC3);
  cv::RNG random(7);
  random.fill(image, cv::RNG::UNIFORM, 0, 256);
  return image;
}

TEST(Annotate, DrawsVisibleMarkersAndLeavesTheOriginalAlone) {
  const cv::Mat black = cv::Mat::zeros(480, 640, CV_8UC3);
  const cv::Mat drawn = Annotate(ViewOf(black), TwoOfThree());
  ASSERT_EQ(drawn.size(), black.size());
  EXPECT_TRUE(IsGreen(drawn.at<cv::Vec3b>(300, 200)));
  EXPECT_TRUE(IsGreen(drawn.at<cv::Vec3b>(300, 300)));
  EXPECT_TRUE(IsGreen(drawn.at<cv::Vec3b>(300, 250))) << "the line between them";
  EXPECT_EQ(drawn.at<cv::Vec3b>(300, 500), cv::Vec3b(0, 0, 0)) << "a hidden marker";
  EXPECT_GT(CountDifferent(drawn, black, {0, 0, 640, 40}), 100) << "the text";
  EXPECT_EQ(cv::countNonZero(black.reshape(1)), 0);
}

TEST(Annotate, SaysWhatMakesTheWandHardToFind) {
  const cv::Mat black = cv::Mat::zeros(480, 640, CV_8UC3);
  const cv::Rect second_line(0, 19, 640, 15);
  Detection detection = TwoOfThree();
  const cv::Mat without = Annotate(ViewOf(black), detection);
  detection.passed_share = 0.38;
  detection.white_share = 0.3;
  const cv::Mat bright = Annotate(ViewOf(black), detection);
  EXPECT_GT(CountDifferent(bright, without, second_line), 100);
  detection.passed_share = 0;
  detection.background_share = 0.1;
  const cv::Mat still = Annotate(ViewOf(black), detection);
  EXPECT_GT(CountDifferent(still, without, second_line), 50);
  EXPECT_GT(CountDifferent(still, bright, second_line), 50);
}

TEST(Annotate, DrawsWindowAndBlobs) {
  const cv::Mat black = cv::Mat::zeros(480, 640, CV_8UC3);
  Detection nothing;
  Blob blob;
  blob.centre_px = {400, 200};
  blob.second_moment_px2 << 100, 0, 0, 25;  // semi-axes of 20 and 10 px
  const cv::Mat without = Annotate(ViewOf(black), nothing);
  const cv::Mat drawn = Annotate(ViewOf(black), nothing, {100, 100, 50, 60}, {&blob, 1});
  EXPECT_NE(drawn.at<cv::Vec3b>(100, 120), without.at<cv::Vec3b>(100, 120));
  EXPECT_GT(CountDifferent(drawn, without, {418, 196, 8, 8}), 0) << "the end of the long axis";
  EXPECT_GT(CountDifferent(drawn, without, {396, 208, 8, 8}), 0) << "the end of the short axis";
  EXPECT_EQ(CountDifferent(drawn, without, {395, 195, 10, 10}), 0) << "its inside is to be seen";
}

TEST(Annotate, TakesGreyPicturesAndPaddedRows) {
  const cv::Mat wide(480, 700, CV_8UC1, cv::Scalar(40));
  const cv::Mat part = wide(cv::Rect(10, 0, 640, 480));
  const cv::Mat drawn = Annotate(ViewOf(part), TwoOfThree());
  ASSERT_EQ(drawn.type(), CV_8UC3);
  EXPECT_EQ(drawn.at<cv::Vec3b>(479, 639), cv::Vec3b(40, 40, 40));
  EXPECT_TRUE(IsGreen(drawn.at<cv::Vec3b>(300, 200)));
}

TEST(Annotate, LeavesOutWhatIsNoPlaceInThePicture) {
  const cv::Mat black = cv::Mat::zeros(480, 640, CV_8UC3);
  Detection detection = TwoOfThree();
  detection.observation.markers[0].centre_px = {std::nan(""), 300};
  detection.observation.markers[1].centre_px = {1e300, -std::numeric_limits<double>::infinity()};
  Blob blob;
  blob.centre_px = {200, 200};
  blob.second_moment_px2 << std::nan(""), 0, 0, 1e308;
  Blob huge = blob;
  huge.second_moment_px2 << 1e300, 0, 0, 1e308;
  const std::vector<Blob> blobs = {blob, huge};
  const cv::Mat drawn = Annotate(ViewOf(black), detection, {-5, 900, 1 << 30, 1 << 30}, blobs);
  ASSERT_EQ(drawn.size(), black.size());
  EXPECT_EQ(drawn.at<cv::Vec3b>(300, 200), cv::Vec3b(0, 0, 0));
}

TEST(Annotate, AnEmptyPictureStaysEmpty) {
  EXPECT_TRUE(Annotate({}, TwoOfThree()).empty());
  EXPECT_THAT(EncodeJpeg({}, 1 << 20),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("0x0")));
}

TEST(EncodeJpeg, KeepsAllPixelsWhereThereIsRoom) {
  const cv::Mat flat(1024, 1280, CV_8UC3, cv::Scalar(30, 60, 90));
  ASSERT_OK_AND_ASSIGN(const JpegImage jpeg, EncodeJpeg(flat, 100'000));
  EXPECT_EQ(jpeg.width, 1280);
  EXPECT_EQ(jpeg.height, 1024);
  const cv::Mat again = cv::imdecode(cv::Mat(1, static_cast<int>(jpeg.bytes.size()), CV_8UC1,
                                             const_cast<char*>(jpeg.bytes.data())),
                                     cv::IMREAD_COLOR);
  ASSERT_EQ(again.size(), flat.size());
  EXPECT_LE(cv::norm(again, flat, cv::NORM_INF), 3);
}

TEST(EncodeJpeg, ShrinksWhatIsTooLarge) {
  const cv::Mat noise = Noise(1280, 1024);  // nothing is harder to compress
  for (const size_t limit : {size_t{1} << 20, size_t{200'000}, size_t{8'192}}) {
    ASSERT_OK_AND_ASSIGN(const JpegImage jpeg, EncodeJpeg(noise, limit));
    EXPECT_LE(jpeg.bytes.size(), limit);
    EXPECT_EQ(jpeg.width * 1024, jpeg.height * 1280) << "the shape is kept";
    const cv::Mat again = cv::imdecode(cv::Mat(1, static_cast<int>(jpeg.bytes.size()), CV_8UC1,
                                               const_cast<char*>(jpeg.bytes.data())),
                                       cv::IMREAD_COLOR);
    EXPECT_EQ(again.size(), cv::Size(jpeg.width, jpeg.height));
  }
}

TEST(EncodeJpeg, SaysWhenNoPictureIsSoSmall) {
  EXPECT_THAT(EncodeJpeg(Noise(640, 480), 100),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("100 bytes")));
  EXPECT_THAT(EncodeJpeg(Noise(5000, 1), 100),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("5000x1")));
}

TEST(EncodeJpeg, RefusesOtherKindsOfPixels) {
  EXPECT_THAT(EncodeJpeg(cv::Mat::zeros(10, 10, CV_32FC3), 10'000),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("10x10")));
}

}  // namespace
}  // namespace rigcal::agent::annotated_image_test
