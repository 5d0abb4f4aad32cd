// SPDX-License-Identifier: Apache-2.0
#include "server/solve/rig/stamp_jitter.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>
#include <vector>

#include "server/solve/bundle/bundle_path.h"
#include "tests/server/solve/exact_problem.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::stamp_jitter_test {
namespace {

constexpr int kInstants = 400;
constexpr double kPeriodS = 0.04;

// A wand on a circle, 25 times a second; each camera's row is seen `late_s` (camera, instant, image
// row) late, with a noise of half a pixel.
BundleProblem Waved(const std::function<double(size_t, size_t, double)>& late_s) {
  const auto origin_m = [](double time_s) {
    return Eigen::Vector3d(0.6 * std::cos(2.1 * time_s), 0.6 * std::sin(2.9 * time_s), 4);
  };
  std::vector<ExactWand> wands, later;
  for (int i = 0; i < kInstants; ++i) {
    wands.push_back({origin_m(kPeriodS * i)});
    later.push_back({origin_m(kPeriodS * i + 1e-4)});
  }
  const std::vector<Eigen::Vector3d> centres_m = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  BundleProblem problem = ExactProblem(centres_m, wands);
  const BundleProblem soon = ExactProblem(centres_m, later);
  std::mt19937 random(5);
  std::normal_distribution<double> noise_px(0, 0.5);
  for (size_t i = 0; i < problem.instants.size(); ++i) {
    for (BundleObservation& observation : problem.ObservationsOf(problem.instants[i])) {
      observation.clock_time_s = kPeriodS * static_cast<double>(i);
      const BundleMarker& middle = problem.MarkersOf(observation)[1];
      const double own_s =
          late_s(static_cast<size_t>(observation.camera), i, middle.centre_px.y() - 512);
      for (BundleMarker& marker : problem.MarkersOf(observation)) {
        marker.velocity_px_s =
            1e4 * (soon.markers[problem.IndexOf(marker)].centre_px - marker.centre_px);
        const Eigen::Vector2d moved_px(marker.velocity_px_s.x() * own_s + noise_px(random),
                                       marker.velocity_px_s.y() * own_s + noise_px(random));
        marker.centre_px += moved_px;
      }
    }
  }
  return problem;
}

TEST(StampJitter, OfNoiseAloneThereIsNone) {
  for (const StampJitter& jitter :
       MeasureStampJitter(Waved([](size_t, size_t, double) { return 0; }))) {
    EXPECT_GT(jitter.row_count, 300);
    EXPECT_LT(jitter.jitter_s, 1e-3);
    EXPECT_FALSE(jitter.StandsOut());
  }
}

TEST(StampJitter, TimesThatScatterAreMeasured) {
  std::mt19937 random(3);
  std::normal_distribution<double> scatter_s(0, 8e-3);
  BundleProblem problem =
      Waved([&](size_t camera, size_t, double) { return camera == 1 ? scatter_s(random) : 0; });
  EXPECT_NEAR(MeasureStampJitter(problem)[1].shown_s, 8e-3, 1e-3);  // beside exact poses
  // Poses that are solved give way to the times; a fifth is left to the robust loss.
  for (BundleCamera& camera : problem.cameras) camera.pose_fixed = true;
  ASSERT_THAT(AdjustBundle(BundleOptions(), &problem), ::rigcal::testing::IsOk());
  const auto all = MeasureStampJitter(problem);
  ASSERT_EQ(all.size(), 3u);
  EXPECT_NEAR(all[1].jitter_s, 8e-3, 1.6e-3);
  EXPECT_LT(all[1].shown_s, 0.9 * all[1].jitter_s);
  EXPECT_LT(all[1].line_s, 2e-3);
  EXPECT_TRUE(all[1].StandsOut());
  EXPECT_FALSE(all[0].StandsOut());
  EXPECT_FALSE(all[2].StandsOut());
}

// 30 us a row: nearly 10 ms over what the wand covers, and no jitter.
TEST(StampJitter, ARollingShutterIsLinearInTheImageRow) {
  const auto all = MeasureStampJitter(
      Waved([](size_t camera, size_t, double row_px) { return camera == 1 ? 30e-6 * row_px : 0; }));
  EXPECT_FALSE(all[1].StandsOut());
  EXPECT_GT(all[1].line_s, all[0].line_s);
}

TEST(StampJitter, AClockThatDriftsDoesNotJitter) {
  const auto all = MeasureStampJitter(
      Waved([](size_t, size_t instant, double) { return 5e-5 * static_cast<double>(instant); }));
  for (const StampJitter& jitter : all) EXPECT_FALSE(jitter.StandsOut());
}

TEST(StampJitter, OfFewRowsNothingIsSaid) {
  BundleProblem problem = Waved([](size_t, size_t i, double) { return i % 2 == 0 ? 0.02 : -0.02; });
  EXPECT_TRUE(MeasureStampJitter(problem)[0].StandsOut());
  for (size_t i = 40; i < problem.instants.size(); ++i) problem.instants[i].used = false;
  EXPECT_FALSE(MeasureStampJitter(problem)[0].StandsOut());
  EXPECT_TRUE(MeasureStampJitter({}).empty());
}

}  // namespace
}  // namespace rigcal::server::stamp_jitter_test
