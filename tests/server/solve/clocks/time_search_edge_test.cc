// SPDX-License-Identifier: Apache-2.0
// Several sessions, gaps, dropouts, a wand that stands still, and times that coincide.
#include <gtest/gtest.h>

#include <cmath>

#include "server/associate/clean_track.h"
#include "server/solve/clocks/epipolar_score.h"
#include "server/solve/clocks/time_search.h"
#include "tests/server/solve/simulated_input.h"
#include "tests/testing/simulation_text.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::time_search_edge_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::ParseSimulationOptions;

CalibrationInput Input(const std::string& options, const std::string& session = "s") {
  const auto world = SimulatedWorld::Create(*ParseSimulationOptions(options), WandTarget());
  EXPECT_THAT(world, IsOk());
  CalibrationInput input = InputOf(*world);
  for (CameraTrack& track : input.tracks) track.session_id = session;
  return input;
}

double ScorePx(const RigObservations& rig, double offset_s) {
  const auto times = CoarseRigTimes(rig.tracks);
  const auto paths = [&](size_t t) {
    return PathsOf(rig.tracks[t], times[t], times[0].front(), rig.target.marker_count());
  };
  return EpipolarScorePx(paths(0), paths(1), offset_s, kMinEpipolarMatches);
}

TEST(SearchTimeOffsetsEdge, FindsThemThroughGapsAndDropouts) {
  std::vector<ClockCorrection> clocks;
  const RigObservations rig =
      RigOf(Input("cameras=3;duration=40;dropouts=0.2;gap_start=10;gap=8;offset.1=-0.3"), &clocks);
  ASSERT_THAT(SearchTimeOffsets(rig, 0, {}, &clocks), IsOk());
  EXPECT_NEAR(clocks[1].time_offset_s, -0.3, 0.01);
  EXPECT_EQ(clocks[0].time_offset_s, 0);
  EXPECT_EQ(clocks[2].time_offset_s, 0);
}

TEST(SearchTimeOffsetsEdge, FindsThemWhenTheWandIsFast) {
  std::vector<ClockCorrection> clocks;
  const RigObservations rig =
      RigOf(Input("cameras=3;duration=30;rate=50;wand_speed=4;offset.2=0.25"), &clocks);
  ASSERT_THAT(SearchTimeOffsets(rig, 0, {}, &clocks), IsOk());
  EXPECT_NEAR(clocks[2].time_offset_s, 0.25, 0.01);
}

TEST(SearchTimeOffsetsEdge, MovesAllButTheReferenceCamerasClock) {
  std::vector<ClockCorrection> clocks;
  const RigObservations rig = RigOf(Input("cameras=3;duration=30;offset.1=0.3"), &clocks);
  ASSERT_THAT(SearchTimeOffsets(rig, 1, {}, &clocks), IsOk());
  EXPECT_NEAR(clocks[0].time_offset_s, -0.3, 0.01);
  EXPECT_EQ(clocks[1].time_offset_s, 0);
  EXPECT_NEAR(clocks[2].time_offset_s, -0.3, 0.01);
}

TEST(SearchTimeOffsetsEdge, GoesOnFromWhatIsAlreadyKnown) {
  std::vector<ClockCorrection> clocks;
  const RigObservations rig = RigOf(Input("cameras=2;duration=30;offset.1=1.6"), &clocks);
  clocks[1].time_offset_s = 1.0;
  ASSERT_THAT(SearchTimeOffsets(rig, 0, {}, &clocks), IsOk());
  EXPECT_NEAR(clocks[1].time_offset_s, 1.6, 0.01);
}

TEST(SearchTimeOffsetsEdge, FindsAClockThatIsSecondsOffUnlessToldToStayNearby) {
  std::vector<ClockCorrection> clocks;
  const RigObservations rig = RigOf(Input("cameras=2;duration=30;offset.1=3.5"), &clocks);
  ASSERT_THAT(SearchTimeOffsets(rig, 0, {{}, nullptr, true}, &clocks), IsOk());
  EXPECT_EQ(clocks[1].time_offset_s, 0);
  TimeSearchOutcome outcome;
  ASSERT_THAT(SearchTimeOffsets(rig, 0, {}, &clocks, &outcome), IsOk());
  EXPECT_NEAR(clocks[1].time_offset_s, 3.5, 0.004);
  ASSERT_EQ(outcome.by_motion.size(), 1u);
  EXPECT_EQ(outcome.by_motion[0].track, 1);
  EXPECT_TRUE(outcome.ambiguous.empty());
  EXPECT_EQ(outcome.period_s, 0);
}

TEST(SearchTimeOffsetsEdge, LooksAtEachSessionByItself) {
  CalibrationInput input = Input("seed=1;cameras=2;duration=30;offset.1=0.3", "one");
  const CalibrationInput other = Input("seed=2;cameras=2;duration=30;offset.1=-0.4", "two");
  input.tracks.insert(input.tracks.end(), other.tracks.begin(), other.tracks.end());
  std::vector<ClockCorrection> clocks;
  const RigObservations rig = RigOf(input, &clocks);
  ASSERT_EQ(clocks.size(), 4u);
  ASSERT_THAT(SearchTimeOffsets(rig, 0, {}, &clocks), IsOk());
  EXPECT_EQ(clocks[0].time_offset_s, 0);
  EXPECT_NEAR(clocks[1].time_offset_s, 0.3, 0.01);
  EXPECT_EQ(clocks[2].time_offset_s, 0);
  EXPECT_NEAR(clocks[3].time_offset_s, -0.4, 0.01);
}

TEST(SearchTimeOffsetsEdge, TooLittleSeenFindsNothing) {
  std::vector<ClockCorrection> clocks;
  const RigObservations rig = RigOf(Input("cameras=2;duration=0.4;offset.1=0.1"), &clocks);
  ASSERT_THAT(SearchTimeOffsets(rig, 0, {}, &clocks), IsOk());
  EXPECT_EQ(clocks[1].time_offset_s, 0);
  EXPECT_TRUE(std::isinf(ScorePx(rig, 0.1)));
}

TEST(SearchTimeOffsetsEdge, OfNoCamerasOrOneHasNothingToDo) {
  std::vector<ClockCorrection> clocks;
  EXPECT_THAT(SearchTimeOffsets({}, 0, {}, &clocks), IsOk());
  CalibrationInput input = Input("cameras=2;duration=10");
  input.tracks.resize(1);
  const RigObservations rig = RigOf(input, &clocks);
  EXPECT_THAT(SearchTimeOffsets(rig, 0, {}, &clocks), IsOk());
  EXPECT_EQ(clocks[0].time_offset_s, 0);
}

// A wand at rest looks the same at every offset: none may be claimed.
TEST(SearchTimeOffsetsEdge, AWandThatStandsStillTellsNothing) {
  CalibrationInput input = Input("cameras=2;duration=20;dropouts=0;outliers=0;offset.1=0.2");
  for (CameraTrack& track : input.tracks) {
    const auto seen = std::find_if(track.observations.begin(), track.observations.end(),
                                   [](const Observation& row) { return row.VisibleCount() == 3; });
    ASSERT_NE(seen, track.observations.end());
    const auto markers = seen->markers;
    for (Observation& row : track.observations) row.markers = markers;
  }
  std::vector<ClockCorrection> clocks;
  const RigObservations rig = RigOf(input, &clocks);
  ASSERT_THAT(SearchTimeOffsets(rig, 0, {}, &clocks), IsOk());
  EXPECT_EQ(clocks[1].time_offset_s, 0);
}

// Two rows of a marker that carry times of their own may meet at one.
TEST(SearchTimeOffsetsEdge, RowsAtOneTimeDoNotSpoilTheScore) {
  CalibrationInput input = Input("cameras=2;duration=30;dropouts=0;outliers=0;offset.1=0.3");
  std::vector<Observation>& rows = input.tracks[1].observations;
  for (size_t i = 10; i + 1 < rows.size(); i += 50) {
    for (size_t m = 0; m < rows[i].markers.size() && m < rows[i + 1].markers.size(); ++m) {
      rows[i].markers[m].time_delta_ns =
          static_cast<int32_t>(rows[i + 1].time_ns - rows[i].time_ns);
      rows[i].markers[m].centre_px = rows[i + 1].markers[m].centre_px;
    }
  }
  std::vector<ClockCorrection> clocks;
  const RigObservations rig = RigOf(input, &clocks);
  EXPECT_LT(ScorePx(rig, 0.3), 2);
  ASSERT_THAT(SearchTimeOffsets(rig, 0, {}, &clocks), IsOk());
  EXPECT_NEAR(clocks[1].time_offset_s, 0.3, 0.01);
}

}  // namespace
}  // namespace rigcal::server::time_search_edge_test
