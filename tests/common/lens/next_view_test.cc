// SPDX-License-Identifier: Apache-2.0
#include "common/lens/next_view.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "common/lens/lens_solver.h"
#include "tests/common/lens/known_lens.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::next_view_test {
namespace {

using namespace rigcal::testing;  // the known lens
using ::testing::HasSubstr;
using ::testing::IsEmpty;

const Board kBoard = *ParseBoard("board:checker,9x6,0.03");

NextView Advise(const std::vector<BoardView>& views, const LensSolution* solution,
                bool is_whole = true) {
  return AdviseNextView(kBoard.Points(), kKnownImage, views, solution, is_whole);
}

TEST(NextView, BeginsWithAListOfItsOwn) {
  std::set<std::string> words;
  std::vector<BoardView> views;
  for (int i = 0; i < 8; ++i) {
    const NextView next = Advise(views, nullptr);
    EXPECT_THAT(next.words, HasSubstr(i < 4 ? "in the middle" : "at the "));
    EXPECT_THAT(next.words, HasSubstr("turned away from the camera by about 30 degrees"));
    EXPECT_THAT(next.outline_px, IsEmpty());
    EXPECT_TRUE(std::isnan(next.expected_p95_px));
    words.insert(next.words);
    views.emplace_back();
  }
  EXPECT_EQ(words.size(), 8u);
}

// Views of the left half of the image ask for one at the right.
TEST(NextView, AsksForWhatIsBare) {
  for (const Intrinsics& lens : {KnownPinhole(), KnownFisheye()}) {
    const bool is_wide = lens.model == DistortionModel::kFisheye;
    std::vector<RigidTransform> poses;
    for (int i = 0; i < 12; ++i) {
      const double towards = i * M_PI / 6;
      poses.push_back(BoardAt(kBoard, lens, {190, i % 2 == 0 ? 180 : 300}, is_wide ? 0.3 : 0.6,
                              {0.6 * std::cos(towards), 0.6 * std::sin(towards), 0.1}));
    }
    const auto views = SeenBoards(kBoard, lens, kKnownImage, poses, 0.05, 1);
    const auto solved = SolveLens(views, kKnownImage,
                                  {.model = is_wide ? LensModel::kFisheye : LensModel::kPinhole5});
    ASSERT_THAT(solved, IsOk());
    const NextView next = Advise(views, &*solved);
    EXPECT_THAT(next.words, HasSubstr("right, "));
    EXPECT_LT(next.expected_p95_px, 0.8 * solved->uncertainty.p95_px);
    // All of it is in the image, and its middle is where the words say.
    ASSERT_EQ(next.outline_px.size(), 4u);
    Eigen::Vector2d middle = Eigen::Vector2d::Zero();
    for (const Eigen::Vector2d& pixel : next.outline_px) {
      EXPECT_TRUE((pixel.array() >= 0).all() && pixel.x() <= 639 && pixel.y() <= 479);
      middle += pixel / 4;
    }
    EXPECT_GT(middle.x(), 330);
    // The view does what it promises.
    auto more = views;
    const auto taken = SeenBoards(kBoard, lens, kKnownImage, {next.cam_from_board}, 0.05, 2);
    ASSERT_EQ(taken.size(), 1u);
    more.push_back(taken[0]);
    const auto again = SolveLens(more, kKnownImage, {.model = solved->model});
    ASSERT_THAT(again, IsOk());
    EXPECT_NEAR(again->uncertainty.p95_px, next.expected_p95_px, 0.3 * next.expected_p95_px);
  }
}

TEST(NextView, WordsAndPoseAreTheSame) {
  const Intrinsics lens = KnownPinhole();
  auto views = SeenBoards(kBoard, lens, kKnownImage,
                          WavedBoard(kBoard, lens, kKnownImage, 12, 0.5, 0.8, 0.7, 3), 0.05, 1);
  for (int i = 0; i < 6; ++i) {
    const auto solved = SolveLens(views, kKnownImage, {.model = LensModel::kPinhole5});
    ASSERT_THAT(solved, IsOk());
    const NextView next = Advise(views, &*solved);
    SCOPED_TRACE(next.words);
    // Facing whoever stands at the camera, the side that is turned away is farther than the board's
    // middle.
    const auto points = kBoard.Points();
    const auto depth = [&](size_t column, size_t row) {
      return (next.cam_from_board * points[row * 9 + column]).norm();
    };
    const double left = depth(0, 2) + depth(0, 3), right = depth(8, 2) + depth(8, 3);
    const double top = 2 * depth(4, 0), bottom = 2 * depth(4, 5);
    const auto says = [&](const char* word) {
      const std::string side = next.words.substr(next.words.find("with its"));
      return side.find(word) != std::string::npos;
    };
    if (next.words.find("facing") == std::string::npos) {
      if (says("left")) {
        EXPECT_GT(left, right);
      }
      if (says("right")) {
        EXPECT_GT(right, left);
      }
      if (says("upper")) {
        EXPECT_GT(top, bottom);
      }
      if (says("lower")) {
        EXPECT_GT(bottom, top);
      }
    }
    views.push_back(
        SeenBoards(kBoard, lens, kKnownImage, {next.cam_from_board}, 0.05, static_cast<uint32_t>(i))
            .at(0));
  }
}

// kalibr's grids have y up, and who holds a board on its side goes on to.
TEST(NextView, KeepsTheWayRoundThatTheBoardIsHeld) {
  const Intrinsics lens = KnownPinhole();
  for (const bool is_mirrored : {false, true}) {
    std::vector<RigidTransform> poses = WavedBoard(kBoard, lens, kKnownImage, 12, 0.5, 0.8, 0.7, 3);
    for (RigidTransform& pose : poses) {
      const Eigen::Vector3d middle(4 * 0.03, 2.5 * 0.03, 0);
      const Eigen::Quaterniond turn(is_mirrored
                                        ? Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitX())
                                        : Eigen::AngleAxisd(M_PI / 2, Eigen::Vector3d::UnitZ()));
      pose = {pose.rotation * turn, pose * middle - (pose.rotation * turn) * middle};
    }
    const auto views = SeenBoards(kBoard, lens, kKnownImage, poses, 0.05, 1);
    const auto solved = SolveLens(views, kKnownImage, {.model = LensModel::kPinhole5});
    ASSERT_THAT(solved, IsOk());
    const Eigen::Matrix3d advised =
        Advise(views, &*solved).cam_from_board.rotation.toRotationMatrix();
    if (is_mirrored) {
      EXPECT_LT(advised(2, 2), -0.3);  // z to the camera
      EXPECT_GT(advised(0, 0), 0.3);   // x to the right
    } else {
      EXPECT_GT(advised(2, 2), 0.3);
      EXPECT_GT(advised(1, 0), 0.3);  // x down
    }
  }
}

// A board whose parts are found may reach over the border.
TEST(NextView, PartsReachTheBorder) {
  const Intrinsics lens = KnownPinhole();
  NextView corner;
  corner.place_x = corner.place_y = 1;
  const auto reach = [&](bool is_whole) {
    const auto pose = PoseOf(corner, kBoard.Points(), lens, kKnownImage, {}, is_whole);
    EXPECT_TRUE(pose.has_value());
    double farthest_px = 0;
    for (const Eigen::Vector3d& point : kBoard.Points()) {
      Eigen::Vector2d pixel;
      EXPECT_TRUE(Project(lens, *pose * point, &pixel));
      farthest_px = std::max(farthest_px, pixel.x());
    }
    return farthest_px;
  };
  EXPECT_GT(reach(true), 590);
  EXPECT_LT(reach(true), 640);
  EXPECT_GT(reach(false), 660);
  const auto views =
      SeenBoards(kBoard, lens, kKnownImage,
                 WavedBoard(kBoard, lens, kKnownImage, 12, 0.6, 0.8, 0.7, 3, 0.3), 0.05, 1);
  const auto solved = SolveLens(views, kKnownImage, {.model = LensModel::kPinhole5});
  ASSERT_THAT(solved, IsOk());
  EXPECT_LE(Advise(views, &*solved, false).expected_p95_px,
            Advise(views, &*solved, true).expected_p95_px);
}

}  // namespace
}  // namespace rigcal::next_view_test
