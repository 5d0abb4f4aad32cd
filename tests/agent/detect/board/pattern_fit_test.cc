// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/board/pattern_fit.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

#include "common/camera/camera_model.h"
#include "tests/agent/detect/board/rendered_board.h"
#include "tests/common/lens/known_lens.h"

namespace rigcal::agent::pattern_fit_test {
namespace {

using namespace rigcal::testing;  // the known lens

// Squares of 20 px, in which no window of a pixel or so shows four squares alone.
struct Shown {
  Board board = *ParseBoard("board:charuco,9x6,0.035,0.025,5x5_100");
  Intrinsics lens = KnownPinhole();
  RigidTransform pose = BoardAt(board, lens, Eigen::Vector2d(320, 240), 0.85, {0.5, 0.3, 0.4});
  PrintedPattern pattern{board, BoardSide::kFront, 1};

  cv::Mat Image(double blur_px, double noise_grey, uint64_t seed = 7) const {
    return BoardRenderer(lens, kKnownImage).Render(board, pose, blur_px, noise_grey, seed);
  }
  std::vector<Eigen::Vector2d> Pixels() const {
    std::vector<Eigen::Vector2d> pixels;
    for (const Eigen::Vector3d& point : board.Points()) {
      pixels.emplace_back();
      EXPECT_TRUE(Project(lens, pose * point, &pixels.back()));
    }
    return pixels;
  }
  // The homography of the points next to one of them, off by `off_px`.
  LocalPlane Around(size_t point, const Eigen::Vector2d& off_px) const {
    const std::vector<Eigen::Vector2d> pixels = Pixels();
    std::vector<PatternPixel> near;
    for (size_t i = 0; i < pixels.size(); ++i) {
      const double away_m = (pattern.points()[i] - pattern.points()[point]).norm();
      if (away_m < 1.5 * board.spacing_m) near.emplace_back(pattern.points()[i], pixels[i]);
    }
    return LocalPlane::Through(near)->Moved(off_px);
  }
};

struct FitErrors {
  std::vector<double> px;
  double nees = 0;
  double blur_px = 0;
};

FitErrors ErrorsOf(const Shown& shown, double blur_px, double noise_grey) {
  FitErrors errors;
  const std::vector<Eigen::Vector2d> pixels = shown.Pixels();
  const cv::Mat image = shown.Image(blur_px, noise_grey);
  for (size_t i = 0; i < pixels.size(); ++i) {
    const auto fit = FitPattern(image, shown.pattern, shown.Around(i, {0.8, -0.6}),
                                shown.pattern.points()[i], 0.9, {});
    EXPECT_TRUE(fit.has_value()) << i;
    if (!fit) continue;
    const auto count = static_cast<double>(pixels.size());
    const double error_px = (fit->centre_px - pixels[i]).norm();
    errors.px.push_back(error_px);
    errors.nees += std::pow(error_px / fit->Sigma(), 2) / (2 * count);
    errors.blur_px += fit->blur_px / count;
    EXPECT_GT(fit->correlation, 0.9) << i;
  }
  return errors;
}

TEST(PatternFit, FindsCornersBesideBits) {
  const FitErrors clean = ErrorsOf(Shown(), 0.5, 0);
  EXPECT_LT(*std::max_element(clean.px.begin(), clean.px.end()), 0.05);
  const FitErrors blurred = ErrorsOf(Shown(), 1.4, 4);
  EXPECT_LT(*std::max_element(blurred.px.begin(), blurred.px.end()), 0.3);
  EXPECT_GT(blurred.nees, 0.6);
  EXPECT_LT(blurred.nees, 1.5);
}

TEST(PatternFit, TellsTheBlur) {
  const double sharp_px = ErrorsOf(Shown(), 0.7, 2).blur_px;
  const double soft_px = ErrorsOf(Shown(), 1.3, 2).blur_px;
  EXPECT_NEAR(sharp_px, 0.7, 0.1);
  EXPECT_NEAR(soft_px, 1.3, 0.15);
}

TEST(PatternFit, OtherBitsCorrelateLess) {
  // Marker 6 of the image, by what is printed in others.
  const Shown shown;
  const cv::Mat image = shown.Image(0.7, 2);
  const auto middle = [&](int id) -> Eigen::Vector2d {
    const auto& corners = shown.pattern.markers().at(id);
    return 0.5 * (corners[0] + corners[2]);
  };
  const LocalPlane right = shown.Around(11, {0, 0});
  PatternFitOptions options;
  options.half_px = 9;
  const auto own = FitPattern(image, shown.pattern, right, middle(6), 0.8, options);
  ASSERT_TRUE(own.has_value());
  EXPECT_GT(own->correlation, 0.97);
  for (const int other : {1, 5, 7, 10, 15}) {
    Eigen::Matrix3d shift = Eigen::Matrix3d::Identity();
    shift.topRightCorner<2, 1>() = middle(6) - middle(other);
    const LocalPlane plane(right.img_from_pattern() * shift);
    const auto fit = FitPattern(image, shown.pattern, plane, middle(other), 0.8, options);
    EXPECT_LT(fit ? fit->correlation : 0, 0.9) << other;
  }
}

TEST(PatternFit, NothingWhereThereIsNothing) {
  const Shown shown;
  const cv::Mat grey(480, 640, CV_8UC1, cv::Scalar(90));
  const Eigen::Vector2d point = shown.pattern.points()[20];
  EXPECT_FALSE(FitPattern(grey, shown.pattern, shown.Around(20, {0, 0}), point, 0.8, {}));
  const cv::Mat image = shown.Image(0.7, 2);
  EXPECT_TRUE(FitPattern(image, shown.pattern, shown.Around(20, {0, 0}), point, 0.8, {}));
  EXPECT_FALSE(FitPattern(image, shown.pattern, shown.Around(20, {-1000, 0}), point, 0.8, {}));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(FitPattern(image, shown.pattern, shown.Around(20, {nan, 0}), point, 0.8, {}));
  // Seen edge-on.
  Eigen::Matrix3d flat = shown.Around(20, {0, 0}).img_from_pattern();
  flat.row(1) = flat.row(0);
  EXPECT_FALSE(FitPattern(image, shown.pattern, LocalPlane(flat), point, 0.8, {}));
}

}  // namespace
}  // namespace rigcal::agent::pattern_fit_test
