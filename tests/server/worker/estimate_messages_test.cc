// SPDX-License-Identifier: Apache-2.0
#include "server/worker/estimate_messages.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <unistd.h>

#include "tests/testing/status_matchers.h"

namespace rigcal::server::estimate_messages_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::SizeIs;

class EstimateInput : public ::testing::Test {
 protected:
  EstimateInput() : file_(memfd_create("test", 0)) {}
  ~EstimateInput() override { close(file_); }
  absl::StatusOr<RunningInput> ReadBack() {
    lseek(file_, 0, SEEK_SET);
    return ReadEstimateInput(file_);
  }

  static Target Wand() {
    Target target;
    target.marker_positions_m = {0, 0.13, 0.39};
    return target;
  }
  static CameraTrack Track(const std::string& camera) {
    CameraTrack track;
    track.session_id = "wave";
    track.camera.camera = camera;
    track.camera.image_size_px = {640, 480};
    track.camera.clock = {.clock_id = camera, .timebase = "test"};
    return track;
  }
  static ObservationBatch Rows() {
    ObservationBatch batch;
    batch.stream = {"wave", "right", 1};
    batch.marker_count = 3;
    Observation row;
    row.time_ns = 7;
    row.markers.resize(3);
    row.markers[1].visible = true;
    row.markers[1].centre_px = {10.5, 20.25};
    batch.Append(row);
    return batch;
  }
  static EstimateStart Start() {
    EstimateStart start;
    Intrinsics intrinsics;
    intrinsics.fx_px = intrinsics.fy_px = 500;
    intrinsics.cx_px = 320;
    intrinsics.cy_px = 240;
    start.cameras.push_back(
        {"left", {Eigen::Quaterniond::Identity(), Eigen::Vector3d(1, 2, 3)}, intrinsics});
    start.clocks.push_back({"wave", "left", 1, 1234567890123, -0.008, 2e-5});
    start.marker_positions_m = {0, 0.1301, 0.3902};
    start.round = 7;
    return start;
  }

  const int file_;
};

TEST_F(EstimateInput, ComesBackAsWritten) {
  EstimateInputWriter writer(file_);
  ASSERT_THAT(writer.Begin(Wand(), {Track("left"), Track("right")}, 0.25, Start()), IsOk());
  ASSERT_THAT(writer.AddRows(1, Rows()), IsOk());
  ASSERT_THAT(writer.End(), IsOk());
  ASSERT_OK_AND_ASSIGN(const RunningInput input, ReadBack());
  EXPECT_EQ(input.target, Wand());
  EXPECT_EQ(input.data_share, 0.25);
  ASSERT_THAT(input.tracks, SizeIs(2));
  EXPECT_THAT(input.tracks[0].observations, SizeIs(0));
  ASSERT_THAT(input.tracks[1].observations, SizeIs(1));
  EXPECT_EQ(input.tracks[1].observations[0].markers[1].centre_px.y(), 20.25);
  ASSERT_THAT(input.start.cameras, SizeIs(1));
  EXPECT_EQ(input.start.cameras[0].cam_from_rig.translation_m, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(input.start.cameras[0].intrinsics.fx_px, 500);
  ASSERT_THAT(input.start.clocks, SizeIs(1));
  EXPECT_EQ(input.start.clocks[0].time_epoch_ns, 1234567890123);
  EXPECT_EQ(input.start.clocks[0].time_offset_s, -0.008);
  EXPECT_EQ(input.start.clocks[0].time_rate, 2e-5);
  EXPECT_THAT(input.start.marker_positions_m, ElementsAre(0, 0.1301, 0.3902));
  EXPECT_EQ(input.start.round, 7);
}

TEST_F(EstimateInput, WithoutItsEndIsRefused) {
  EstimateInputWriter writer(file_);
  ASSERT_THAT(writer.Begin(Wand(), {Track("left")}, 1, {}), IsOk());
  ASSERT_THAT(writer.End(), IsOk());
  ASSERT_EQ(ftruncate(file_, lseek(file_, 0, SEEK_END) - 1), 0);
  EXPECT_THAT(ReadBack().status(), StatusIs(absl::StatusCode::kDataLoss, ::testing::_));
}

TEST_F(EstimateInput, RowsOfNoCameraAreRefused) {
  EstimateInputWriter writer(file_);
  ASSERT_THAT(writer.Begin(Wand(), {Track("left")}, 1, {}), IsOk());
  ASSERT_THAT(writer.AddRows(1, Rows()), IsOk());
  ASSERT_THAT(writer.End(), IsOk());
  const absl::Status status = ReadBack().status();
  EXPECT_THAT(status, StatusIs(absl::StatusCode::kDataLoss, ::testing::_));
  EXPECT_THAT(std::string(status.message()), HasSubstr("rows of no camera"));
}

TEST(EstimateOutput, ComesBackAsWritten) {
  RunningOutcome outcome;
  outcome.needs.push_back({"left", "right", 3, 40});
  RunningEstimate estimate;
  estimate.instant_count = 812;
  estimate.cameras.push_back(
      {"left", {Eigen::Quaterniond::Identity(), Eigen::Vector3d(0, 0, 1)}, -0.008, 1e-5, 0.4, 900});
  estimate.grid.origin_m = {1, 2, 3};
  estimate.grid.step_m = 0.2;
  estimate.grid.counts = {2, 2, 1};
  estimate.grid.wand_counts = {0, 5, 0, 1};
  estimate.grid.inside = {true, true, false, true};
  estimate.error.points = {0, 1, 3};
  estimate.error.sigma_m = {0.001, 0.002, 0.003};
  estimate.error.p95_m = 0.004;
  estimate.error.worst_point = 3;
  estimate.held_out = HeldOutCheck{0.41, 0.4, true};
  estimate.advice.push_back(
      {"low, in the middle, wand upright", {1, 0, 0}, {0, 0, 1}, {"left", "right"}, 0.0003});
  estimate.wand_m = {{1, 1, 1}, {2, 2, 2}};
  estimate.next.round = 3;
  outcome.estimate = estimate;
  ASSERT_OK_AND_ASSIGN(const RunningOutcome back, FromProto(ToProto(outcome)));
  EXPECT_THAT(back.problem, IsOk());
  ASSERT_THAT(back.needs, SizeIs(1));
  EXPECT_EQ(back.needs[0].common_count, 3);
  ASSERT_TRUE(back.estimate);
  EXPECT_EQ(back.estimate->instant_count, 812);
  EXPECT_EQ(back.estimate->cameras[0].time_offset_s, -0.008);
  EXPECT_THAT(back.estimate->error.points, ElementsAre(0, 1, 3));
  EXPECT_FLOAT_EQ(static_cast<float>(back.estimate->error.sigma_m[2]), 0.003f);
  EXPECT_THAT(back.estimate->grid.wand_counts, ElementsAre(0, 5, 0, 1));
  EXPECT_EQ(back.estimate->grid.Point(3), estimate.grid.Point(3));
  EXPECT_TRUE(back.estimate->held_out->agrees);
  EXPECT_EQ(back.estimate->advice[0].text, "low, in the middle, wand upright");
  EXPECT_THAT(back.estimate->wand_m, SizeIs(2));
  EXPECT_EQ(back.estimate->next.round, 3);
}

TEST(EstimateOutput, AProblemComesBackAsWritten) {
  RunningOutcome outcome;
  outcome.problem = absl::FailedPreconditionError("left saw nothing");
  ASSERT_OK_AND_ASSIGN(const RunningOutcome back, FromProto(ToProto(outcome)));
  EXPECT_EQ(back.problem, outcome.problem);
  EXPECT_FALSE(back.estimate);
}

TEST(EstimateOutput, AGridOfAnotherSizeIsRefused) {
  RunningOutcome outcome;
  outcome.estimate.emplace();
  outcome.estimate->grid.counts = {2, 2, 2};
  outcome.estimate->grid.wand_counts = {0, 0, 0};
  EXPECT_THAT(FromProto(ToProto(outcome)).status(),
              StatusIs(absl::StatusCode::kInvalidArgument, ::testing::_));
}

}  // namespace
}  // namespace rigcal::server::estimate_messages_test
