// SPDX-License-Identifier: Apache-2.0
// Two cameras that face each other across a board printed on both sides: no point of it is ever
// seen by both, so that nothing but the thickness of the board joins them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <random>
#include <string>

#include "common/board/board.h"
#include "common/camera/camera_model.h"
#include "server/solve/calibrate.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::two_sided_board_test {
namespace {

using ::rigcal::testing::IsOk;
using ::testing::HasSubstr;

constexpr char kCharuco[] = "board:charuco,10x7,0.06,0.045,5x5_100,two-sided=";
constexpr char kAprilGrid[] = "board:aprilgrid,5x4,0.08,0.3,two-sided=";
constexpr double kNoisePx = 0.1;
constexpr int kViews = 40;

CameraDescription Camera(const std::string& name) {
  CameraDescription camera;
  camera.camera = name;
  camera.image_size_px = {1280, 1024};
  camera.clock = {.clock_id = name, .timebase = "same"};
  camera.intrinsics = Intrinsics{.model = DistortionModel::kBrownConrady,
                                 .fx_px = 1000,
                                 .fy_px = 1001,
                                 .cx_px = 640,
                                 .cy_px = 510,
                                 .distortion = {-0.1, 0.02, 0, 0, 0}};
  return camera;
}

// Camera `far` sees from 3 m behind the board what `near` sees from before it.
RigidTransform FarFromNear() {
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(M_PI - 0.1, Eigen::Vector3d::UnitY()) *
                                Eigen::AngleAxisd(0.08, Eigen::Vector3d::UnitX()));
  return {turn, turn * -Eigen::Vector3d(0.3, -0.2, 3)};
}

// The front before camera `near`, tilted by up to 40 degrees about both of its axes.
RigidTransform NearFromBoard(const Board& board, int i) {
  const Eigen::Quaterniond turn(
      Eigen::AngleAxisd(0.5 * std::sin(0.13 * i), Eigen::Vector3d::UnitZ()) *
      Eigen::AngleAxisd(0.7 * std::sin(0.31 * i), Eigen::Vector3d::UnitY()) *
      Eigen::AngleAxisd(0.7 * std::sin(0.23 * i + 1), Eigen::Vector3d::UnitX()));
  const Eigen::Quaterniond upright = board.kind == BoardKind::kAprilGrid
                                         ? Eigen::Quaterniond(0, 1, 0, 0)  // its z looks back
                                         : Eigen::Quaterniond::Identity();
  const RigidTransform pose(turn * upright,
                            Eigen::Vector3d(0.3 * std::sin(0.17 * i), 0.25 * std::cos(0.11 * i),
                                            1.5 + 0.3 * std::sin(0.07 * i)));
  // About the middle of the board.
  const Eigen::Vector3d middle =
      0.5 * board.Points()[static_cast<size_t>(board.side_point_count() - 1)];
  return pose * RigidTransform(Eigen::Quaterniond::Identity(), -middle);
}

// What both cameras see of the board `real` if the session says `told`.
CalibrationInput InputOf(const std::string& real, const std::string& told) {
  const Board board = *ParseBoard(real);
  const auto points = board.Points();
  CalibrationInput input;
  input.target = *ParseTarget(told);
  std::mt19937 random(17);
  std::normal_distribution<double> noise(0, kNoisePx);
  for (const bool is_far : {false, true}) {
    CameraTrack track;
    track.session_id = "s";
    track.camera = Camera(is_far ? "far" : "near");
    for (int i = 0; i < kViews; ++i) {
      const RigidTransform near_from_board = NearFromBoard(board, i);
      const RigidTransform pose = is_far ? FarFromNear() * near_from_board : near_from_board;
      const BoardSide side = board.SideSeenFrom(pose.SourceFromTargetTranslation());
      EXPECT_EQ(side, is_far ? BoardSide::kBack : BoardSide::kFront);
      Observation observation;
      observation.time_ns = 100'000'000LL * i;
      observation.markers.resize(points.size());
      for (size_t m = 0; m < points.size(); ++m) {
        Eigen::Vector2d pixel;
        if (board.SideOf(m) != side ||
            !Project(*track.camera.intrinsics, pose * points[m], &pixel)) {
          continue;
        }
        pixel += Eigen::Vector2d(noise(random), noise(random));
        if (pixel.minCoeff() < 0 || pixel.x() > 1279 || pixel.y() > 1023) continue;
        MarkerObservation& marker = observation.markers[m];
        marker.visible = true;
        marker.centre_px = pixel;
        marker.covariance_px2 = kNoisePx * kNoisePx * Eigen::Matrix2d::Identity();
      }
      track.observations.push_back(std::move(observation));
    }
    input.tracks.push_back(std::move(track));
  }
  return input;
}

struct Solved {
  CalibrationResult result;
  double position_error_m = 0;  // of camera `far` in the frame of `near`
  double rotation_error_rad = 0;
};

Solved Solve(const std::string& real, const std::string& told) {
  CalibrationOptions options;
  options.intrinsics = options.time_offsets = Estimate::kFixed;
  const CalibrationOutcome outcome = Calibrate(InputOf(real, told), options);
  EXPECT_THAT(outcome.result, IsOk());
  Solved solved;
  if (!outcome.result.ok()) return solved;
  solved.result = *outcome.result;
  const auto pose_of = [&](const std::string& name) {
    return std::ranges::find(solved.result.cameras, name, &CalibratedCamera::camera)->cam_from_rig;
  };
  const RigidTransform found = pose_of("far") * pose_of("near").Inverse();
  const RigidTransform truth = FarFromNear();
  solved.position_error_m =
      (found.SourceFromTargetTranslation() - truth.SourceFromTargetTranslation()).norm();
  solved.rotation_error_rad = found.rotation.angularDistance(truth.rotation);
  return solved;
}

const Finding* Shape(const CalibrationResult& result) {
  const auto found =
      std::ranges::find(result.findings, FindingKind::kWrongTargetShape, &Finding::kind);
  return found == result.findings.end() ? nullptr : &*found;
}

TEST(TwoSidedBoard, JoinsCamerasThatFaceEachOther) {
  for (const char* board : {kCharuco, kAprilGrid}) {
    for (const char* flatness : {"", ";flatness=0"}) {
      const std::string text = std::string(board) + "0.005";
      const Solved solved = Solve(text, text + flatness);
      ASSERT_EQ(solved.result.cameras.size(), 2u);
      EXPECT_LT(solved.position_error_m, 0.001) << text << flatness;
      EXPECT_LT(solved.rotation_error_rad, 0.001) << text << flatness;
      EXPECT_EQ(Shape(solved.result), nullptr) << text << flatness;
    }
  }
}

TEST(TwoSidedBoard, AWrongThicknessIsNamed) {
  for (const char* board : {kCharuco, kAprilGrid}) {
    for (const char* flatness : {"", ";flatness=0"}) {
      const Solved solved =
          Solve(std::string(board) + "0.009", std::string(board) + "0.005" + flatness);
      const Finding* const finding = Shape(solved.result);
      ASSERT_NE(finding, nullptr) << board << flatness;
      EXPECT_THAT(finding->advice, HasSubstr("mm apart, not 5.0 mm"));
      // The board that it advises.
      const std::string advised = "--target " + std::string(board);
      const size_t at = finding->advice.find(advised);
      ASSERT_NE(at, std::string::npos) << finding->advice;
      EXPECT_NEAR(std::stod(finding->advice.substr(at + advised.size())), 0.009, 0.0003)
          << flatness;
    }
  }
}

}  // namespace
}  // namespace rigcal::server::two_sided_board_test
