// SPDX-License-Identifier: Apache-2.0
#include "server/solve/trajectory/marker_slopes.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <utility>

#include "common/camera/intrinsics_vector.h"
#include "tests/server/solve/trajectory/trajectory_scene.h"

namespace rigcal::server::marker_slopes_test {
namespace {

// Everything that can be free is: poses, intrinsics, line delays, offsets, rates and the spacing.
TrajectoryProblem FreeProblem(bool is_point) {
  TrajectorySceneOptions options;
  options.duration_s = 2;
  options.is_point = is_point;
  options.free_spacing = true;
  options.initial_error = 0.1;  // of a wilder path, one-sided differences are off by its curvature
  TrajectoryProblem problem = MakeTrajectoryScene(options).initial;
  for (BundleCamera& camera : problem.rows.cameras) {
    camera.intrinsics_fixed = false;
    camera.intrinsics_mean = camera.intrinsics;
    camera.intrinsics_sigma = IntrinsicsVector::Ones(camera.intrinsics.size());
  }
  for (BundleClock& clock : problem.rows.clocks) clock.rate_fixed = clock.offset_fixed;
  return problem;
}

TEST(MarkerSlopesTest, AgreeWithNumericDerivatives) {
  for (const bool is_point : {false, true}) {
    TrajectoryProblem problem = FreeProblem(is_point);
    const LineBundleLayout layout = LayOut(problem.rows);
    std::set<ReducedParameterKind> kinds;
    ForEachUsedMarkerOfRows(problem, [&](size_t row, const BundleObservation& observation,
                                         const BundleMarker& marker) {
      MarkerSlopes slopes;
      ASSERT_TRUE(DifferentiateMarker(problem, layout, row, observation, marker, &slopes));
      const auto residual = [&] { return *problem.WhitenedResidual(row, observation, marker); };
      EXPECT_EQ(slopes.residual, residual());
      // One-sided differences at steps of 1e-6 keep five digits or so.
      const auto expect_near = [](const Eigen::Vector2d& stated, const Eigen::Vector2d& numeric) {
        EXPECT_LT((stated - numeric).norm(), 1e-4 * (1 + stated.norm()));
      };
      size_t reduced = 0;
      ForEachUnknownOf(layout, observation, marker, &problem.rows, [&](int column, double step) {
        ASSERT_LT(reduced, slopes.reduced.size());
        const auto stated =
            std::ranges::find(slopes.reduced, column, &std::pair<int, Eigen::Vector2d>::first);
        ASSERT_NE(stated, slopes.reduced.end());
        expect_near(stated->second, (residual() - slopes.residual) / step);
        kinds.insert(layout.parameters[static_cast<size_t>(column)].kind);
        ++reduced;
      });
      EXPECT_EQ(reduced, slopes.reduced.size());
      TrajectorySpan& span = problem.spans[0];
      for (Eigen::Index i = 0; i < slopes.knots.cols(); ++i) {
        double& number = span.knots[slopes.weights.first_knot * span.size + i];
        const double before = number;
        number += kKnotStep;
        expect_near(slopes.knots.col(i), (residual() - slopes.residual) / kKnotStep);
        number = before;
      }
      EXPECT_EQ(residual(), slopes.residual);  // all is back where it was
    });
    EXPECT_EQ(kinds.size(), is_point ? 6 : 7);
  }
}

TEST(MarkerSlopesTest, SayWhereTheCameraCannotSeeTheMarker) {
  TrajectorySceneOptions options;
  options.duration_s = 1;
  TrajectoryProblem problem = MakeTrajectoryScene(options).ground_truth;
  const LineBundleLayout layout = LayOut(problem.rows);
  const BundleObservation& observation = problem.rows.observations[0];
  const BundleMarker& marker = problem.rows.markers[0];
  MarkerSlopes slopes;
  EXPECT_TRUE(DifferentiateMarker(problem, layout, 0, observation, marker, &slopes));
  // The camera turns its back.
  RigidTransform& pose = problem.rows.cameras[0].cam_from_rig;
  pose.rotation = Eigen::Quaterniond(0, 1, 0, 0) * pose.rotation;
  EXPECT_FALSE(DifferentiateMarker(problem, layout, 0, observation, marker, &slopes));
}

}  // namespace
}  // namespace rigcal::server::marker_slopes_test
