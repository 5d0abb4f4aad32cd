// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/image_file.h"

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "tests/agent/capture/recorded/image_files.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::agent::image_file_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::rigcal::testing::TemporaryDirectory;
using ::testing::AllOf;
using ::testing::HasSubstr;

class ReadImageTest : public ::testing::Test {
 protected:
  std::filesystem::path Path(const std::string& name) const { return directory_.path() / name; }
  TemporaryDirectory directory_;
};

TEST_F(ReadImageTest, ReadsEveryUsualFormat) {
  for (const char* name : {"a.png", "a.bmp", "a.tif", "a.ppm", "a.jpg"}) {
    const std::string path = WriteImage(Path(name), NumberedFrame(7));
    ASSERT_OK_AND_ASSIGN(const cv::Mat image, ReadImage(path));
    ASSERT_EQ(image.type(), CV_8UC3) << name;
    EXPECT_EQ(image.size(), cv::Size(kImageWidth, kImageHeight)) << name;
    // JPEG mixes the channels at such sharp edges; the others are exact.
    if (std::string(name) == "a.jpg") continue;
    EXPECT_EQ(NumberOf(image.at<cv::Vec3b>(24, 32)), 7) << name;
  }
}

TEST_F(ReadImageTest, KeepsGreyGreyAndTakesTheUpperEightOfSixteenBits) {
  const std::string grey = WriteImage(Path("g.png"), cv::Mat(4, 5, CV_8UC1, cv::Scalar(77)));
  ASSERT_OK_AND_ASSIGN(const cv::Mat eight, ReadImage(grey));
  EXPECT_EQ(eight.type(), CV_8UC1);
  EXPECT_EQ(eight.at<uchar>(1, 1), 77);
  const std::string deep =
      WriteImage(Path("d.png"), cv::Mat(4, 5, CV_16UC1, cv::Scalar(200 * 257)));
  ASSERT_OK_AND_ASSIGN(const cv::Mat sixteen, ReadImage(deep));
  EXPECT_EQ(sixteen.type(), CV_8UC1);
  EXPECT_EQ(sixteen.at<uchar>(1, 1), 200);
}

TEST_F(ReadImageTest, TakesTheUpperEightOfTheBitsThatTheCameraHas) {
  cv::Mat twelve(4, 5, CV_16UC1, cv::Scalar(100));
  twelve.at<uint16_t>(1, 1) = 4095;
  twelve.at<uint16_t>(2, 2) = 2048;
  const std::string path = WriteImage(Path("twelve.png"), twelve);
  int used_bits = 0;
  ASSERT_OK_AND_ASSIGN(const cv::Mat dark, ReadImage(path, 16, &used_bits));
  EXPECT_EQ(used_bits, 12);
  EXPECT_LT(dark.at<uchar>(1, 1), 17);
  ASSERT_OK_AND_ASSIGN(const cv::Mat image, ReadImage(path, 12));
  EXPECT_EQ(image.at<uchar>(1, 1), 255);
  EXPECT_EQ(image.at<uchar>(2, 2), 128);
  // Brighter than the camera can be.
  ASSERT_OK_AND_ASSIGN(const cv::Mat ten, ReadImage(path, 10));
  EXPECT_EQ(ten.at<uchar>(2, 2), 255);
}

TEST_F(ReadImageTest, LeavesAlphaOut) {
  const std::string path =
      WriteImage(Path("a.png"), cv::Mat(4, 5, CV_8UC4, cv::Scalar(1, 2, 3, 4)));
  ASSERT_OK_AND_ASSIGN(const cv::Mat image, ReadImage(path));
  ASSERT_EQ(image.type(), CV_8UC3);
  EXPECT_EQ(image.at<cv::Vec3b>(0, 0), cv::Vec3b(1, 2, 3));
}

// A decoder that fills what is missing with grey or black would give wrong centres.
TEST_F(ReadImageTest, RefusesTruncatedFilesOfEveryFormat) {
  for (const char* name : {"a.png", "a.bmp", "a.tif", "a.ppm", "a.jpg", "a.webp"}) {
    for (const double share : {0.01, 0.3, 0.7, 0.95}) {
      const std::string path = WriteImage(Path(name), NumberedFrame(7, 320, 240));
      Truncate(path, share);
      EXPECT_THAT(ReadImage(path), StatusIs(absl::StatusCode::kDataLoss, HasSubstr(path)))
          << name << " " << share;
    }
  }
}

TEST_F(ReadImageTest, RefusesWhatIsNoImage) {
  EXPECT_THAT(ReadImage(directory_.WriteFile("text.png", "not an image").string()),
              StatusIs(absl::StatusCode::kDataLoss, HasSubstr("text.png")));
  EXPECT_THAT(ReadImage(directory_.WriteFile("empty.png", "").string()),
              StatusIs(absl::StatusCode::kDataLoss, HasSubstr("empty")));
  EXPECT_THAT(ReadImage(Path("missing.png").string()),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("missing.png")));
  EXPECT_FALSE(ReadImage(directory_.path().string()).ok());
}

TEST(AsEightBit, RefusesFloats) {
  EXPECT_THAT(AsEightBit(cv::Mat(2, 2, CV_32FC1, cv::Scalar(0.5))),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("8 nor 16 bits")));
  EXPECT_THAT(AsEightBit(cv::Mat()), StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("no")));
}

TEST(ViewOf, TellsRowsApartWhereTheyHavePadding) {
  const cv::Mat whole = NumberedFrame(3);
  const cv::Mat part = whole(cv::Rect(10, 5, 20, 15));
  const ImageView view = ViewOf(part);
  EXPECT_EQ(view.width, 20);
  EXPECT_EQ(view.height, 15);
  EXPECT_EQ(view.format, PixelFormat::kBgr8);
  EXPECT_EQ(view.Row(1)[0], whole.at<cv::Vec3b>(6, 10)[0]);
}

TEST(IsImageName, KnowsEndingsInAnyCase) {
  EXPECT_TRUE(IsImageName("a.PNG"));
  EXPECT_TRUE(IsImageName("a.b.jpeg"));
  EXPECT_FALSE(IsImageName("a.csv"));
  EXPECT_FALSE(IsImageName("png"));
}

}  // namespace
}  // namespace rigcal::agent::image_file_test
