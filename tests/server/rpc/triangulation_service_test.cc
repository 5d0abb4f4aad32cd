// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "common/triangulate/triangulate_rows.h"
#include "common/wire/grpc_status.h"
#include "rigcal/v1/triangulation_service.grpc.pb.h"
#include "server/session/rig_book.h"
#include "tests/common/triangulate/true_result.h"
#include "tests/server/rpc/rpc_fixture.h"
#include "tests/testing/process.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::triangulation_service_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::RowsOf;
using ::rigcal::testing::StatusIs;
using ::rigcal::testing::TrueResult;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

using Call = grpc::ClientReaderWriter<v1::TriangulateRequest, v1::TriangulateResponse>;

v1::TriangulateRequest StartOf(const std::string& calibration) {
  v1::TriangulateRequest request;
  request.mutable_start()->set_calibration_id(calibration);
  return request;
}

v1::TriangulateRequest RowsMessage(const std::string& camera, const std::vector<Observation>& rows,
                                   size_t begin, size_t end) {
  v1::TriangulateRequest request;
  v1::TriangulateRows& message = *request.mutable_rows();
  message.set_camera(camera);
  message.set_marker_count(3);
  for (size_t i = begin; i < std::min(end, rows.size()); ++i) {
    message.add_time_ns(rows[i].time_ns);
    for (const MarkerObservation& marker : rows[i].markers) {
      const float nan = std::numeric_limits<float>::quiet_NaN();
      message.add_x_px(marker.visible ? static_cast<float>(marker.centre_px.x()) : nan);
      message.add_y_px(marker.visible ? static_cast<float>(marker.centre_px.y()) : nan);
    }
  }
  return request;
}

class TriangulationService : public rigcal::testing::RpcFixture {
 protected:
  void SetUp() override {
    RpcFixture::SetUp();
    // A channel in the process holds every message until it is read; TCP has buffers, as in use.
    RestartServerOnPort();
    SimulationOptions simulation;
    simulation.camera_count = 3;
    simulation.duration_s = 4;
    Target wand;
    wand.marker_positions_m = {0, 0.13, 0.39};
    world_ = *SimulatedWorld::Create(simulation, wand);
    result_ = TrueResult(*world_);
    Calibration calibration;
    calibration.rig = "rig";
    calibration.state = CalibrationState::kSucceeded;
    calibration.result = result_;
    const auto stored = store().CreateCalibration(calibration);
    ASSERT_THAT(stored, IsOk());
    id_ = stored->id;
    stub_ = v1::TriangulationService::NewStub(channel());
  }
  void TearDown() override {
    stub_.reset();
    RpcFixture::TearDown();
  }

  // The status of a stream of these messages; what it answered is ignored.
  absl::Status Send(const std::vector<v1::TriangulateRequest>& requests) {
    grpc::ClientContext context;
    const auto call = stub_->Triangulate(&context);
    for (const auto& request : requests) {
      if (!call->Write(request)) break;
    }
    call->WritesDone();
    for (v1::TriangulateResponse response; call->Read(&response);) {
    }
    return wire::FromGrpc(call->Finish());
  }

  std::optional<SimulatedWorld> world_;
  CalibrationResult result_;
  std::string id_;
  std::unique_ptr<v1::TriangulationService::Stub> stub_;
};

TEST_F(TriangulationService, AnswersWithPointsWhileRowsStillCome) {
  ASSERT_THAT(RigBook(&store()).Activate(id_, {}), IsOk());
  const std::vector<CameraRows> rows = RowsOf(*world_);
  grpc::ClientContext context;
  const auto call = stub_->Triangulate(&context);
  ASSERT_TRUE(call->Write(StartOf("")));  // the active one
  v1::TriangulateResponse started;
  ASSERT_TRUE(call->Read(&started));
  EXPECT_EQ(started.started().calibration_id(), id_);
  EXPECT_THAT(started.started().cameras(), ElementsAre("sim_0", "sim_1", "sim_2"));
  EXPECT_FALSE(started.started().has_calibration_covariance());

  // Half of the rows, and the points of most of them before another one is sent.
  const size_t half = rows[0].rows.size() / 2;
  std::vector<v1::TriangulatedPoint> points;
  v1::TriangulateResponse response;
  for (const CameraRows& camera : rows) {
    ASSERT_TRUE(call->Write(RowsMessage(camera.camera, camera.rows, 0, half)));
  }
  ASSERT_TRUE(call->Read(&response));
  EXPECT_GT(response.points_size(), 60);
  points.assign(response.points().begin(), response.points().end());
  for (const CameraRows& camera : rows) {
    ASSERT_TRUE(call->Write(RowsMessage(camera.camera, camera.rows, half, camera.rows.size())));
  }
  call->WritesDone();
  v1::TriangulateCounts counts;
  while (call->Read(&response)) {
    points.insert(points.end(), response.points().begin(), response.points().end());
    counts = response.counts();
  }
  ASSERT_THAT(wire::FromGrpc(call->Finish()), IsOk());

  std::vector<CameraRows> rounded = rows;  // as on the wire
  for (CameraRows& camera : rounded) {
    for (Observation& row : camera.rows) {
      for (MarkerObservation& marker : row.markers) {
        marker.centre_px = marker.centre_px.cast<float>().cast<double>();
      }
    }
  }
  const auto expected = TriangulateRows(result_, rounded, {});
  ASSERT_THAT(expected, IsOk());
  ASSERT_EQ(points.size(), expected->points.size());
  EXPECT_EQ(counts.points(), points.size());
  EXPECT_EQ(counts.alone(), expected->alone_count);
  EXPECT_EQ(counts.late_rows(), 0u);
  for (size_t i = 0; i < points.size(); ++i) {
    const TriangulatedPoint& point = expected->points[i];
    EXPECT_EQ(points[i].time_ns(), point.rig_time_ns);
    EXPECT_EQ(points[i].marker(), static_cast<uint32_t>(point.marker));
    EXPECT_NEAR(points[i].position_m().z(), point.position_m.z(), 1e-12);
    ASSERT_EQ(points[i].covariance_m2_size(), 6);
    EXPECT_NEAR(points[i].covariance_m2(1), point.covariance_m2(0, 1), 1e-15);
    EXPECT_NEAR(points[i].covariance_m2(5), point.covariance_m2(2, 2), 1e-15);
    EXPECT_EQ(points[i].camera_count(), point.views.size());
  }
}

// A client that sends and never reads is held up, and the server keeps serving others.
TEST_F(TriangulationService, HoldsUpAClientThatDoesNotRead) {
  const std::vector<CameraRows> rows = RowsOf(*world_);
  grpc::ClientContext context;
  const auto call = stub_->Triangulate(&context);
  ASSERT_TRUE(call->Write(StartOf(id_)));
  v1::TriangulateResponse started;
  ASSERT_TRUE(call->Read(&started));
  std::atomic<int> sent = 0;
  std::thread writer([&] {
    // The same seconds again and again, each time later: tens of thousands of points.
    for (int round = 0; round < 20'000; ++round) {
      for (const CameraRows& camera : rows) {
        std::vector<Observation> later = camera.rows;
        for (Observation& row : later) row.time_ns += int64_t{5'000'000'000} * round;
        if (!call->Write(RowsMessage(camera.camera, later, 0, later.size()))) return;
      }
      ++sent;
    }
  });
  // It stands still once what may be on its way is full.
  int before = -1;
  EXPECT_TRUE(rigcal::testing::WaitFor([&] {
    const int now = sent;
    const bool still = now == before;
    before = now;
    std::this_thread::sleep_for(std::chrono::milliseconds(500));
    return still && now > 0;
  }));
  EXPECT_LT(sent, 20'000);
  EXPECT_THAT(Send({StartOf(id_), RowsMessage("sim_0", rows[0].rows, 0, 10)}), IsOk());
  context.TryCancel();
  writer.join();
  for (v1::TriangulateResponse response; call->Read(&response);) {
  }
  EXPECT_THAT(wire::FromGrpc(call->Finish()), StatusIs(absl::StatusCode::kCancelled, ::testing::_));
}

TEST_F(TriangulationService, RefusesWhatItCannotUse) {
  const std::vector<CameraRows> rows = RowsOf(*world_);
  const auto few = RowsMessage("sim_0", rows[0].rows, 0, 3);
  EXPECT_THAT(Send({few}), StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("start")));
  EXPECT_THAT(Send({StartOf("c-000404")}),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("c-000404")));
  EXPECT_THAT(Send({StartOf("")}),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("no active calibration")));
  EXPECT_THAT(Send({StartOf(id_), StartOf(id_)}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("twice")));
  EXPECT_THAT(Send({StartOf(id_), v1::TriangulateRequest()}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("neither")));
  auto other = few;
  other.mutable_rows()->set_camera("sim_9");
  EXPECT_THAT(Send({StartOf(id_), other}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("sim_9")));
  auto cut = few;
  cut.mutable_rows()->mutable_y_px()->RemoveLast();
  EXPECT_THAT(Send({StartOf(id_), cut}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("rows.y_px: has 8 values")));
  auto none = few;
  none.mutable_rows()->set_marker_count(0);
  EXPECT_THAT(Send({StartOf(id_), none}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("marker_count")));
  auto long_name = few;
  long_name.mutable_rows()->set_camera(std::string(1000, 'x'));
  EXPECT_THAT(Send({StartOf(id_), long_name}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("camera")));
  v1::TriangulateRequest start = StartOf(id_);
  start.mutable_start()->set_block_s(100);
  EXPECT_THAT(Send({start}), StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("block_s")));
}

TEST_F(TriangulationService, ServesSixteenStreamsAtATime) {
  struct Open {
    grpc::ClientContext context;
    std::unique_ptr<Call> call;
  };
  std::vector<std::unique_ptr<Open>> streams;
  for (int i = 0; i < 16; ++i) {
    auto& stream = *streams.emplace_back(std::make_unique<Open>());
    stream.call = stub_->Triangulate(&stream.context);
    ASSERT_TRUE(stream.call->Write(StartOf(id_)));
    v1::TriangulateResponse response;
    ASSERT_TRUE(stream.call->Read(&response));
  }
  EXPECT_THAT(Send({StartOf(id_)}),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("16 triangulations")));
  for (auto& stream : streams) {
    stream->call->WritesDone();
    for (v1::TriangulateResponse response; stream->call->Read(&response);) {
    }
    EXPECT_THAT(wire::FromGrpc(stream->call->Finish()), IsOk());
  }
  EXPECT_TRUE(rigcal::testing::WaitFor([&] { return Send({StartOf(id_)}).ok(); }));
}

}  // namespace
}  // namespace rigcal::server::triangulation_service_test
