// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/calibration_service.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <memory>
#include <string>
#include <vector>

#include "common/wire/grpc_status.h"
#include "tests/server/rpc/rpc_fixture.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing::calibration_service_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

class CalibrationService : public RpcFixture {
 protected:
  void SetUp() override {
    RpcFixture::SetUp();
    stub_ = v1::CalibrationService::NewStub(channel());
    FinishByHand("wave", {"left"});
  }
  static void SetDeadline(grpc::ClientContext* context) {
    context->set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(60));
  }
  absl::StatusOr<v1::Calibration> Create(const v1::CreateCalibrationRequest& request) {
    grpc::ClientContext context;
    SetDeadline(&context);
    v1::Calibration response;
    const absl::Status status =
        wire::FromGrpc(stub_->CreateCalibration(&context, request, &response));
    if (!status.ok()) return status;
    return response;
  }
  absl::StatusOr<v1::Calibration> Create(const std::string& session) {
    v1::CreateCalibrationRequest request;
    request.add_session_ids(session);
    return Create(request);
  }
  absl::StatusOr<v1::Calibration> Cancel(const std::string& id) {
    grpc::ClientContext context;
    SetDeadline(&context);
    v1::CancelCalibrationRequest request;
    request.set_id(id);
    v1::Calibration response;
    const absl::Status status =
        wire::FromGrpc(stub_->CancelCalibration(&context, request, &response));
    if (!status.ok()) return status;
    return response;
  }
  absl::StatusOr<v1::Calibration> Get(const std::string& id) {
    grpc::ClientContext context;
    SetDeadline(&context);
    v1::GetCalibrationRequest request;
    request.set_id(id);
    v1::Calibration response;
    const absl::Status status = wire::FromGrpc(stub_->GetCalibration(&context, request, &response));
    if (!status.ok()) return status;
    return response;
  }

  std::unique_ptr<v1::CalibrationService::Stub> stub_;
};

TEST_F(CalibrationService, WatchFollowsOneFromQueuedToSucceeded) {
  solver_.Hold();
  ASSERT_OK_AND_ASSIGN(const v1::Calibration created, Create("wave"));
  EXPECT_EQ(created.state(), v1::Calibration::QUEUED);
  EXPECT_EQ(created.session_ids(0), "wave");
  grpc::ClientContext context;
  SetDeadline(&context);
  v1::WatchCalibrationRequest request;
  request.set_id(created.id());
  const auto reader = stub_->WatchCalibration(&context, request);
  v1::Calibration calibration;
  while (calibration.state() != v1::Calibration::RUNNING) ASSERT_TRUE(reader->Read(&calibration));
  solver_.Release();
  while (calibration.state() == v1::Calibration::RUNNING) ASSERT_TRUE(reader->Read(&calibration));
  EXPECT_EQ(calibration.state(), v1::Calibration::SUCCEEDED);
  EXPECT_FALSE(reader->Read(&calibration));
  EXPECT_THAT(wire::FromGrpc(reader->Finish()), IsOk());
}

TEST_F(CalibrationService, AFailingSolveSaysWhy) {
  solver_.SetOutcome(absl::FailedPreconditionError("not connected: {left} | {right}"),
                     {{.camera = "left", .reason = "alone", .count = 3, .example = ""}});
  ASSERT_OK_AND_ASSIGN(const v1::Calibration ended, client().Calibrate("wave"));
  EXPECT_EQ(ended.state(), v1::Calibration::FAILED);
  EXPECT_THAT(ended.error(), HasSubstr("{left} | {right}"));
  ASSERT_EQ(ended.refused_size(), 1);
  EXPECT_EQ(ended.refused(0).count(), 3u);
}

TEST_F(CalibrationService, CancelEndsARunningOne) {
  solver_.Hold();
  ASSERT_OK_AND_ASSIGN(const v1::Calibration created, Create("wave"));
  solver_.AwaitBegun(1);
  ASSERT_THAT(Cancel(created.id()), IsOk());
  runner().WaitIdle();
  ASSERT_OK_AND_ASSIGN(const v1::Calibration ended, Get(created.id()));
  EXPECT_EQ(ended.state(), v1::Calibration::FAILED);
  EXPECT_EQ(ended.error(), "cancelled");
  EXPECT_THAT(Cancel("nobody"), StatusIs(absl::StatusCode::kNotFound, HasSubstr("nobody")));
}

TEST_F(CalibrationService, RefusesWhatCannotBeCalibrated) {
  ASSERT_THAT(client().CreateSession(WaveRequest("fresh")), IsOk());
  EXPECT_THAT(Create("nobody"), StatusIs(absl::StatusCode::kNotFound, HasSubstr("nobody")));
  EXPECT_THAT(Create("fresh"), StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("fresh")));
  EXPECT_THAT(Create(v1::CreateCalibrationRequest()),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("session_ids")));
  v1::CreateCalibrationRequest request;
  request.add_session_ids("wave");
  request.mutable_options()->set_sigma_px(-1);
  EXPECT_THAT(Create(request), StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("sigma")));
  request.mutable_options()->set_sigma_px(0);
  request.mutable_options()->set_intrinsics(static_cast<v1::CalibrationOptions::Estimate>(99));
  EXPECT_THAT(Create(request),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("intrinsics")));
  EXPECT_THAT(Get("nobody"), StatusIs(absl::StatusCode::kNotFound, HasSubstr("nobody")));
}

TEST_F(CalibrationService, SessionsThatDifferAreBothNamed) {
  v1::CreateSessionRequest other = WaveRequest("longer");
  other.mutable_target()->set_marker_positions_m(2, 0.5);
  ASSERT_THAT(client().CreateSession(other), IsOk());
  TestAgent agent(channel(), MakeHello("pc", {"left"}));
  agent.ReadHello();
  ASSERT_THAT(client().StartSession("longer"), IsOk());
  agent.ReadStart();
  agent.Send(EndMessage({"longer", "left", 1}, 0));
  AwaitState("longer", v1::Session::FINISHED);
  v1::CreateCalibrationRequest request;
  request.add_session_ids("wave");
  request.add_session_ids("longer");
  EXPECT_THAT(Create(request),
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       AllOf(HasSubstr("'wave'"), HasSubstr("'longer'"), HasSubstr("target"))));
}

TEST_F(CalibrationService, ListsPagesWithoutCamerasAndRefusals) {
  CalibrationResult result;
  result.cameras.resize(1);
  result.cameras[0].camera = "left";
  result.cameras[0].image_size_px = MakeCamera("left").image_size_px;
  result.cameras[0].intrinsics = *MakeCamera("left").intrinsics;
  result.cameras[0].clock_id = "left";
  solver_.SetOutcome(result);
  std::vector<std::string> ids;
  for (int i = 0; i < 3; ++i) {
    ASSERT_OK_AND_ASSIGN(const v1::Calibration ended, client().Calibrate("wave"));
    EXPECT_EQ(ended.cameras_size(), 1) << ended.error();
    ids.push_back(ended.id());
  }
  const auto list = [&](const std::string& token) -> absl::StatusOr<v1::ListCalibrationsResponse> {
    grpc::ClientContext context;
    SetDeadline(&context);
    v1::ListCalibrationsRequest request;
    request.set_rig("rig");
    request.set_page_size(2);
    request.set_page_token(token);
    v1::ListCalibrationsResponse response;
    const absl::Status status =
        wire::FromGrpc(stub_->ListCalibrations(&context, request, &response));
    if (!status.ok()) return status;
    return response;
  };
  ASSERT_OK_AND_ASSIGN(const v1::ListCalibrationsResponse first, list(""));
  ASSERT_EQ(first.calibrations_size(), 2);
  EXPECT_EQ(first.calibrations(0).id(), ids[2]);
  EXPECT_EQ(first.calibrations(0).version(), 3u);
  EXPECT_EQ(first.calibrations(0).cameras_size(), 0);
  ASSERT_OK_AND_ASSIGN(const v1::ListCalibrationsResponse second, list(first.next_page_token()));
  ASSERT_EQ(second.calibrations_size(), 1);
  EXPECT_EQ(second.calibrations(0).id(), ids[0]);
  EXPECT_EQ(second.next_page_token(), "");
  EXPECT_THAT(list("garbage"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("page_token")));
}

TEST_F(CalibrationService, QueuedOnesSurviveARestart) {
  solver_.Hold();
  ASSERT_OK_AND_ASSIGN(const v1::Calibration created, Create("wave"));
  solver_.AwaitBegun(1);
  RestartServer();
  solver_.AwaitBegun(2);
  solver_.Release();
  runner().WaitIdle();
  stub_ = v1::CalibrationService::NewStub(channel());
  ASSERT_OK_AND_ASSIGN(const v1::Calibration ended, Get(created.id()));
  EXPECT_EQ(ended.state(), v1::Calibration::SUCCEEDED);
}

}  // namespace
}  // namespace rigcal::testing::calibration_service_test
