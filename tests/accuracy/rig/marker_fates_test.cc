// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/rig/marker_fates.h"

#include <cmath>
#include <optional>
#include <utility>

#include "server/solve/calibrate.h"
#include "tests/accuracy/rig/simulated_tracks.h"
#include "tests/server/solve/simulated_input.h"
#include "tests/testing/simulation_text.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::accuracy::marker_fates_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::ParseSimulationOptions;

// A solve of a bad recording, whose decisions the tests then override.
class CountFatesTest : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_OK_AND_ASSIGN(
        const SimulationOptions options,
        ParseSimulationOptions("seed=2;cameras=4;duration=15;outliers=0.1;dropouts=0.1;swaps=0.1"));
    ASSERT_OK_AND_ASSIGN(SimulatedWorld world,
                         SimulatedWorld::Create(options, *ParseTarget("wand:0,0.13,0.39")));
    world_.emplace(std::move(world));
    server::CalibrationHooks hooks;
    hooks.solved = [this](const server::RigObservations& rig, const server::RigSolution& solution) {
      rig_ = rig;
      solution_ = solution;
    };
    CalibrationOptions fixed;
    fixed.intrinsics = fixed.time_offsets = fixed.marker_positions = Estimate::kFixed;
    ASSERT_THAT(server::Calibrate(server::InputOf(*world_), fixed, hooks).result, IsOk());
    ASSERT_FALSE(solution_.built.problem.markers.empty());
  }

  // Calls visit(marker, ground truth of its row).
  template <typename Visit>
  void ForEachMarker(Visit visit) {
    const auto truth = MakeRowGroundTruth(*world_);
    for (size_t m = 0; m < solution_.built.problem.markers.size(); ++m) {
      const server::MarkerSource& source = solution_.built.sources[m];
      const auto& track = rig_.tracks[static_cast<size_t>(source.track)].track;
      const int camera = CameraIndex(*world_, track.camera.camera);
      const Observation& row = track.observations[static_cast<size_t>(source.observation)];
      // 25 Hz, no offset: the stamp gives the frame.
      const double since_origin_s =
          1e-9 * static_cast<double>(
                     row.time_ns - world_->cameras()[static_cast<size_t>(camera)].clock_origin_ns);
      visit(solution_.built.problem.markers[m],
            truth[static_cast<size_t>(camera)]
                 [static_cast<size_t>(std::lround(25 * since_origin_s))]);
    }
  }
  void ForgetDecisions() {
    for (server::BundleInstant& instant : solution_.built.problem.instants) instant.used = true;
    for (server::BundleMarker& marker : solution_.built.problem.markers) marker.used = true;
    for (const server::BundleObservation& observation : solution_.built.problem.observations) {
      if (!server::IsFlipped(solution_, observation)) continue;
      for (int m = 0; m < observation.marker_count; ++m) {
        server::BundleMarker& marker =
            solution_.built.problem.markers[static_cast<size_t>(observation.first_marker + m)];
        marker.marker = 2 - marker.marker;
      }
    }
  }
  FateCounts Count() const { return CountFates(*world_, rig_, solution_); }

  std::optional<SimulatedWorld> world_;
  server::RigObservations rig_;
  server::RigSolution solution_;
};

TEST_F(CountFatesTest, WhoDecidesNothingFindsNothing) {
  ForgetDecisions();
  const FateCounts counts = Count();
  EXPECT_EQ(counts.outlier_removed, 0);
  EXPECT_EQ(counts.good_removed, 0);
  EXPECT_GT(counts.outlier_kept, 200);
  EXPECT_GT(counts.flipped_kept, 80);
  EXPECT_EQ(counts.flipped_corrected + counts.flipped_removed + counts.good_flipped, 0);
  EXPECT_TRUE(std::isnan(counts.OutlierPrecision()));
  EXPECT_EQ(counts.OutlierRecall(), 0);
  EXPECT_EQ(counts.FlippedRecall(), 0);
}

TEST_F(CountFatesTest, GroundTruthAsDecisionsFindsEverything) {
  ForgetDecisions();
  const FateCounts before = Count();
  ForEachMarker([](server::BundleMarker& marker, const RowGroundTruth& row) {
    marker.used = !row.is_outlier[static_cast<size_t>(marker.marker)];
    if (row.flipped) marker.marker = 2 - marker.marker;
  });
  const FateCounts counts = Count();
  EXPECT_EQ(counts.outlier_removed, before.outlier_kept);
  EXPECT_EQ(counts.good_kept, before.good_kept);
  EXPECT_EQ(counts.flipped_corrected, before.flipped_kept);
  EXPECT_EQ(counts.outlier_kept + counts.good_removed + counts.flipped_kept +
                counts.flipped_removed + counts.good_flipped,
            0);
}

TEST_F(CountFatesTest, RemovingFlippedRowsIsNoFalseAlarmButFlippingGoodOnesIs) {
  ForgetDecisions();
  const FateCounts before = Count();
  ForEachMarker([](server::BundleMarker& marker, const RowGroundTruth& row) {
    if (row.is_outlier[static_cast<size_t>(marker.marker)]) return;
    if (row.flipped) {
      marker.used = false;
    } else {
      marker.marker = 2 - marker.marker;
    }
  });
  const FateCounts counts = Count();
  EXPECT_EQ(counts.good_removed, 0);
  EXPECT_EQ(counts.flipped_removed, before.flipped_kept);
  EXPECT_GT(counts.good_flipped, 500);
}

TEST_F(CountFatesTest, RemovingEverythingHasRecallWithoutPrecision) {
  ForgetDecisions();
  const FateCounts before = Count();
  for (server::BundleMarker& marker : solution_.built.problem.markers) marker.used = false;
  FateCounts counts = Count();
  EXPECT_EQ(counts.OutlierRecall(), 1);
  EXPECT_LT(counts.OutlierPrecision(), 0.15);
  counts += before;
  EXPECT_EQ(counts.OutlierRecall(), 0.5);
}

TEST_F(CountFatesTest, UnusedInstantsDoNotCount) {
  for (server::BundleInstant& instant : solution_.built.problem.instants) instant.used = false;
  const FateCounts counts = Count();
  EXPECT_EQ(counts.outlier_kept + counts.outlier_removed + counts.good_kept + counts.good_removed,
            0);
}

}  // namespace
}  // namespace rigcal::accuracy::marker_fates_test
