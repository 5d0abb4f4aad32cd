// SPDX-License-Identifier: Apache-2.0
#include "common/lens/lens_adjustment.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/camera/intrinsics_vector.h"
#include "common/lens/lens_start.h"
#include "tests/common/lens/known_lens.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::lens_adjustment_test {
namespace {

using namespace rigcal::testing;  // the known lens

const Board kBoard = *ParseBoard("board:checker,9x6,0.03");

TEST(LensAdjustment, FindsTheLensOfExactCorners) {
  for (const auto& [model, lens] : {std::pair(LensModel::kPinhole5, KnownPinhole()),
                                    std::pair(LensModel::kFisheye, KnownFisheye())}) {
    const auto poses = WavedBoard(kBoard, lens, kKnownImage, 20, 0.35, 0.6, 0.7, 1);
    const auto views = SeenBoards(kBoard, lens, kKnownImage, poses, 0, 1);
    ASSERT_GE(views.size(), 18u);
    const absl::StatusOr<LensEstimate> start = StartLens(model, kKnownImage, views);
    ASSERT_THAT(start, IsOk());
    LensAdjustmentOptions wide;
    wide.loss_px = 20;
    const LensAdjustment first = AdjustLens(views, *start, wide);
    const LensAdjustment solved = AdjustLens(views, first.estimate);
    EXPECT_LT(solved.cost_px2, 1e-8);
    const auto values = ToVector(solved.estimate.intrinsics), truth = ToVector(lens);
    for (Eigen::Index i = 0; i < truth.size(); ++i) {
      EXPECT_NEAR(values[i], truth[i], 1e-4 * std::max(1.0, std::abs(truth[i])))
          << LensModelName(model) << " value " << i;
    }
  }
}

TEST(LensAdjustment, StaysWhereTheIntrinsicsAreFixed) {
  const Intrinsics lens = KnownPinhole();
  const auto poses = WavedBoard(kBoard, lens, kKnownImage, 3, 0.5, 0.8, 0.7, 2);
  const auto views = SeenBoards(kBoard, lens, kKnownImage, poses, 0, 2);
  LensEstimate start = {.model = LensModel::kPinhole5, .intrinsics = lens, .cam_from_board = poses};
  for (RigidTransform& pose : start.cam_from_board) pose.translation_m.z() += 0.02;
  LensAdjustmentOptions options;
  options.fix_intrinsics = true;
  const LensAdjustment solved = AdjustLens(views, start, options);
  EXPECT_EQ(solved.estimate.intrinsics, lens);
  EXPECT_LT(solved.cost_px2, 1e-10);
  EXPECT_LT((solved.estimate.cam_from_board[0].translation_m - poses[0].translation_m).norm(),
            1e-6);
}

TEST(LensAdjustment, CornersBehindTheCameraCostAFixedPrice) {
  const BoardView view = {"v", {{Eigen::Vector3d(0, 0, 0), Eigen::Vector2d(3, 4)}}};
  RigidTransform behind;
  behind.translation_m.z() = -1;
  EXPECT_EQ(CornerErrors(view, KnownPinhole(), behind)[0], kUnseenPx);
}

}  // namespace
}  // namespace rigcal::lens_adjustment_test
