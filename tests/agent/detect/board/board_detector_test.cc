// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/board/board_detector.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <opencv2/aruco.hpp>
#include <opencv2/imgproc.hpp>

#include "common/board/marker_cells.h"
#include "common/board/marker_dictionary.h"
#include "common/lens/circle_image.h"
#include "common/statistics/robust_statistics.h"
#include "tests/agent/detect/board/rendered_board.h"
#include "tests/common/lens/known_lens.h"
#include "tests/testing/marker_picture.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::agent::board_detector_test {
namespace {

using namespace rigcal::testing;  // the known lens

constexpr double kLensBlurPx = 0.7;

constexpr int kOldSquarePx = 50, kOldMarginPx = 60;

// A ChArUco board from the front as OpenCV drew it before 4.6: markers in the squares whose column
// and row add up to an even number.
cv::Mat OldLayout(const Board& board) {
  const int across = board.columns + 1, high = board.rows + 1;
  cv::Mat image(high * kOldSquarePx + 2 * kOldMarginPx, across * kOldSquarePx + 2 * kOldMarginPx,
                CV_8UC1, cv::Scalar(255));
  const auto dictionary = MarkerDictionary(DictionaryOf(board));
  const int marker_px = static_cast<int>(kOldSquarePx * board.marker_m / board.spacing_m);
  const int inset_px = (kOldSquarePx - marker_px) / 2;
  int id = 0;
  for (int row = 0; row < high; ++row) {
    for (int column = 0; column < across; ++column) {
      const int x = kOldMarginPx + column * kOldSquarePx, y = kOldMarginPx + row * kOldSquarePx;
      if ((row + column) % 2 != 0) {
        image(cv::Rect(x, y, kOldSquarePx, kOldSquarePx)).setTo(0);
        continue;
      }
      testing::MarkerPicture(*dictionary, id++, marker_px)
          .copyTo(image(cv::Rect(x + inset_px, y + inset_px, marker_px, marker_px)));
    }
  }
  cv::GaussianBlur(image, image, cv::Size(0, 0), 0.8);
  return image;
}

// Distances of the found points from where they are, in order; empty: not found.
std::vector<double> Errors(const Board& board, const Intrinsics& lens,
                           const BoardRenderer& renderer, const RigidTransform& pose,
                           double noise) {
  const cv::Mat image = renderer.Render(board, pose, kLensBlurPx, noise);
  const auto seen = FindBoard(board, MonoView(image));
  EXPECT_THAT(seen, IsOk());
  std::vector<double> errors;
  if (!seen.ok() || !seen->has_value()) return errors;
  const auto points = board.Points();
  for (size_t i = 0; i < points.size(); ++i) {
    Eigen::Vector2d pixel;
    EXPECT_TRUE(Project(lens, pose * points[i], &pixel));
    if (const double diameter_m = board.CircleDiameter(); diameter_m > 0) {
      Eigen::Vector2d offset_px;
      EXPECT_TRUE(CircleOffset(lens, pose, points[i], 0.5 * diameter_m, &offset_px));
      pixel += offset_px;
    }
    errors.push_back(((*seen)->pixels[i] - pixel).norm());
  }
  return errors;
}

TEST(BoardDetector, FindsCheckersWhereTheyAreInTheirOrder) {
  const Board board = *ParseBoard("board:checker,9x6,0.03");
  for (const Intrinsics& lens : {KnownPinhole(), KnownFisheye()}) {
    const bool wide = lens.model == DistortionModel::kFisheye;
    const BoardRenderer renderer(lens, kKnownImage);
    // Upright, upside down, on its side, tilted.
    for (const Eigen::Vector3d& turn :
         {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(0.1, 0, 3.1), Eigen::Vector3d(0, 0.2, 1.5),
          Eigen::Vector3d(0.8, 0.2, -0.3)}) {
      const auto pose = BoardAt(board, lens, Eigen::Vector2d(310, 235), wide ? 0.3 : 0.5, turn);
      const auto errors = Errors(board, lens, renderer, pose, 0);
      ASSERT_EQ(errors.size(), 54u) << "wide " << wide << " turn " << turn.transpose();
      EXPECT_LT(Median(errors), 0.02);
      EXPECT_LT(*std::max_element(errors.begin(), errors.end()), 0.06);
      const auto noisy = Errors(board, lens, renderer, pose, 1);
      ASSERT_EQ(noisy.size(), 54u);
      EXPECT_LT(Median(noisy), 0.025);
    }
  }
}

TEST(BoardDetector, TheFirstPixelsCentreIsTheOrigin) {
  // The mean error of many corners shows a shift of the convention, not their noise.
  const Board board = *ParseBoard("board:checker,9x6,0.03");
  const Intrinsics lens = KnownPinhole();
  const BoardRenderer renderer(lens, kKnownImage);
  const auto pose = BoardAt(board, lens, Eigen::Vector2d(300, 250), 0.5, {0.3, 0.2, 0.1});
  const cv::Mat image = renderer.Render(board, pose, kLensBlurPx, 1);
  const auto seen = FindBoard(board, MonoView(image));
  ASSERT_THAT(seen, IsOk());
  ASSERT_TRUE(seen->has_value());
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (size_t i = 0; i < 54; ++i) {
    Eigen::Vector2d pixel;
    ASSERT_TRUE(Project(lens, pose * board.Points()[i], &pixel));
    mean += ((*seen)->pixels[i] - pixel) / 54;
  }
  EXPECT_LT(mean.norm(), 0.02);
  EXPECT_GT((*seen)->edge_width_px, 1);
  EXPECT_LT((*seen)->edge_width_px, 3.5);
  const cv::Mat soft = renderer.Render(board, pose, 3, 1);
  const auto blurred = FindBoard(board, MonoView(soft));
  ASSERT_THAT(blurred, IsOk());
  ASSERT_TRUE(blurred->has_value());
  EXPECT_GT((*blurred)->edge_width_px, 2 * (*seen)->edge_width_px);
}

TEST(BoardDetector, FindsCirclesOfBothKinds) {
  const Intrinsics lens = KnownPinhole();
  const BoardRenderer renderer(lens, kKnownImage);
  for (const char* text : {"board:circles,4x11,0.02", "board:circles-symmetric,9x6,0.03"}) {
    const Board board = *ParseBoard(text);
    for (const Eigen::Vector3d& turn : {Eigen::Vector3d(0, 0, 0.1), Eigen::Vector3d(0.3, 0.2, -0.2),
                                        Eigen::Vector3d(0.9, 0.1, -0.2)}) {
      const auto pose = BoardAt(board, lens, Eigen::Vector2d(310, 235), 0.5, turn);
      const auto errors = Errors(board, lens, renderer, pose, 1);
      ASSERT_EQ(errors.size(), static_cast<size_t>(board.point_count())) << text;
      EXPECT_LT(Median(errors), 0.04) << text;
      EXPECT_LT(*std::max_element(errors.begin(), errors.end()), 0.2) << text;
    }
  }
}

// As a screen shows them to a frame camera.
TEST(BoardDetector, CirclesMayBeWhiteOnDark) {
  const BoardRenderer renderer(KnownPinhole(), kKnownImage);
  const Board board = *ParseBoard("board:circles,4x11,0.02");
  const auto pose =
      BoardAt(board, KnownPinhole(), Eigen::Vector2d(310, 235), 0.5, {0.3, 0.2, -0.2});
  const cv::Mat dark = renderer.Render(board, pose, kLensBlurPx, 0);
  cv::Mat white;
  cv::bitwise_not(dark, white);
  const auto as_printed = FindBoard(board, MonoView(dark));
  const auto as_shown = FindBoard(board, MonoView(white));
  ASSERT_TRUE(as_printed.ok() && as_printed->has_value());
  ASSERT_TRUE(as_shown.ok() && as_shown->has_value());
  for (size_t i = 0; i < 44; ++i) {
    EXPECT_LT(((*as_printed)->pixels[i] - (*as_shown)->pixels[i]).norm(), 0.01);
  }
}

// Where y points up.
RigidTransform UpsideDown(RigidTransform pose, const Board& board) {
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& point : board.Points()) middle += point / board.point_count();
  const Eigen::Vector3d at = pose * middle;
  pose.rotation = pose.rotation * Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitX());
  pose.translation_m = at - pose.rotation * middle;
  return pose;
}

TEST(BoardDetector, FindsBoardsWithMarkersAlsoInPart) {
  const Intrinsics lens = KnownPinhole();
  const BoardRenderer renderer(lens, kKnownImage);
  for (const char* text : {"board:charuco,8x6,0.04,0.028,5x5_100",
                           "board:charuco,7x5,0.045,0.03,4x4_50", "board:aprilgrid,5x4,0.05,0.3"}) {
    const Board board = *ParseBoard(text);
    const auto points = board.Points();
    for (const Eigen::Vector3d& turn : {Eigen::Vector3d(0, 0, 0.1), Eigen::Vector3d(0.5, 0.2, 3),
                                        Eigen::Vector3d(0.2, 0.7, 1.4)}) {
      for (const bool is_cut : {false, true}) {
        RigidTransform pose = BoardAt(
            board, lens, is_cut ? Eigen::Vector2d(110, 235) : Eigen::Vector2d(320, 240), 0.5, turn);
        if (board.kind == BoardKind::kAprilGrid) pose = UpsideDown(pose, board);
        const cv::Mat image = renderer.Render(board, pose, kLensBlurPx, 1);
        const auto seen = FindBoard(board, MonoView(image));
        ASSERT_THAT(seen, IsOk());
        ASSERT_TRUE(seen->has_value()) << text << " turn " << turn.transpose() << " cut " << is_cut;
        std::vector<double> errors;
        double nees = 0;
        for (size_t i = 0; i < points.size(); ++i) {
          if (!(*seen)->Sees(i)) continue;
          Eigen::Vector2d pixel;
          ASSERT_TRUE(Project(lens, pose * points[i], &pixel));
          errors.push_back(((*seen)->pixels[i] - pixel).norm());
          nees += std::pow(errors.back() / (*seen)->sigmas_px[i], 2) / 2;
        }
        const double share =
            static_cast<double>(errors.size()) / static_cast<double>(points.size());
        EXPECT_GT(share, is_cut ? 0.25 : 0.8) << text << " turn " << turn.transpose();
        EXPECT_LT(Median(errors), 0.03) << text << " turn " << turn.transpose();
        EXPECT_LT(*std::max_element(errors.begin(), errors.end()), 0.15)
            << text << " turn " << turn.transpose();
        EXPECT_LT(nees / static_cast<double>(errors.size()), 4) << text;
      }
    }
  }
}

// The same place in space, seen from behind.
TEST(BoardDetector, TellsTheSidesOfABoardByTheirMarkers) {
  const Intrinsics lens = KnownPinhole();
  const BoardRenderer renderer(lens, kKnownImage);
  for (const char* text : {"board:charuco,8x6,0.04,0.028,5x5_100,two-sided=0.006",
                           "board:charuco,7x5,0.045,0.03,4x4_50,two-sided=0.006",
                           "board:aprilgrid,5x4,0.05,0.3,two-sided=0.006"}) {
    const Board board = *ParseBoard(text);
    const auto points = board.Points();
    for (const Eigen::Vector3d& turn : {Eigen::Vector3d(0, 0, 0.1), Eigen::Vector3d(0.4, 0.3, 3)}) {
      for (const bool is_back : {false, true}) {
        RigidTransform pose = BoardAt(board, lens, Eigen::Vector2d(320, 240), 0.5,
                                      turn + Eigen::Vector3d(0, is_back ? M_PI : 0, 0));
        if (board.kind == BoardKind::kAprilGrid) pose = UpsideDown(pose, board);
        const cv::Mat image = renderer.Render(board, pose, kLensBlurPx, 1);
        const auto seen = FindBoard(board, MonoView(image));
        ASSERT_THAT(seen, IsOk());
        ASSERT_TRUE(seen->has_value()) << text << " turn " << turn.transpose() << " " << is_back;
        ASSERT_EQ((*seen)->pixels.size(), points.size());
        std::vector<double> errors;
        for (size_t i = 0; i < points.size(); ++i) {
          if (!(*seen)->Sees(i)) continue;
          EXPECT_EQ(board.SideOf(i), is_back ? BoardSide::kBack : BoardSide::kFront);
          Eigen::Vector2d pixel;
          ASSERT_TRUE(Project(lens, pose * points[i], &pixel));
          errors.push_back(((*seen)->pixels[i] - pixel).norm());
        }
        // A thickness of 6 mm is 6 px at the border of the board.
        EXPECT_GT(errors.size(), 0.4 * static_cast<double>(points.size()));
        EXPECT_LT(Median(errors), 0.03) << text << " turn " << turn.transpose() << " " << is_back;
        EXPECT_LT(*std::max_element(errors.begin(), errors.end()), 0.15);
        // Told as a board of one side, its front alone is one.
        const auto front = FindBoard(board.OneSide(), MonoView(image));
        ASSERT_THAT(front, IsOk());
        EXPECT_EQ(front->has_value(), !is_back);
      }
    }
  }
}

// The points of a board with markers, against where they are.
struct MarkerErrors {
  int seen = 0;
  double worst_px = 0;
  double nees = 0;
};

MarkerErrors ErrorsOfMarkers(const Board& board, const Intrinsics& lens, RigidTransform pose,
                             double blur_px, double noise_grey) {
  if (board.kind == BoardKind::kAprilGrid) pose = UpsideDown(pose, board);
  const cv::Mat image = BoardRenderer(lens, kKnownImage).Render(board, pose, blur_px, noise_grey);
  const auto seen = FindBoard(board, MonoView(image));
  EXPECT_THAT(seen, IsOk());
  MarkerErrors errors;
  if (!seen.ok() || !seen->has_value()) return errors;
  for (size_t i = 0; i < (*seen)->pixels.size(); ++i) {
    if (!(*seen)->Sees(i)) continue;
    Eigen::Vector2d pixel;
    EXPECT_TRUE(Project(lens, pose * board.Points()[i], &pixel));
    const double error_px = ((*seen)->pixels[i] - pixel).norm();
    ++errors.seen;
    errors.worst_px = std::max(errors.worst_px, error_px);
    errors.nees += std::pow(error_px / (*seen)->sigmas_px[i], 2) / 2;
  }
  errors.nees /= std::max(1, errors.seen);
  return errors;
}

// Bits of one to two pixels, which OpenCV reads in few markers or in none, and squares that no
// window shows alone.
TEST(BoardDetector, FindsSmallAndBlurredMarkers) {
  struct Case {
    const char* board;
    bool is_fisheye;
    double distance_m, blur_px, noise_grey, most_px;
  };
  for (const Case& one : {Case{"board:charuco,9x6,0.035,0.025,5x5_100", false, 1.4, 0.7, 2, 0.15},
                          Case{"board:charuco,9x6,0.035,0.025,5x5_100", false, 0.75, 1.4, 4, 0.3},
                          Case{"board:charuco,9x6,0.035,0.025,5x5_100", true, 0.35, 0.7, 2, 0.2},
                          Case{"board:aprilgrid,6x4,0.04,0.3", false, 1.4, 0.7, 2, 0.15},
                          Case{"board:aprilgrid,6x4,0.04,0.3", false, 0.9, 1.4, 4, 0.3},
                          Case{"board:aprilgrid,6x4,0.04,0.3", true, 0.4, 0.7, 2, 0.2}}) {
    const Board board = *ParseBoard(one.board);
    const Intrinsics lens = one.is_fisheye ? KnownFisheye() : KnownPinhole();
    const auto pose =
        BoardAt(board, lens, Eigen::Vector2d(320, 240), one.distance_m, {0.4, 0.2, 0.3});
    const MarkerErrors errors = ErrorsOfMarkers(board, lens, pose, one.blur_px, one.noise_grey);
    SCOPED_TRACE(::testing::Message()
                 << one.board << " blur " << one.blur_px << " fisheye " << one.is_fisheye);
    EXPECT_GE(errors.seen, 0.95 * board.point_count());
    EXPECT_LT(errors.worst_px, one.most_px);
    EXPECT_GT(errors.nees, 0.4);
    EXPECT_LT(errors.nees, 1.6);
  }
}

// All of it is in the image, but so oblique that a lens bends it over a few squares.
TEST(BoardDetector, FollowsTheBendOfAFisheyeToTheBorder) {
  const Board board = *ParseBoard("board:charuco,9x6,0.035,0.025,5x5_100");
  const auto pose =
      BoardAt(board, KnownFisheye(), Eigen::Vector2d(500, 240), 0.3, {0.1, -0.5, 1.2});
  const MarkerErrors errors = ErrorsOfMarkers(board, KnownFisheye(), pose, 0.5, 1);
  EXPECT_GE(errors.seen, 36);
  EXPECT_LT(errors.worst_px, 0.2);
}

TEST(BoardDetector, RefusesMarkersOfABoardOfOtherCounts) {
  for (const auto& [printed, told] :
       {std::pair("board:charuco,9x6,0.035,0.025,5x5_100", "board:charuco,8x6,0.035,0.025,5x5_100"),
        std::pair("board:charuco,9x6,0.035,0.025,5x5_100", "board:charuco,6x9,0.035,0.025,5x5_100"),
        std::pair("board:aprilgrid,6x4,0.04,0.3", "board:aprilgrid,4x6,0.04,0.3"),
        std::pair("board:aprilgrid,5x5,0.04,0.3", "board:aprilgrid,6x5,0.04,0.3")}) {
    const Board board = *ParseBoard(printed);
    RigidTransform pose =
        BoardAt(board, KnownPinhole(), Eigen::Vector2d(320, 240), 0.6, {0.2, 0.2, 0.3});
    if (board.kind == BoardKind::kAprilGrid) pose = UpsideDown(pose, board);
    const cv::Mat image = BoardRenderer(KnownPinhole(), kKnownImage).Render(board, pose, 0.7, 1);
    const auto right = FindBoard(board, MonoView(image));
    const auto wrong = FindBoard(*ParseBoard(told), MonoView(image));
    ASSERT_TRUE(right.ok() && wrong.ok());
    EXPECT_TRUE(right->has_value()) << printed;
    EXPECT_FALSE(wrong->has_value()) << told;
  }
}

TEST(BoardDetector, ReadsChArUcoBoardsOfTheOldLayout) {
  // With an even number of rows of squares, OpenCV before 4.6 drew the upper left square white.
  const Board board = *ParseBoard("board:charuco,8x6,0.04,0.028,5x5_100");
  const cv::Mat image = OldLayout(board);
  const auto seen = FindBoard(board, MonoView(image));
  ASSERT_THAT(seen, IsOk());
  ASSERT_TRUE(seen->has_value());
  for (size_t i = 0; i < (*seen)->pixels.size(); ++i) {
    ASSERT_TRUE((*seen)->Sees(i));
    const Eigen::Vector3d point = board.Points()[i];
    const Eigen::Vector2d expected(kOldMarginPx + kOldSquarePx * (1 + point.x() / 0.04) - 0.5,
                                   kOldMarginPx + kOldSquarePx * (1 + point.y() / 0.04) - 0.5);
    EXPECT_LT(((*seen)->pixels[i] - expected).norm(), 0.1) << i;
  }
}

TEST(BoardDetector, FindsNothingWhereThereIsNothing) {
  const cv::Mat grey(480, 640, CV_8UC1, cv::Scalar(90));
  for (const char* text :
       {"board:checker,9x6,0.03", "board:circles,4x11,0.02", "board:charuco,8x6,0.04,0.028,5x5_100",
        "board:aprilgrid,6x6,0.088,0.3"}) {
    const auto seen = FindBoard(*ParseBoard(text), MonoView(grey));
    ASSERT_THAT(seen, IsOk());
    EXPECT_FALSE(seen->has_value());
  }
}

}  // namespace
}  // namespace rigcal::agent::board_detector_test
