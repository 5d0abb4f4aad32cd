// SPDX-License-Identifier: Apache-2.0
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
using ::testing::ElementsAre;
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
    v1::CreateCalibrationResponse response;
    const absl::Status status =
        wire::FromGrpc(stub_->CreateCalibration(&context, request, &response));
    if (!status.ok()) return status;
    return response.calibration();
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
    v1::CancelCalibrationResponse response;
    const absl::Status status =
        wire::FromGrpc(stub_->CancelCalibration(&context, request, &response));
    if (!status.ok()) return status;
    return response.calibration();
  }
  absl::StatusOr<v1::Calibration> Get(const std::string& id) {
    grpc::ClientContext context;
    SetDeadline(&context);
    v1::GetCalibrationRequest request;
    request.set_id(id);
    v1::GetCalibrationResponse response;
    const absl::Status status = wire::FromGrpc(stub_->GetCalibration(&context, request, &response));
    if (!status.ok()) return status;
    return response.calibration();
  }

  std::unique_ptr<v1::CalibrationService::Stub> stub_;
};

TEST_F(CalibrationService, WatchFollowsOneFromQueuedToSucceeded) {
  solver_.Hold();
  ASSERT_OK_AND_ASSIGN(const v1::Calibration created, Create("wave"));
  EXPECT_EQ(created.state(), v1::Calibration::STATE_QUEUED);
  EXPECT_EQ(created.session_ids(0), "wave");
  grpc::ClientContext context;
  SetDeadline(&context);
  v1::WatchCalibrationRequest request;
  request.set_id(created.id());
  const auto reader = stub_->WatchCalibration(&context, request);
  v1::WatchCalibrationResponse response;
  while (response.calibration().state() != v1::Calibration::STATE_RUNNING)
    ASSERT_TRUE(reader->Read(&response));
  solver_.Release();
  while (response.calibration().state() == v1::Calibration::STATE_RUNNING)
    ASSERT_TRUE(reader->Read(&response));
  EXPECT_EQ(response.calibration().state(), v1::Calibration::STATE_SUCCEEDED);
  EXPECT_FALSE(reader->Read(&response));
  EXPECT_THAT(wire::FromGrpc(reader->Finish()), IsOk());
}

TEST_F(CalibrationService, AFailingSolveSaysWhy) {
  solver_.SetOutcome(
      absl::FailedPreconditionError("not connected: {left} | {right}"),
      {{.camera = "left", .reason = RefusalReason::kAloneInInstant, .count = 3, .example = ""}});
  ASSERT_OK_AND_ASSIGN(const v1::Calibration ended, client().Calibrate("wave"));
  EXPECT_EQ(ended.state(), v1::Calibration::STATE_FAILED);
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
  EXPECT_EQ(ended.state(), v1::Calibration::STATE_FAILED);
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
  ASSERT_THAT(client().CreateSession(WaveRequest("smaller")), IsOk());
  v1::AgentHello hello = MakeHello("pc", {"left"});
  hello.mutable_cameras(0)->mutable_description()->mutable_image_size_px()->set_width(640);
  TestAgent agent(channel(), hello);
  agent.ReadHello();
  ASSERT_THAT(client().StartSession("smaller"), IsOk());
  agent.ReadStart();
  agent.Send(EndMessage({"smaller", "left", 1}, 0));
  AwaitState("smaller", v1::Session::STATE_FINISHED);
  v1::CreateCalibrationRequest request;
  request.add_session_ids("wave");
  request.add_session_ids("smaller");
  EXPECT_THAT(Create(request),
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       AllOf(HasSubstr("'wave'"), HasSubstr("'smaller'"), HasSubstr("'left'"),
                             HasSubstr("image size"))));
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
    request.set_filter("rig=rig AND session_ids:wave");
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

TEST_F(CalibrationService, ListsThoseOfASession) {
  FinishByHand("other", {"left"});
  v1::CreateCalibrationRequest both;
  both.add_session_ids("wave");
  both.add_session_ids("other");
  ASSERT_OK_AND_ASSIGN(const v1::Calibration of_wave, client().Calibrate("wave"));
  ASSERT_OK_AND_ASSIGN(const v1::Calibration of_both, Create(both));
  runner().WaitIdle();
  const auto list = [&](const std::string& filter) {
    grpc::ClientContext context;
    SetDeadline(&context);
    v1::ListCalibrationsRequest request;
    request.set_filter(filter);
    v1::ListCalibrationsResponse response;
    const grpc::Status status = stub_->ListCalibrations(&context, request, &response);
    std::vector<std::string> ids = {status.error_message()};
    for (const v1::Calibration& calibration : response.calibrations()) {
      ids.push_back(calibration.id());
    }
    return ids;
  };
  EXPECT_THAT(list("session_ids:wave"), ElementsAre("", of_both.id(), of_wave.id()));
  EXPECT_THAT(list("session_ids:other"), ElementsAre("", of_both.id()));
  EXPECT_THAT(list("session_ids:nobody"), ElementsAre(""));
  EXPECT_THAT(list("state=STATE_FAILED AND session_ids:wave"), ElementsAre(""));
  EXPECT_THAT(list("session_ids=wave"), ElementsAre(HasSubstr("':' is expected")));
  EXPECT_THAT(list("state=DONE"), ElementsAre(HasSubstr("STATE_SUCCEEDED")));
}

TEST_F(CalibrationService, DeletesAndThenPagingGoesOn) {
  std::vector<std::string> ids;
  for (int i = 0; i < 3; ++i) {
    ASSERT_OK_AND_ASSIGN(const v1::Calibration ended, client().Calibrate("wave"));
    ids.push_back(ended.id());
  }
  v1::ListCalibrationsRequest request;
  request.set_page_size(1);
  v1::ListCalibrationsResponse response;
  {
    grpc::ClientContext context;
    SetDeadline(&context);
    ASSERT_TRUE(stub_->ListCalibrations(&context, request, &response).ok());
  }
  ASSERT_EQ(response.calibrations(0).id(), ids[2]);
  {
    grpc::ClientContext context;
    SetDeadline(&context);
    v1::DeleteCalibrationRequest erase;
    erase.set_id(ids[2]);
    v1::DeleteCalibrationResponse erased;
    ASSERT_TRUE(stub_->DeleteCalibration(&context, erase, &erased).ok());
  }
  EXPECT_THAT(Get(ids[2]), StatusIs(absl::StatusCode::kNotFound, HasSubstr(ids[2])));
  grpc::ClientContext context;
  SetDeadline(&context);
  request.set_page_token(response.next_page_token());
  ASSERT_TRUE(stub_->ListCalibrations(&context, request, &response).ok());
  ASSERT_EQ(response.calibrations_size(), 1);
  EXPECT_EQ(response.calibrations(0).id(), ids[1]);
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
  EXPECT_EQ(ended.state(), v1::Calibration::STATE_SUCCEEDED);
}

}  // namespace
}  // namespace rigcal::testing::calibration_service_test
