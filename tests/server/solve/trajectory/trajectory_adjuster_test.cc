// SPDX-License-Identifier: Apache-2.0
#include "server/solve/trajectory/trajectory_adjuster.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "server/solve/trajectory/trajectory_system.h"
#include "tests/server/solve/trajectory/trajectory_scene.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::trajectory_adjuster_test {
namespace {

using ::rigcal::testing::IsOk;

double WorstCentreM(const TrajectoryProblem& solved, const TrajectoryProblem& truth) {
  double worst_m = 0;
  for (size_t c = 0; c < truth.rows.cameras.size(); ++c) {
    worst_m = std::max(worst_m, (solved.rows.cameras[c].cam_from_rig.SourceFromTargetTranslation() -
                                 truth.rows.cameras[c].cam_from_rig.SourceFromTargetTranslation())
                                    .norm());
  }
  return worst_m;
}

TEST(TrajectoryAdjusterTest, ExactRowsGiveExactParameters) {
  for (const bool is_point : {false, true}) {
    TrajectorySceneOptions options;
    options.is_point = is_point;
    options.stated_px = 1e-4;
    TrajectoryScene scene = MakeTrajectoryScene(options);
    BundleOptions bundle;
    bundle.robust = false;
    ASSERT_OK_AND_ASSIGN(const TrajectorySummary summary, AdjustTrajectory(bundle, &scene.initial));
    EXPECT_TRUE(summary.converged);
    EXPECT_LT(WorstCentreM(scene.initial, scene.ground_truth), 1e-6);
    for (size_t c = 0; c < scene.initial.rows.cameras.size(); ++c) {
      EXPECT_NEAR(scene.initial.rows.cameras[c].line_delay_s,
                  scene.ground_truth.rows.cameras[c].line_delay_s, 1e-9);
      EXPECT_NEAR(scene.initial.rows.clocks[c].time_offset_s,
                  scene.ground_truth.rows.clocks[c].time_offset_s, 1e-6);
    }
  }
}

TEST(TrajectoryAdjusterTest, NoiseGivesItsSigma) {
  TrajectorySceneOptions options;
  options.noise_px = 0.2;
  options.stated_px = 0.2;
  options.duration_s = 20;
  TrajectoryScene scene = MakeTrajectoryScene(options);
  BundleOptions bundle;
  ASSERT_OK_AND_ASSIGN(const TrajectorySummary summary, AdjustTrajectory(bundle, &scene.initial));
  EXPECT_TRUE(summary.converged);
  EXPECT_NEAR(summary.residual_sigma, 1, 0.1);
  EXPECT_LT(WorstCentreM(scene.initial, scene.ground_truth), 2e-3);
}

// A smaller rig would have a smoother path.
TEST(TrajectoryAdjusterTest, ThePathDoesNotChangeTheScale) {
  TrajectorySceneOptions options;
  options.noise_px = options.stated_px = 0.3;
  options.duration_s = 20;
  options.free_spacing = true;
  TrajectoryScene scene = MakeTrajectoryScene(options);
  ASSERT_THAT(AdjustTrajectory({}, &scene.initial), IsOk());
  // Known to 2 mm, and nothing but that is known of it.
  EXPECT_NEAR(scene.initial.rows.target.marker_positions_m.back(), 0.39, 0.0001);
  EXPECT_NEAR(scene.initial.rows.target.marker_positions_m[1], 0.13, 0.0001);
}

std::vector<double> EvenPositions(int markers) {
  std::vector<double> positions_m;
  for (int m = 0; m < markers; ++m) positions_m.push_back(0.04 * m);
  return positions_m;
}

// How much larger the spans are than their priors have them; all have one sigma.
double SpansFactor(const BundleTarget& target) {
  double product = 0, square = 0;
  for (size_t m = 1; m < target.marker_positions_m.size(); ++m) {
    const double span_m = target.marker_positions_m[m] - target.marker_positions_m[m - 1];
    product += span_m * (target.given_positions_m[m] - target.given_positions_m[m - 1]);
    square += span_m * span_m;
  }
  return product / square;
}

// From 3 % off: the steps alone lead nearly there, the end is in closed form.
TEST(TrajectoryAdjusterTest, EndsAtTheScaleOfTheSpans) {
  for (const int markers : {2, 3, 6, 16}) {
    for (const double sigma_rel : {0.001, 0.05, 0.1}) {
      for (const double focal_px : {400.0, 800.0, 3000.0}) {
        SCOPED_TRACE(markers);
        SCOPED_TRACE(sigma_rel);
        SCOPED_TRACE(focal_px);
        TrajectorySceneOptions options;
        options.marker_positions_m = EvenPositions(markers);
        options.span_sigma_m = 0.04 * sigma_rel;
        options.focal_px = focal_px;
        options.noise_px = options.stated_px = 0.3;
        options.free_spacing = true;
        options.initial_scale = 0.97;
        options.initial_error = 0.3;
        options.duration_s = 4;
        TrajectoryScene scene = MakeTrajectoryScene(options);
        BundleOptions bundle;
        bundle.function_tolerance = 1e-7;
        ASSERT_OK_AND_ASSIGN(const TrajectorySummary summary,
                             AdjustTrajectory(bundle, &scene.initial));
        EXPECT_TRUE(summary.converged);
        EXPECT_NEAR(SpansFactor(scene.initial.rows.target), 1, 1e-12);
      }
    }
  }
}

// What the rows and their path say of the scale is nothing: its information is that of the priors.
TEST(TrajectoryAdjusterTest, TheInformationAboutTheScaleIsThatOfTheSpans) {
  for (const int markers : {2, 6, 16}) {
    TrajectorySceneOptions options;
    options.marker_positions_m = EvenPositions(markers);
    options.noise_px = options.stated_px = 0.3;
    options.free_spacing = true;
    TrajectoryScene scene = MakeTrajectoryScene(options);
    BundleOptions bundle;
    ASSERT_THAT(AdjustTrajectory(bundle, &scene.initial), IsOk());
    TrajectorySystem system(bundle, &scene.initial);
    ASSERT_TRUE(system.Linearise());
    const BundleProblem& rows = scene.initial.rows;
    const auto columns = static_cast<Eigen::Index>(system.layout().parameters.size());
    Eigen::VectorXd grow = Eigen::VectorXd::Zero(columns);
    for (Eigen::Index i = 0; i < columns; ++i) {
      const ReducedParameter& parameter = system.layout().parameters[static_cast<size_t>(i)];
      const auto index = static_cast<size_t>(parameter.index);
      if (parameter.kind == ReducedParameterKind::kTranslation) {
        grow[i] = rows.cameras[index].cam_from_rig.translation_m[parameter.component];
      } else if (parameter.kind == ReducedParameterKind::kMarkerPosition) {
        grow[i] = rows.target.marker_positions_m[index];
      }
    }
    double of_spans = 0;
    for (size_t m = 1; m < rows.target.marker_positions_m.size(); ++m) {
      const double span_m =
          rows.target.marker_positions_m[m] - rows.target.marker_positions_m[m - 1];
      of_spans += std::pow(span_m / rows.target.span_sigma_m, 2);
    }
    const Eigen::MatrixXd information = system.matrix().selfadjointView<Eigen::Lower>();
    EXPECT_NEAR(grow.dot(information * grow) / of_spans, 1, 0.01) << markers << " markers";
  }
}

// Rows of which every camera keeps a third, each its own.
TEST(TrajectoryAdjusterTest, OutliersAreFoundAmongSparseRows) {
  TrajectorySceneOptions options;
  options.noise_px = options.stated_px = 0.2;
  options.duration_s = 20;
  options.kept_share = 0.33;
  TrajectoryScene scene = MakeTrajectoryScene(options);
  BundleProblem& rows = scene.initial.rows;
  std::vector<size_t> moved;
  for (size_t m = 20; m < rows.markers.size(); m += 40) {
    rows.markers[m].centre_px += Eigen::Vector2d(40, -30);
    rows.markers[m].used = false;
    moved.push_back(m);
  }
  // One that nobody has used yet, but that is right.
  rows.markers[5].used = false;
  BundleOptions bundle;
  ASSERT_OK_AND_ASSIGN(const TrajectorySummary summary, AdjustTrajectory(bundle, &scene.initial));
  EXPECT_TRUE(summary.converged);
  EXPECT_EQ(ClassifyOutliersOfPath(bundle, &scene.initial), 1);
  EXPECT_TRUE(rows.markers[5].used);
  for (const size_t m : moved) EXPECT_FALSE(rows.markers[m].used);
}

TEST(TrajectoryAdjusterTest, EqualProblemsGiveEqualBits) {
  TrajectorySceneOptions options;
  options.noise_px = 0.2;
  TrajectoryScene a = MakeTrajectoryScene(options), b = MakeTrajectoryScene(options);
  ASSERT_THAT(AdjustTrajectory({}, &a.initial), IsOk());
  ASSERT_THAT(AdjustTrajectory({}, &b.initial), IsOk());
  EXPECT_EQ(a.initial.spans[0].knots, b.initial.spans[0].knots);
  EXPECT_EQ(WorstCentreM(a.initial, b.initial), 0);
}

TEST(TrajectoryAdjusterTest, RefusesWhatIsNoTrajectory) {
  TrajectoryScene scene = MakeTrajectoryScene({});
  TrajectoryProblem short_span = scene.initial;
  short_span.spans[0].knots.conservativeResize(3 * short_span.spans[0].size);
  EXPECT_EQ(AdjustTrajectory({}, &short_span).status().code(), absl::StatusCode::kInvalidArgument);
  TrajectoryProblem unused = scene.initial;
  for (BundleMarker& marker : unused.rows.markers) marker.used = false;
  EXPECT_EQ(AdjustTrajectory({}, &unused).status().code(), absl::StatusCode::kFailedPrecondition);
}

}  // namespace
}  // namespace rigcal::server::trajectory_adjuster_test
