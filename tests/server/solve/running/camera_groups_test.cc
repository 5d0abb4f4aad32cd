// SPDX-License-Identifier: Apache-2.0
#include "server/solve/running/camera_groups.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

#include "tests/server/solve/simulated_input.h"
#include "tests/testing/simulation_text.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::camera_groups_test {
namespace {

using ::rigcal::testing::ParseSimulationOptions;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::SizeIs;

// Groups of five cameras that see the wand in the first half, or in the second half from
// `second_begin` on.
CameraGroups GroupsOf(const std::vector<bool>& first_half, size_t second_begin) {
  auto world =
      SimulatedWorld::Create(*ParseSimulationOptions("cameras=5;rate=50;duration=8"), WandTarget());
  CalibrationInput input = InputOf(*world);
  for (size_t c = 0; c < first_half.size(); ++c) {
    std::vector<Observation>& rows = input.tracks[c].observations;
    for (size_t i = 0; i < rows.size(); ++i) {
      if (first_half[c] ? i < 200 : i >= second_begin) continue;
      for (MarkerObservation& marker : rows[i].markers) marker.visible = false;
    }
  }
  std::vector<ClockCorrection> clocks;
  const RigObservations rig = RigOf(input, &clocks);
  return GroupCameras(rig.index, rig.tracks, RigTimes(rig.tracks, rig.index, clocks));
}

TEST(CameraGroups, JoinWhatSeesTheWandAtOnce) {
  const CameraGroups groups = GroupsOf({true, true, true, true, true}, 200);
  EXPECT_THAT(groups.group_of_camera, ElementsAre(0, 0, 0, 0, 0));
  EXPECT_THAT(groups.needs, IsEmpty());
}

TEST(CameraGroups, TheLargestIsChosenAndTheNeedOfTheOthersNamed) {
  const CameraGroups groups = GroupsOf({false, false, true, true, true}, 190);
  EXPECT_THAT(groups.group_of_camera, ElementsAre(0, 0, 2, 2, 2));
  EXPECT_EQ(groups.largest, 2);
  // One pair, that with most instants in common, is enough to connect the two.
  ASSERT_THAT(groups.needs, SizeIs(1));
  EXPECT_THAT(groups.needs[0].camera_a, ::testing::AnyOf("sim_0", "sim_1"));
  EXPECT_THAT(groups.needs[0].camera_b, ::testing::AnyOf("sim_2", "sim_3", "sim_4"));
  EXPECT_GT(groups.needs[0].common_count, 0);
  EXPECT_LE(groups.needs[0].common_count, 10);
  EXPECT_EQ(groups.needs[0].needed_count, 40);
}

}  // namespace
}  // namespace rigcal::server::camera_groups_test
