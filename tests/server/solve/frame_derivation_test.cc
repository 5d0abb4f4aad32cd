// SPDX-License-Identifier: Apache-2.0
// Frames and scales of a calibration, and what a later solve keeps of them.
#include "server/solve/frame_derivation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "common/calibration/camera_covariance.h"
#include "server/solve/evaluate/rig_difference.h"
#include "server/solve/kept_frame.h"
#include "tests/server/solve/simulated_input.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::frame_derivation_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr double kRateHz = 20;

SimulatedWorld World() {
  SimulationOptions options;
  options.camera_count = 4;
  options.duration_s = 50;
  options.rate_hz = kRateHz;
  Target target;
  target.marker_positions_m = {0, 0.13, 0.39};
  return *SimulatedWorld::Create(options, target);
}

CalibrationInput Part(const SimulatedWorld& world, double from_s, double to_s) {
  CalibrationInput input = InputOf(world);
  for (CameraTrack& track : input.tracks) {
    const auto begin = track.observations.begin();
    track.observations = {begin + static_cast<std::ptrdiff_t>(from_s * kRateHz),
                          begin + static_cast<std::ptrdiff_t>(to_s * kRateHz)};
  }
  return input;
}

// The wand lies on z = 0 of the world, a second at each place.
CalibrationInput Floor(const SimulatedWorld& world, int places) {
  CalibrationInput input = InputOf(world);
  for (size_t c = 0; c < input.tracks.size(); ++c) {
    std::vector<Observation> rows;
    int frame = world.FrameCount(static_cast<int>(c));
    for (int place = 0; place < places; ++place) {
      const double angle = 2.2 * place;
      const WandPose pose{Eigen::Vector3d(std::cos(angle), std::sin(angle), 0),
                          Eigen::Vector3d(std::cos(angle + 1), std::sin(angle + 1), 0)};
      for (int i = 0; i < kRateHz; ++i) {
        rows.push_back(world.ObserveWand(static_cast<int>(c), frame++, pose));
      }
    }
    input.tracks[c].observations = std::move(rows);
  }
  return input;
}

absl::StatusOr<CalibrationResult> Solve(CalibrationInput input,
                                        const CalibrationOptions& options = {}) {
  return Calibrate(std::move(input), options).result;
}

CalibrationOptions OriginOptionsOf(FrameSource source) {
  CalibrationOptions options;
  options.kind = SolveKind::kOrigin;
  options.parent_id = "c-000001";
  options.origin.emplace();
  options.origin->source = source;
  return options;
}

double HeightM(const CalibrationResult& result, const std::string& name) {
  const auto camera = std::ranges::find(result.cameras, name, &CalibratedCamera::camera);
  return camera->cam_from_rig.SourceFromTargetTranslation().z();
}

class FrameDerivation : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    world_ = new SimulatedWorld(World());
    parent_ = new CalibrationResult(*Solve(Part(*world_, 0, 20)));
    CalibrationInput input = Floor(*world_, 3);
    input.parent = *parent_;
    floor_ = new CalibrationResult(*Solve(std::move(input), OriginOptionsOf(FrameSource::kFloor)));
  }
  static void TearDownTestSuite() {
    delete floor_;
    delete parent_;
    delete world_;
  }
  // Heights of the cameras of the world, in which the floor is z = 0.
  static void ExpectTrueHeights(const CalibrationResult& result, double within_m) {
    for (const SimulatedCamera& camera : world_->cameras()) {
      EXPECT_NEAR(HeightM(result, camera.description.camera),
                  camera.cam_from_rig.SourceFromTargetTranslation().z(), within_m)
          << camera.description.camera;
    }
  }

  static const SimulatedWorld* world_;
  static const CalibrationResult *parent_, *floor_;
};
const SimulatedWorld* FrameDerivation::world_ = nullptr;
const CalibrationResult* FrameDerivation::parent_ = nullptr;
const CalibrationResult* FrameDerivation::floor_ = nullptr;

TEST_F(FrameDerivation, TheFloorOfASessionBecomesZeroOfZ) {
  ExpectTrueHeights(*floor_, 0.01);
  ASSERT_TRUE(floor_->frame.has_value());
  EXPECT_EQ(floor_->frame->source, FrameSource::kFloor);
  EXPECT_EQ(floor_->frame->calibration_id, "c-000001");
  EXPECT_EQ(floor_->frame->residuals.size(), 9u);
  EXPECT_EQ(floor_->reference_camera, "");
  EXPECT_NE(floor_->observation_digest, parent_->observation_digest);
  // No camera is exact any more.
  EXPECT_GT(floor_->cameras[0].uncertainty->position_sigma_m.minCoeff(), 0);
  ASSERT_TRUE(floor_->information.has_value());
  EXPECT_EQ(floor_->information->calibration_id, "c-000001");
}

TEST_F(FrameDerivation, RefusesWhatGivesNoFrame) {
  const auto refusal = [](CalibrationInput input, const CalibrationOptions& options) {
    input.parent = *parent_;
    return Solve(std::move(input), options).status();
  };
  EXPECT_THAT(refusal(Floor(*world_, 1), OriginOptionsOf(FrameSource::kFloor)),
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       AllOf(HasSubstr("on one line"), HasSubstr("mm along it"))));
  EXPECT_THAT(refusal(Part(*world_, 20, 25), OriginOptionsOf(FrameSource::kFloor)),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("rests nowhere")));
  EXPECT_THAT(refusal({}, OriginOptionsOf(FrameSource::kFloor)),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("name a session")));
  // Of a rig of which cameras have been exchanged: two, then all.
  CalibrationInput exchanged = Floor(*world_, 3);
  std::swap(exchanged.tracks[0].observations, exchanged.tracks[1].observations);
  EXPECT_THAT(refusal(exchanged, OriginOptionsOf(FrameSource::kFloor)),
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       HasSubstr("are the files of sim_0 and sim_1 exchanged")));
  std::swap(exchanged.tracks[2].observations, exchanged.tracks[3].observations);
  EXPECT_FALSE(refusal(exchanged, OriginOptionsOf(FrameSource::kFloor)).ok());
}

// A frame is made from the others; how many rows had no part in it is said.
TEST_F(FrameDerivation, RowsThatMissTheOthersAreCounted) {
  CalibrationInput input = Floor(*world_, 3);
  // A run of them: a single one that jumps is no part of its track. Across the epipolar lines, so
  // that two cameras alone tell, too.
  for (size_t i = 0; i < 12; ++i) {
    for (MarkerObservation& marker : input.tracks[2].observations[i].markers) {
      marker.centre_px.y() += 60;
    }
  }
  input.parent = *parent_;
  ASSERT_OK_AND_ASSIGN(const CalibrationResult result,
                       Solve(std::move(input), OriginOptionsOf(FrameSource::kFloor)));
  const auto counted = std::ranges::find(result.refused, std::string("sim_2"), &Refusal::camera);
  ASSERT_NE(counted, result.refused.end());
  EXPECT_EQ(counted->reason, RefusalReason::kOutlier);
  EXPECT_GE(counted->count, 10u);
  EXPECT_LE(counted->count, 13u);
  EXPECT_THAT(counted->example, HasSubstr("miss those of the other cameras"));
}

TEST_F(FrameDerivation, ARepairStaysInAFrameOfItsOwnWithItsUncertainty) {
  CalibrationInput input = Part(*world_, 20, 32);
  input.parent = *floor_;
  CalibrationOptions options;
  options.kind = SolveKind::kRepair;
  options.parent_id = "c-000002";
  options.only_cameras = {"sim_1"};
  ASSERT_OK_AND_ASSIGN(const CalibrationResult repaired, Solve(std::move(input), options));
  EXPECT_EQ(repaired.reference_camera, "");
  ASSERT_TRUE(repaired.frame.has_value());
  EXPECT_EQ(repaired.frame->source, FrameSource::kKept);
  const CameraCovariance before = UnpackCameraCovariance(*floor_);
  const CameraCovariance after = UnpackCameraCovariance(repaired);
  ASSERT_EQ(after.matrix.rows(), before.matrix.rows());
  for (size_t c = 0; c < repaired.cameras.size(); ++c) {
    if (repaired.cameras[c].camera == "sim_1") continue;
    EXPECT_EQ(repaired.cameras[c].cam_from_rig.translation_m,
              floor_->cameras[c].cam_from_rig.translation_m);
    const Eigen::Index row = before.cameras[c].first_row;
    const Eigen::MatrixXd was = before.matrix.block(row, row, 6, 6);
    EXPECT_LT((after.matrix.block(row, row, 6, 6) - was).norm(), 1e-6 * was.norm());
  }
  ExpectTrueHeights(repaired, 0.01);
  // As uncertain against the floor as its neighbours, and correlated with them: against each other
  // they are known better.
  const auto sigma_m = [&](size_t c) {
    return repaired.cameras[c].uncertainty->position_sigma_m.norm();
  };
  EXPECT_GT(sigma_m(1), 0.5 * sigma_m(0));
  EXPECT_LT(sigma_m(1), 3 * sigma_m(2) + 0.005);
}

TEST_F(FrameDerivation, ASolveAndARefinementEndInTheFrameOfTheParent) {
  for (const SolveKind kind : {SolveKind::kFull, SolveKind::kRefine}) {
    CalibrationInput input = Part(*world_, 20, 40);
    input.parent = *floor_;
    CalibrationOptions options;
    options.kind = kind;
    options.parent_id = "c-000002";
    if (kind == SolveKind::kFull) options.frame = FrameChoice::kKeep;
    ASSERT_OK_AND_ASSIGN(const CalibrationResult kept, Solve(std::move(input), options));
    ASSERT_TRUE(kept.frame.has_value());
    EXPECT_EQ(kept.frame->source, FrameSource::kKept);
    EXPECT_EQ(kept.frame->cameras.size(), 4u);
    ExpectTrueHeights(kept, 0.012);
    // What is not known of the floor is not known now.
    EXPECT_GT(kept.frame->rotation_sigma_rad.head<2>().norm(),
              0.5 * floor_->frame->rotation_sigma_rad.head<2>().norm());
    EXPECT_GT(kept.cameras[0].uncertainty->position_sigma_m.minCoeff(), 0);
  }
}

TEST_F(FrameDerivation, AFrameThatCannotBeKeptIsNoFrame) {
  CalibrationResult others = *floor_;
  for (CalibratedCamera& camera : others.cameras) camera.camera += "_other";
  CalibrationInput input = Part(*world_, 20, 32);
  input.parent = others;
  CalibrationOptions options;
  options.parent_id = "c-000002";
  options.frame = FrameChoice::kKeepIfPossible;
  ASSERT_OK_AND_ASSIGN(const CalibrationResult own, Solve(input, options));
  ASSERT_TRUE(own.frame.has_value());
  EXPECT_EQ(own.frame->source, FrameSource::kNotKept);
  EXPECT_THAT(own.frame->problem, HasSubstr("0 cameras in common"));
  EXPECT_EQ(own.reference_camera, "sim_0");
  options.frame = FrameChoice::kKeep;
  EXPECT_THAT(Solve(input, options).status(),
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       HasSubstr("the frame of calibration c-000002 is not kept")));
}

TEST_F(FrameDerivation, TheScaleIsThatOfAllSources) {
  const auto centre = [](size_t c) {
    return world_->cameras()[c].cam_from_rig.SourceFromTargetTranslation();
  };
  const double true_m = (centre(0) - centre(1)).norm();
  const auto scaled = [&](double share) {
    CalibrationInput input;
    input.parent = *floor_;
    CalibrationOptions options;
    options.kind = SolveKind::kScale;
    options.parent_id = "c-000002";
    options.scale.emplace();
    options.scale->distances.push_back({"sim_0", "sim_1", share * true_m, 0.002});
    return Solve(std::move(input), options);
  };
  ASSERT_OK_AND_ASSIGN(const CalibrationResult good, scaled(1));
  ASSERT_TRUE(good.scale.has_value());
  EXPECT_EQ(good.scale->sources.size(), 2u);
  EXPECT_LT(good.target.scale_sigma_rel, 0.5 * floor_->target.scale_sigma_rel);
  EXPECT_EQ(good.frame->source, FrameSource::kKept);
  EXPECT_THAT(scaled(1.03).status(),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("disagree")));
}

}  // namespace
}  // namespace rigcal::server::frame_derivation_test
