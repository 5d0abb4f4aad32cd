// SPDX-License-Identifier: Apache-2.0
// The whole solve of sessions with different targets.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "server/solve/calibrate.h"
#include "tests/server/solve/simulated_input.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::mixed_targets_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Ne;
using ::testing::SizeIs;

struct Solved {
  CalibrationOutcome outcome;
  PoseErrors errors;
};

// One session for each target, of the same rig.
Solved Solve(std::string_view simulation, const std::vector<Target>& targets,
             const CalibrationOptions& options) {
  const std::vector<SimulatedWorld> worlds = WorldsOf(simulation, targets);
  Solved solved{Calibrate(MixedInputOf(worlds), options), {}};
  EXPECT_THAT(solved.outcome.result, IsOk());
  if (solved.outcome.result.ok()) {
    solved.errors = ComparePoses(*solved.outcome.result, worlds.front());
  }
  return solved;
}

void ExpectGoodFit(const CalibrationResult& result) {
  EXPECT_EQ(result.solver_path, SolverPath::kGeneral);
  EXPECT_TRUE(result.scale_known);
  for (const CalibratedCamera& camera : result.cameras) {
    EXPECT_LT(camera.residuals.inlier.rms_px, 0.6) << camera.camera;
    ASSERT_TRUE(camera.held_out);
    ASSERT_TRUE(camera.leave_one_out);
    EXPECT_LT(camera.leave_one_out->mean_px, 0.8);
    ASSERT_TRUE(camera.uncertainty);
    if (camera.camera == result.reference_camera) continue;
    EXPECT_GT(camera.uncertainty->position_sigma_m.minCoeff(), 0);
    EXPECT_LT(camera.uncertainty->position_sigma_m.maxCoeff(), 0.01);
  }
}

TEST(MixedTargets, WandAndBody) {
  CalibrationOptions options;
  options.intrinsics = Estimate::kFixed;
  const auto [outcome, errors] = Solve("cameras=4;duration=24;rate=10;offset.1=0.004",
                                       {WandTarget(), BodyTarget(0.0002)}, options);
  ASSERT_THAT(outcome.result, IsOk());
  const CalibrationResult& result = *outcome.result;
  ExpectGoodFit(result);
  EXPECT_THAT(result.quality.grade, Ne(QualityGrade::kBad));
  EXPECT_LT(errors.worst_position_m, 0.004);
  EXPECT_LT(errors.worst_rotation_rad, 0.002);
  EXPECT_EQ(result.target.given, WandTarget());
  EXPECT_THAT(result.target.session_ids, ElementsAre("s0"));
  EXPECT_THAT(result.target.spans, SizeIs(2));
  for (const SpanError& span : result.target.spans) EXPECT_GT(span.count, 20u);
  ASSERT_THAT(result.other_targets, SizeIs(1));
  const CalibratedTarget& body = result.other_targets.front();
  EXPECT_EQ(body.given, BodyTarget(0.0002));
  EXPECT_THAT(body.session_ids, ElementsAre("s1"));
  EXPECT_THAT(body.spans, IsEmpty());
  // The body's points are known better than the wand's spans.
  EXPECT_EQ(body.scale_sigma_rel, result.target.scale_sigma_rel);
  EXPECT_LT(body.scale_sigma_rel, 0.001);
  EXPECT_GT(body.scale_sigma_rel, 0.0001);
}

TEST(MixedTargets, WandAndPlane) {
  CalibrationOptions options;
  options.intrinsics = options.time_offsets = Estimate::kFixed;
  const auto [outcome, errors] =
      Solve("cameras=3;duration=16;rate=6;seed=3", {PlaneTarget(0), WandTarget()}, options);
  ASSERT_THAT(outcome.result, IsOk());
  ExpectGoodFit(*outcome.result);
  EXPECT_LT(errors.worst_position_m, 0.003);
  // The wand first, whichever session came first.
  EXPECT_EQ(outcome.result->target.given, WandTarget());
  EXPECT_TRUE(outcome.result->target.marker_positions_estimated);
  ASSERT_THAT(outcome.result->other_targets, SizeIs(1));
  EXPECT_EQ(outcome.result->other_targets.front().given, PlaneTarget(0));
  EXPECT_EQ(outcome.result->target.scale_sigma_rel, 0);  // the plane is exact
}

TEST(MixedTargets, PointWithoutLengthsTakesTheScaleOfTheWand) {
  CalibrationOptions options;
  options.intrinsics = options.time_offsets = Estimate::kFixed;
  const auto [outcome, errors] =
      Solve("cameras=4;duration=24;rate=10", {PointTarget(), WandTarget()}, options);
  ASSERT_THAT(outcome.result, IsOk());
  ExpectGoodFit(*outcome.result);
  EXPECT_LT(errors.worst_position_m, 0.02);  // the scale: 0.4 % of a few metres
  EXPECT_GT(outcome.result->target.scale_sigma_rel, 0.001);
}

TEST(MixedTargets, TwoBodiesAndAPoint) {
  CalibrationOptions options;
  options.intrinsics = options.time_offsets = Estimate::kFixed;
  const auto [outcome, errors] = Solve(
      "cameras=3;duration=18;rate=8", {BodyTarget(0), PlaneTarget(0.0005), PointTarget()}, options);
  ASSERT_THAT(outcome.result, IsOk());
  ExpectGoodFit(*outcome.result);
  EXPECT_LT(errors.worst_position_m, 0.003);
  EXPECT_THAT(outcome.result->other_targets, SizeIs(2));
}

// A camera that sees one target alone is joined by that one; labels of the wand that are counted
// from its other end are turned.
TEST(MixedTargets, EachTargetJoinsCamerasAndLabelsOfTheWandAreTurned) {
  const std::string simulation = "cameras=4;duration=24;rate=10;swaps=0.05";
  const SimulatedWorld wand = WorldOf(simulation, WandTarget());
  const SimulatedWorld body = WorldOf(simulation, BodyTarget(0));
  CalibrationInput input = MixedInputOf({wand, body});
  std::erase_if(input.tracks, [](const CameraTrack& track) {
    return (track.session_id == "s0" && track.camera.camera == "sim_3") ||
           (track.session_id == "s1" && track.camera.camera == "sim_1");
  });
  CalibrationOptions options;
  options.intrinsics = options.time_offsets = Estimate::kFixed;
  const CalibrationOutcome outcome = Calibrate(std::move(input), options);
  ASSERT_THAT(outcome.result, IsOk());
  ASSERT_THAT(outcome.result->cameras, SizeIs(4));
  EXPECT_LT(ComparePoses(*outcome.result, wand).worst_position_m, 0.004);
  EXPECT_TRUE(std::ranges::any_of(outcome.refused, [](const Refusal& refusal) {
    return refusal.reason == RefusalReason::kLabelsFlipped;
  }));
}

// The body is exact, so the wand is what was measured wrongly; the rig keeps the body's scale.
TEST(MixedTargets, AWandOfAnotherScaleIsNamed) {
  const std::string simulation = "cameras=3;duration=18;rate=8";
  const SimulatedWorld wand = WorldOf(simulation, WandTarget());
  const SimulatedWorld body = WorldOf(simulation, BodyTarget(0));
  CalibrationInput input = MixedInputOf({body, wand});
  for (double& position_m : input.other_targets["s1"].marker_positions_m) position_m *= 1.04;
  CalibrationOptions options;
  options.intrinsics = options.time_offsets = Estimate::kFixed;
  const CalibrationOutcome outcome = Calibrate(std::move(input), options);
  ASSERT_THAT(outcome.result, IsOk());
  const auto found =
      std::ranges::find(outcome.result->findings, FindingKind::kWrongWandLength, &Finding::kind);
  ASSERT_NE(found, outcome.result->findings.end());
  EXPECT_THAT(found->advice, HasSubstr("contradict each other"));
  EXPECT_NEAR(found->value, -10.4, 1.5);  // mm, of the span of 260
  EXPECT_NEAR(outcome.result->target.marker_positions_m.back(), 0.39, 0.002);
  EXPECT_LT(ComparePoses(*outcome.result, wand).worst_position_m, 0.003);
}

Target LongWand() {
  Target target;
  target.marker_positions_m = {0, 0.21, 0.33, 0.6};
  target.span_tolerance_m = 0.001;
  return target;
}

TEST(MixedTargets, TwoWandsOfOtherSpacingAndNumberOfMarkers) {
  CalibrationOptions options;
  options.intrinsics = Estimate::kFixed;
  const auto [outcome, errors] = Solve("cameras=4;duration=24;rate=10;offset.1=0.004;swaps=0.05",
                                       {WandTarget(), LongWand()}, options);
  ASSERT_THAT(outcome.result, IsOk());
  const CalibrationResult& result = *outcome.result;
  ExpectGoodFit(result);
  EXPECT_THAT(result.quality.grade, Ne(QualityGrade::kBad));
  EXPECT_LT(errors.worst_position_m, 0.006);
  EXPECT_EQ(result.target.given, WandTarget());
  EXPECT_THAT(result.target.marker_positions_m, SizeIs(3));
  EXPECT_THAT(result.target.marker_position_sigma_m, SizeIs(3));
  EXPECT_THAT(result.target.spans, SizeIs(2));
  ASSERT_THAT(result.other_targets, SizeIs(1));
  const CalibratedTarget& other = result.other_targets.front();
  EXPECT_EQ(other.given, LongWand());
  EXPECT_THAT(other.session_ids, ElementsAre("s1"));
  ASSERT_THAT(other.marker_positions_m, SizeIs(4));
  EXPECT_EQ(other.marker_positions_m.front(), 0);
  EXPECT_NEAR(other.marker_positions_m.back(), 0.6, 0.003);
  ASSERT_THAT(other.spans, SizeIs(3));
  for (const SpanError& span : other.spans) EXPECT_GT(span.count, 20u);
  EXPECT_NEAR(other.spans[1].length_m, 0.12, 0.001);
  EXPECT_LT(other.marker_position_sigma_m.front(), 1e-5);
  EXPECT_GT(other.marker_position_sigma_m.back(), 1e-4);
  // Of the longer one with the smaller tolerance, and a little better.
  EXPECT_LT(result.target.scale_sigma_rel, 0.0029);
  EXPECT_GT(result.target.scale_sigma_rel, 0.0015);
  const auto flipped =
      std::ranges::count(outcome.refused, RefusalReason::kLabelsFlipped, &Refusal::reason);
  EXPECT_EQ(flipped, 4);  // in every camera
}

TEST(MixedTargets, TwoWandsAndAPoint) {
  CalibrationOptions options;
  options.intrinsics = options.time_offsets = Estimate::kFixed;
  const auto [outcome, errors] =
      Solve("cameras=4;duration=24;rate=10", {PointTarget(), WandTarget(), LongWand()}, options);
  ASSERT_THAT(outcome.result, IsOk());
  ExpectGoodFit(*outcome.result);
  EXPECT_LT(errors.worst_position_m, 0.01);
  EXPECT_THAT(outcome.result->other_targets, SizeIs(2));
}

// Nobody knows which of two wands is wrong, only that they do not go together.
TEST(MixedTargets, AWandOfAnotherScaleThanTheOtherIsNamed) {
  const std::string simulation = "cameras=3;duration=18;rate=8";
  CalibrationInput input = MixedInputOf(WorldsOf(simulation, {LongWand(), WandTarget()}));
  for (double& position_m : input.other_targets["s1"].marker_positions_m) position_m *= 1.06;
  CalibrationOptions options;
  options.intrinsics = options.time_offsets = Estimate::kFixed;
  const CalibrationOutcome outcome = Calibrate(std::move(input), options);
  ASSERT_THAT(outcome.result, IsOk());
  const auto found =
      std::ranges::find(outcome.result->findings, FindingKind::kWrongWandLength, &Finding::kind);
  ASSERT_NE(found, outcome.result->findings.end());
  EXPECT_THAT(found->advice, AllOf(HasSubstr("wand 2 and the other wand contradict each other")));
}

TEST(MixedTargets, RefusesMoreWandsThanCanBeJoined) {
  CalibrationInput input;
  for (int w = 0; w < 3; ++w) {
    Target wand;
    for (int m = 0; m < 12; ++m) wand.marker_positions_m.push_back((0.1 + 0.01 * w) * m);
    if (w == 0) input.target = wand;
    if (w > 0) input.other_targets["s" + std::to_string(w)] = wand;
  }
  EXPECT_THAT(Calibrate(std::move(input), {}).result,
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("36 markers together")));
}

TEST(MixedTargets, RefusesADistanceBesideLengths) {
  CalibrationInput input;
  input.target = PointTarget();
  input.other_targets["s1"] = WandTarget();
  CalibrationOptions options;
  options.known_distance = KnownDistance{"sim_0", "sim_1", 3, 0};
  EXPECT_THAT(Calibrate(std::move(input), options).result,
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("distance")));
}

}  // namespace
}  // namespace rigcal::server::mixed_targets_test
