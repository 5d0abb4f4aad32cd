// SPDX-License-Identifier: Apache-2.0
#include "common/triangulate/row_stream.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <utility>

#include "tests/common/triangulate/true_result.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing::row_stream_test {
namespace {

using ::testing::HasSubstr;

SimulatedWorld World(bool free_running, double duration_s = 6) {
  SimulationOptions simulation;
  simulation.camera_count = 4;
  simulation.duration_s = duration_s;
  simulation.free_running = free_running;
  if (free_running) simulation.time_offset_s = {{1, 0.008}, {2, -0.013}};
  Target wand;
  wand.marker_positions_m = {0, 0.13, 0.39};
  return *SimulatedWorld::Create(simulation, wand);
}

// Messages of `count` rows, all cameras in the order of time.
std::vector<CameraRows> InPieces(const std::vector<CameraRows>& rows, size_t count) {
  std::vector<CameraRows> pieces;
  for (size_t begin = 0;; begin += count) {
    bool any = false;
    for (const CameraRows& camera : rows) {
      const size_t end = std::min(begin + count, camera.rows.size());
      if (begin >= end) continue;
      any = true;
      pieces.push_back({camera.camera,
                        {camera.rows.begin() + static_cast<std::ptrdiff_t>(begin),
                         camera.rows.begin() + static_cast<std::ptrdiff_t>(end)}});
    }
    if (!any) return pieces;
  }
}

struct Streamed {
  std::vector<TriangulatedPoint> points;
  size_t points_before_end = 0, most_waiting = 0;
  uint64_t late = 0;
};

Streamed StreamAll(const CalibrationResult& calibration, const std::vector<CameraRows>& pieces,
                   RowStreamOptions options = {}) {
  Streamed streamed;
  auto stream = RowStream::Create(calibration, std::move(options));
  EXPECT_THAT(stream, IsOk());
  if (!stream.ok()) return streamed;
  const auto take = [&](bool end) {
    auto points = stream->Take(end);
    EXPECT_THAT(points, IsOk());
    if (!points.ok()) return;
    for (TriangulatedPoint& point : points->points) streamed.points.push_back(std::move(point));
  };
  for (const CameraRows& piece : pieces) {
    EXPECT_THAT(stream->Add(piece.camera, piece.rows), IsOk());
    streamed.most_waiting = std::max(streamed.most_waiting, stream->waiting_row_count());
    take(false);
  }
  streamed.points_before_end = streamed.points.size();
  take(true);
  streamed.late = stream->late_row_count();
  return streamed;
}

void ExpectTheSame(bool free_running) {
  const SimulatedWorld world = World(free_running);
  const CalibrationResult calibration = TrueResult(world);
  const std::vector<CameraRows> rows = RowsOf(world);
  const auto at_once = TriangulateRows(calibration, rows, {});
  ASSERT_THAT(at_once, IsOk());
  ASSERT_GT(at_once->points.size(), 300u);
  for (const size_t piece : {1, 7, 40}) {
    const Streamed streamed = StreamAll(calibration, InPieces(rows, piece));
    EXPECT_EQ(streamed.late, 0u);
    ASSERT_EQ(streamed.points.size(), at_once->points.size()) << piece;
    for (size_t i = 0; i < streamed.points.size(); ++i) {
      const TriangulatedPoint &a = streamed.points[i], &b = at_once->points[i];
      ASSERT_EQ(a.rig_time_ns, b.rig_time_ns) << piece;
      EXPECT_EQ(a.marker, b.marker);
      EXPECT_LT((a.position_m - b.position_m).norm(), 1e-12) << i;
      EXPECT_LT((a.covariance_m2 - b.covariance_m2).norm(), 1e-15) << i;
    }
  }
}

TEST(RowStream, GivesWhatAllRowsAtOnceGive) { ExpectTheSame(/*free_running=*/false); }
TEST(RowStream, GivesThatOfFreelyRunningCamerasToo) { ExpectTheSame(/*free_running=*/true); }

TEST(RowStream, GivesPointsSoonAndForgetsRows) {
  const SimulatedWorld world = World(false, 12);
  const std::vector<CameraRows> rows = RowsOf(world);
  size_t all = 0;
  for (const CameraRows& camera : rows) all += camera.rows.size();
  const Streamed streamed = StreamAll(TrueResult(world), InPieces(rows, 2));
  // All but the last second.
  EXPECT_GT(streamed.points_before_end, streamed.points.size() * 10 / 12);
  EXPECT_LT(streamed.most_waiting, all / 4);
}

TEST(RowStream, DoesNotWaitForASilentCamera) {
  const SimulatedWorld world = World(false, 8);
  std::vector<CameraRows> rows = RowsOf(world);
  rows.erase(rows.begin());
  const CalibrationResult calibration = TrueResult(world);
  const Streamed waited = StreamAll(calibration, InPieces(rows, 5));
  EXPECT_GT(waited.points_before_end, 100u);
  // Where it is known who delivers, nothing is waited for.
  RowStreamOptions options;
  for (const CameraRows& camera : rows) options.cameras.push_back(camera.camera);
  const Streamed named = StreamAll(calibration, InPieces(rows, 5), options);
  EXPECT_GT(named.points_before_end, waited.points_before_end);
  EXPECT_EQ(named.points.size(), waited.points.size());
}

TEST(RowStream, CountsRowsThatComeTooLate) {
  const SimulatedWorld world = World(false, 8);
  const std::vector<CameraRows> rows = RowsOf(world);
  // The last camera sends everything when the others are eight seconds on.
  std::vector<CameraRows> ordered = InPieces({rows.begin(), rows.end() - 1}, 3);
  ordered.push_back(rows.back());
  const Streamed streamed = StreamAll(TrueResult(world), ordered);
  EXPECT_GT(streamed.late, rows.back().rows.size() / 2);
  EXPECT_LT(streamed.late, rows.back().rows.size());
  // A row twice.
  auto stream = RowStream::Create(TrueResult(world), {});
  ASSERT_THAT(stream, IsOk());
  const std::vector<Observation> one = {rows[0].rows[0]};
  ASSERT_THAT(stream->Add(rows[0].camera, one), IsOk());
  ASSERT_THAT(stream->Add(rows[0].camera, one), IsOk());
  EXPECT_EQ(stream->late_row_count(), 1u);
}

TEST(RowStream, RefusesWhatDoesNotFit) {
  const SimulatedWorld world = World(false, 2);
  const CalibrationResult calibration = TrueResult(world);
  const std::vector<CameraRows> rows = RowsOf(world);
  RowStreamOptions options;
  options.cameras = {"sim_0", "sim_9"};
  EXPECT_THAT(RowStream::Create(calibration, options).status(),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("sim_9; it has sim_0")));
  options.cameras = {"sim_0"};
  EXPECT_THAT(RowStream::Create(calibration, options).status(),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("two cameras")));
  options = {};
  options.block_s = 0;
  options.max_delay_s = -1;
  EXPECT_THAT(RowStream::Create(calibration, options).status(),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("max_delay_s is -1")));
  CalibrationResult unscaled = calibration;
  unscaled.scale_known = false;
  EXPECT_THAT(RowStream::Create(unscaled, {}).status(),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("scale")));

  options = {};
  options.max_rows = 5;
  auto stream = RowStream::Create(calibration, options);
  ASSERT_THAT(stream, IsOk());
  EXPECT_THAT(stream->Add("sim_9", {}), StatusIs(absl::StatusCode::kInvalidArgument,
                                                 HasSubstr("sim_9 is none of this stream")));
  std::vector<Observation> four(rows[0].rows.begin(), rows[0].rows.begin() + 4);
  EXPECT_THAT(stream->Add("sim_0", four), IsOk());
  four[0].markers.pop_back();
  EXPECT_THAT(stream->Add("sim_1", {four[0]}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("has 2 markers")));
  four = {rows[1].rows.begin(), rows[1].rows.begin() + 4};
  EXPECT_THAT(stream->Add("sim_1", four),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("more than 5 rows")));
}

}  // namespace
}  // namespace rigcal::testing::row_stream_test
