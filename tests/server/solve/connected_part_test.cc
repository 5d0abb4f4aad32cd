// SPDX-License-Identifier: Apache-2.0
#include "server/solve/connected_part.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <string>
#include <vector>

#include "server/solve/initialize/overlap_graph.h"
#include "tests/server/solve/simulated_input.h"
#include "tests/testing/simulation_text.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::connected_part_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::ParseSimulationOptions;
using ::rigcal::testing::StatusIs;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

SimulatedWorld World(const std::string& options) {
  const auto parsed = ParseSimulationOptions(options);
  EXPECT_THAT(parsed, IsOk());
  auto world = SimulatedWorld::Create(*parsed, WandTarget());
  EXPECT_THAT(world, IsOk());
  return *std::move(world);
}

// The wand is waved before one group of cameras after the other: no two groups share an instant.
CalibrationInput InGroups(const SimulatedWorld& world,
                          const std::vector<std::vector<size_t>>& groups) {
  CalibrationInput input = InputOf(world);
  for (size_t g = 0; g < groups.size(); ++g) {
    for (const size_t c : groups[g]) {
      std::vector<Observation>& rows = input.tracks[c].observations;
      for (size_t i = 0; i < rows.size(); ++i) {
        if (i * groups.size() / rows.size() == g) continue;
        for (MarkerObservation& marker : rows[i].markers) marker.visible = false;
      }
    }
  }
  return input;
}

std::vector<std::string> CamerasOf(const CalibrationResult& result) {
  std::vector<std::string> names;
  for (const CalibratedCamera& camera : result.cameras) names.push_back(camera.camera);
  return names;
}

// By camera that was left out.
std::vector<Finding> LeftOut(const CalibrationResult& result) {
  const std::vector<std::string> calibrated = CamerasOf(result);
  std::vector<Finding> findings;
  for (const Finding& finding : result.findings) {
    if (finding.kind == FindingKind::kWeakLink &&
        std::ranges::count(calibrated, finding.camera) == 0) {
      findings.push_back(finding);
    }
  }
  std::ranges::sort(findings, {}, &Finding::camera);
  return findings;
}

std::vector<std::string> NamesOf(const std::vector<Finding>& findings) {
  std::vector<std::string> names;
  for (const Finding& finding : findings) names.push_back(finding.camera);
  return names;
}

TEST(ConnectedPart, OfTwoHallsThatWithTheReferenceCameraIsCalibrated) {
  const SimulatedWorld world = World("cameras=8;duration=60");
  const CalibrationOutcome outcome = Calibrate(InGroups(world, {{0, 1, 2, 3}, {4, 5, 6, 7}}), {});
  ASSERT_THAT(outcome.result, IsOk());
  EXPECT_THAT(CamerasOf(*outcome.result), ElementsAre("sim_0", "sim_1", "sim_2", "sim_3"));
  EXPECT_EQ(outcome.result->reference_camera, "sim_0");
  EXPECT_LT(ComparePoses(*outcome.result, world).worst_position_m, 0.005);
  const std::vector<Finding> left_out = LeftOut(*outcome.result);
  ASSERT_THAT(NamesOf(left_out), ElementsAre("sim_4", "sim_5", "sim_6", "sim_7"));
  for (const Finding& finding : left_out) {
    EXPECT_THAT(finding.advice, AllOf(HasSubstr("4 of 8 cameras"), HasSubstr("wave the wand where"),
                                      HasSubstr("(sim_4, sim_5, sim_6, sim_7)")));
    EXPECT_EQ(finding.severity, FindingSeverity::kWarning);
  }
  EXPECT_NE(outcome.result->quality.grade, QualityGrade::kGood);
  EXPECT_THAT(outcome.result->quality.reasons, Contains(HasSubstr("only 4 of 8 cameras")));
  // Every view of the other hall is counted as left out.
  for (const std::string& name : NamesOf(left_out)) {
    EXPECT_THAT(outcome.refused,
                Contains(AllOf(::testing::Field(&Refusal::camera, name),
                               ::testing::Field(&Refusal::example, HasSubstr("left out")))));
  }
}

TEST(ConnectedPart, TheLargestOneIsCalibratedUnlessAReferenceCameraIsAskedFor) {
  const SimulatedWorld world = World("cameras=8;duration=60");
  const CalibrationInput input = InGroups(world, {{0, 1, 2}, {3, 4, 5, 6, 7}});
  const CalibrationOutcome largest = Calibrate(input, {});
  ASSERT_THAT(largest.result, IsOk());
  EXPECT_THAT(CamerasOf(*largest.result), ElementsAre("sim_3", "sim_4", "sim_5", "sim_6", "sim_7"));
  EXPECT_EQ(largest.result->reference_camera, "sim_3");
  EXPECT_TRUE(largest.result->cameras[0].cam_from_rig.translation_m.isZero());
  EXPECT_THAT(NamesOf(LeftOut(*largest.result)), ElementsAre("sim_0", "sim_1", "sim_2"));

  CalibrationOptions options;
  options.reference_camera = "sim_1";
  const CalibrationOutcome asked = Calibrate(input, options);
  ASSERT_THAT(asked.result, IsOk());
  EXPECT_THAT(CamerasOf(*asked.result), ElementsAre("sim_0", "sim_1", "sim_2"));
  EXPECT_EQ(asked.result->reference_camera, "sim_1");
  EXPECT_THAT(asked.result->quality.reasons, Contains(HasSubstr("only 3 of 8 cameras")));
}

TEST(ConnectedPart, OfThreeGroupsEachIsToldWhatIsNearestToTheCalibratedOne) {
  const SimulatedWorld world = World("cameras=8;duration=60");
  const CalibrationOutcome outcome = Calibrate(InGroups(world, {{0, 1, 2, 3}, {4, 5}, {6, 7}}), {});
  ASSERT_THAT(outcome.result, IsOk());
  EXPECT_THAT(CamerasOf(*outcome.result), ElementsAre("sim_0", "sim_1", "sim_2", "sim_3"));
  const std::vector<Finding> left_out = LeftOut(*outcome.result);
  ASSERT_THAT(NamesOf(left_out), ElementsAre("sim_4", "sim_5", "sim_6", "sim_7"));
  EXPECT_THAT(left_out[0].advice, AllOf(HasSubstr("(sim_4, sim_5)"), Not(HasSubstr("sim_6"))));
  EXPECT_THAT(left_out[3].advice, AllOf(HasSubstr("(sim_6, sim_7)"), Not(HasSubstr("sim_4"))));
}

TEST(ConnectedPart, OneCameraThatSharesNothingIsLeftOut) {
  const SimulatedWorld world = World("cameras=5;duration=60");
  const CalibrationOutcome outcome = Calibrate(InGroups(world, {{0, 1, 2, 4}, {3}}), {});
  ASSERT_THAT(outcome.result, IsOk());
  EXPECT_THAT(CamerasOf(*outcome.result), ElementsAre("sim_0", "sim_1", "sim_2", "sim_4"));
  ASSERT_THAT(NamesOf(LeftOut(*outcome.result)), ElementsAre("sim_3"));
  EXPECT_THAT(LeftOut(*outcome.result)[0].advice, HasSubstr("wave the wand where"));
}

TEST(ConnectedPart, GroupsOfTwoAreRefused) {
  const SimulatedWorld world = World("cameras=4;duration=40");
  EXPECT_THAT(Calibrate(InGroups(world, {{0, 1}, {2, 3}}), {}).result,
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("not connected")));
}

class FindConnectedPartTest : public ::testing::Test {
 protected:
  FindConnectedPartTest() {
    OverlapGraph graph;
    for (int c = 0; c < 7; ++c) {
      graph.cameras.push_back("cam_" + std::to_string(c));
      index_.cameras.emplace_back().camera = graph.cameras.back();
    }
    graph.view_counts.assign(7, 100);
    graph.shared_counts.assign(7, std::vector<int>(7, 0));
    for (const auto& [a, b] : {std::pair(0, 1), {1, 2}, {3, 4}, {4, 5}, {5, 6}}) {
      graph.shared_counts[a][b] = graph.shared_counts[b][a] = 50;
    }
    graph.shared_counts[2][6] = graph.shared_counts[6][2] = 3;
    const auto estimate = [](int, int) -> absl::StatusOr<std::optional<RelativePose>> {
      RelativePose pose;
      pose.inlier_count = pose.instant_count = 50;
      return pose;
    };
    failed_ = FindSpanningTree(graph, estimate).status();
    options_.reference_camera = "cam_0";
  }

  absl::Status failed_;
  RigIndex index_;
  CalibrationOptions options_;
};

TEST_F(FindConnectedPartTest, NamesTheNearestPair) {
  const auto part = FindConnectedPart(failed_, index_, options_, false);
  ASSERT_TRUE(part);
  EXPECT_EQ(part->reference_camera, "cam_3");
  EXPECT_THAT(part->left_out, ElementsAre("cam_0", "cam_1", "cam_2"));
  EXPECT_THAT(part->findings[0].advice,
              HasSubstr("cam_2 and cam_6 are nearest to it, with 3 wand views"));
}

TEST_F(FindConnectedPartTest, WhatTheOptionsNameIsNotLeftOut) {
  options_.known_distance = KnownDistance{"cam_1", "cam_4", 2, 0.001};
  EXPECT_FALSE(FindConnectedPart(failed_, index_, options_, false));
  options_.known_distance = KnownDistance{"cam_3", "cam_4", 2, 0.001};
  EXPECT_TRUE(FindConnectedPart(failed_, index_, options_, false));
  EXPECT_FALSE(FindConnectedPart(failed_, index_, options_, true));
}

TEST_F(FindConnectedPartTest, OtherErrorsHaveNone) {
  EXPECT_FALSE(FindConnectedPart(absl::FailedPreconditionError(std::string(failed_.message())),
                                 index_, options_, false));
  EXPECT_FALSE(FindConnectedPart(WithoutGroups(failed_), index_, options_, false));
}

}  // namespace
}  // namespace rigcal::server::connected_part_test
