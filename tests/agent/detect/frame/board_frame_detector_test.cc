// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/frame/board_frame_detector.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/core.hpp>
#include <vector>

#include "agent/detect/frame/wand_detector.h"
#include "common/camera/camera_model.h"
#include "tests/agent/detect/board/rendered_board.h"
#include "tests/common/lens/known_lens.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::agent::board_frame_detector_test {
namespace {

using namespace rigcal::testing;  // the known lens
using ::testing::HasSubstr;

constexpr char kTarget[] = "board:checker,9x6,0.03";
constexpr double kBlurPx = 0.7, kNoiseGrey = 2;

CameraDescription Camera(ImageSize size = kKnownImage) {
  CameraDescription camera;
  camera.camera = "left";
  camera.image_size_px = size;
  return camera;
}

RigidTransform PoseAt(const Intrinsics& lens, const Eigen::Vector2d& pixel, double turn) {
  return BoardAt(*ParseBoard(kTarget), lens, pixel, 0.7, {0.4, 0.2, turn});
}

// Mean square of the errors of both axes over their stated variance; below 0: not all were seen.
double Nees(const Observation& observation, const Intrinsics& lens, const RigidTransform& pose) {
  const auto points = ParseBoard(kTarget)->Points();
  double sum = 0;
  for (size_t i = 0; i < points.size(); ++i) {
    Eigen::Vector2d pixel;
    if (!observation.markers[i].visible || !Project(lens, pose * points[i], &pixel)) return -1;
    const Eigen::Vector2d error = observation.markers[i].centre_px - pixel;
    sum += error.dot(observation.markers[i].covariance_px2.inverse() * error);
  }
  return sum / (2 * static_cast<double>(points.size()));
}

TEST(BoardFrameDetector, FollowsABoardAndStatesHowWellItsCornersAreKnown) {
  const Intrinsics lens = KnownPinhole();
  const BoardRenderer renderer(lens, kKnownImage);
  const auto detector = MakeFrameDetector(WandDetectorOptions(), *ParseTarget(kTarget), Camera());
  ASSERT_THAT(detector, IsOk());
  const Board board = *ParseBoard(kTarget);
  double nees = 0;
  constexpr int kFrames = 6;
  for (int k = 0; k < kFrames; ++k) {
    const auto pose = PoseAt(lens, Eigen::Vector2d(250 + 12 * k, 235), 0.1 + 0.03 * k);
    const cv::Mat image = renderer.Render(board, pose, kBlurPx, kNoiseGrey);
    const auto seen = (*detector)->Detect(MonoView(image), 40'000'000 * k, 0);
    ASSERT_THAT(seen, IsOk());
    ASSERT_EQ(seen->outcome, DetectionOutcome::kWand) << k;
    EXPECT_EQ(seen->tracked, k > 0) << k;
    EXPECT_EQ(seen->observation.time_ns, 40'000'000 * k);
    const double now = Nees(seen->observation, lens, pose);
    ASSERT_GE(now, 0);
    nees += now / kFrames;
  }
  EXPECT_GT(nees, 0.2);
  EXPECT_LT(nees, 2);
  EXPECT_LT((*detector)->window().width, 640);
  // Gone, and back elsewhere.
  const cv::Mat nothing(480, 640, CV_8UC1, cv::Scalar(90));
  const auto none = (*detector)->Detect(MonoView(nothing), 1, 0);
  ASSERT_THAT(none, IsOk());
  EXPECT_EQ(none->outcome, DetectionOutcome::kNoWand);
  EXPECT_EQ(none->observation.VisibleCount(), 0);
  EXPECT_EQ(none->observation.markers.size(), 54u);
  const cv::Mat back = renderer.Render(board, PoseAt(lens, {390, 250}, 3), kBlurPx, kNoiseGrey);
  const auto again = (*detector)->Detect(MonoView(back), 2, 0);
  ASSERT_THAT(again, IsOk());
  EXPECT_EQ(again->outcome, DetectionOutcome::kWand);
  EXPECT_FALSE(again->tracked);
}

TEST(BoardFrameDetector, LargeImagesAreSearchedAtHalfTheResolution) {
  constexpr ImageSize kLarge{1280, 960};
  Intrinsics lens = KnownPinhole();
  for (double* value : {&lens.fx_px, &lens.fy_px, &lens.cx_px, &lens.cy_px}) *value *= 2;
  const BoardRenderer renderer(lens, kLarge);
  const auto detector =
      MakeFrameDetector(WandDetectorOptions(), *ParseTarget(kTarget), Camera(kLarge));
  ASSERT_THAT(detector, IsOk());
  const auto pose = PoseAt(lens, {600, 470}, 0.1);
  const cv::Mat image = renderer.Render(*ParseBoard(kTarget), pose, kBlurPx, kNoiseGrey);
  const auto seen = (*detector)->Detect(MonoView(image), 0, 0);
  ASSERT_THAT(seen, IsOk());
  ASSERT_EQ(seen->outcome, DetectionOutcome::kWand);
  const double nees = Nees(seen->observation, lens, pose);
  EXPECT_GT(nees, 0.1);
  EXPECT_LT(nees, 2);
}

TEST(BoardFrameDetector, NamesABoardWithOtherCounts) {
  const Intrinsics lens = KnownPinhole();
  const BoardRenderer renderer(lens, kKnownImage);
  const Board shown = *ParseBoard("board:checker,7x4,0.03");
  const auto detector = MakeFrameDetector(WandDetectorOptions(), *ParseTarget(kTarget), Camera());
  ASSERT_THAT(detector, IsOk());
  std::string other;
  // It takes a while until somebody holds a board.
  const cv::Mat nothing(480, 640, CV_8UC1, cv::Scalar(90));
  for (int k = 0; k < 30; ++k) {
    const auto seen = (*detector)->Detect(MonoView(nothing), k - 30, 0);
    ASSERT_THAT(seen, IsOk());
    EXPECT_EQ(seen->other_target, "");
  }
  for (int k = 0; k < 25; ++k) {
    const auto pose = BoardAt(shown, lens, {250 + 4.0 * k, 235}, 0.5, {0.4, 0.2, 0.1});
    const cv::Mat image = renderer.Render(shown, pose, kBlurPx, kNoiseGrey);
    const auto seen = (*detector)->Detect(MonoView(image), k, 0);
    ASSERT_THAT(seen, IsOk());
    EXPECT_NE(seen->outcome, DetectionOutcome::kWand);
    other = seen->other_target;
  }
  EXPECT_THAT(other, ::testing::HasSubstr("--target board:checker,7x4,0.03"));
}

TEST(BoardFrameDetector, MaskedPixelsShowNoBoard) {
  const Intrinsics lens = KnownPinhole();
  const BoardRenderer renderer(lens, kKnownImage);
  const cv::Mat image =
      renderer.Render(*ParseBoard(kTarget), PoseAt(lens, {320, 235}, 0.1), kBlurPx, kNoiseGrey);
  const auto detector = MakeFrameDetector(WandDetectorOptions(), *ParseTarget(kTarget), Camera());
  ASSERT_THAT(detector, IsOk());
  PixelMask mask(640, 480);
  for (int y = 200; y < 280; ++y) {
    for (int x = 280; x < 360; ++x) mask.Set(x, y);
  }
  (*detector)->SetIgnored(mask);
  const auto seen = (*detector)->Detect(MonoView(image), 0, 0);
  ASSERT_THAT(seen, IsOk());
  EXPECT_EQ(seen->outcome, DetectionOutcome::kNoWand);
}

TEST(BoardFrameDetector, RefusesWhatItCannotSearch) {
  const auto detector = MakeFrameDetector(WandDetectorOptions(), *ParseTarget(kTarget), Camera());
  ASSERT_THAT(detector, IsOk());
  EXPECT_FALSE((*detector)->Detect({}, 0, 0).ok());
  const cv::Mat small(100, 100, CV_8UC1, cv::Scalar(0));
  EXPECT_THAT(std::string((*detector)->Detect(MonoView(small), 0, 0).status().message()),
              HasSubstr("camera left: an image of 100x100"));
  const cv::Mat black(480, 640, CV_8UC1, cv::Scalar(0));
  EXPECT_EQ((*detector)->Detect(MonoView(black), 0, 0)->outcome, DetectionOutcome::kBlack);
  EXPECT_THAT(std::string(MakeFrameDetector(WandDetectorOptions(),
                                            *ParseTarget("rigid:{A 0 0 0|B 1 0 0|C 0 1 0|D 1 1 0}"),
                                            Camera())
                              .status()
                              .message()),
              HasSubstr("another program"));
}

}  // namespace
}  // namespace rigcal::agent::board_frame_detector_test
