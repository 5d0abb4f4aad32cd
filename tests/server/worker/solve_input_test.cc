// SPDX-License-Identifier: Apache-2.0
#include "server/worker/solve_input.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdio.h>
#include <unistd.h>

#include <functional>
#include <string>

#include "tests/server/store/store_fixture.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::solve_input_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::MakeBatch;
using ::rigcal::testing::StatusIs;
using ::testing::HasSubstr;
using ::testing::SizeIs;

// A temporary file.
class SolveInputFile : public ::testing::Test {
 protected:
  void SetUp() override { ASSERT_NE(file_, nullptr); }
  void TearDown() override { fclose(file_); }
  int descriptor() const { return fileno(file_); }

  // Two cameras with 20 and 7 rows.
  void WriteExample() {
    SolveInputWriter writer(descriptor());
    Target target;
    target.marker_positions_m = {0, 0.13, 0.39};
    std::vector<CameraTrack> tracks(2);
    for (size_t t = 0; t < 2; ++t) {
      tracks[t].session_id = "wave";
      tracks[t].camera.camera = t == 0 ? "left" : "right";
      tracks[t].camera.image_size_px = {.width = 1280, .height = 1024};
      tracks[t].camera.clock.clock_id = tracks[t].camera.camera;
    }
    CalibrationOptions options;
    options.seed = 77;
    ASSERT_THAT(
        writer.Begin(target, options, tracks, {20, 100}, {{"other", *ParseTarget("point")}}),
        IsOk());
    ObservationBatch left = MakeBatch({"wave", "left", 1}, 1, 20, /*clock_epoch=*/3);
    left.clock_samples = {{.device_ns = 1, .host_utc_ns = 2}};
    left.host_alignments = {{.server_minus_host_ns = -5}};
    ASSERT_THAT(writer.AddRows(0, left), IsOk());
    ASSERT_THAT(writer.AddRows(1, MakeBatch({"wave", "right", 2}, 11, 17)), IsOk());
    ASSERT_THAT(writer.End({{"left", RefusalReason::kLate, 4, "why"}}), IsOk());
    lseek(descriptor(), 0, SEEK_SET);
  }

  FILE* const file_ = tmpfile();
};

TEST_F(SolveInputFile, ComesBackAsItWas) {
  WriteExample();
  ASSERT_OK_AND_ASSIGN(const SolveInput read, ReadSolveInput(descriptor()));
  EXPECT_EQ(read.options.seed, 77u);
  EXPECT_THAT(read.input.target.marker_positions_m, SizeIs(3));
  ASSERT_THAT(read.input.other_targets, SizeIs(1));
  EXPECT_EQ(read.input.other_targets.at("other"), *ParseTarget("point"));
  ASSERT_THAT(read.input.tracks, SizeIs(2));
  const CameraTrack& left = read.input.tracks[0];
  EXPECT_EQ(left.session_id, "wave");
  EXPECT_EQ(left.camera.camera, "left");
  ASSERT_THAT(left.observations, SizeIs(20));
  ASSERT_THAT(read.input.tracks[1].observations, SizeIs(7));
  const ObservationBatch batch = MakeBatch({"wave", "left", 1}, 1, 20, 3);
  for (size_t row = 0; row < 20; ++row) {
    const Observation expected = batch.Row(row), &got = left.observations[row];
    EXPECT_EQ(got.time_ns, expected.time_ns);
    EXPECT_EQ(got.clock_epoch, 3u);
    ASSERT_EQ(got.markers.size(), expected.markers.size());
    for (size_t m = 0; m < got.markers.size(); ++m) {
      EXPECT_EQ(got.markers[m].visible, expected.markers[m].visible);
      EXPECT_EQ(got.markers[m].centre_px, expected.markers[m].centre_px);
      EXPECT_EQ(got.markers[m].covariance_px2, expected.markers[m].covariance_px2);
    }
  }
  ASSERT_THAT(left.clock_samples, SizeIs(1));
  EXPECT_EQ(left.clock_samples[0].clock_epoch, 3u);
  EXPECT_EQ(left.clock_samples[0].sample.host_utc_ns, 2);
  ASSERT_THAT(left.host_alignments, SizeIs(1));
  EXPECT_EQ(left.host_alignments[0].server_minus_host_ns, -5);
  EXPECT_THAT(read.input.refused,
              ::testing::ElementsAre(Refusal{"left", RefusalReason::kLate, 4, "why"}));
}

TEST_F(SolveInputFile, CutOffAnywhereIsRefused) {
  WriteExample();
  const off_t size = lseek(descriptor(), 0, SEEK_END);
  for (off_t cut = size - 1; cut > 0; cut -= 1 + size / 50) {
    ASSERT_EQ(ftruncate(descriptor(), cut), 0);
    lseek(descriptor(), 0, SEEK_SET);
    EXPECT_THAT(ReadSolveInput(descriptor()),
                StatusIs(absl::StatusCode::kDataLoss, HasSubstr("damaged")))
        << cut;
  }
}

TEST_F(SolveInputFile, PartsOutOfOrderAreRefused) {
  const struct {
    std::function<void(worker::v1::SolveInput*)> part;
    std::string error;
  } parts[] = {
      {[](auto* part) { part->mutable_rows()->set_track(5); }, "no camera"},
      {[](auto*) {}, "unknown kind"},
  };
  for (const auto& [part, error] : parts) {
    ASSERT_EQ(ftruncate(descriptor(), 0), 0);
    lseek(descriptor(), 0, SEEK_SET);
    MessageWriter writer(descriptor());
    worker::v1::SolveInput message;
    part(&message);
    ASSERT_THAT(writer.Write(message), IsOk());
    ASSERT_THAT(writer.Flush(), IsOk());
    lseek(descriptor(), 0, SEEK_SET);
    EXPECT_THAT(ReadSolveInput(descriptor()),
                StatusIs(absl::StatusCode::kDataLoss, HasSubstr(error)));
  }
}

}  // namespace
}  // namespace rigcal::server::solve_input_test
