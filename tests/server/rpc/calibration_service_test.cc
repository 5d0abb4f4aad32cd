// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <memory>
#include <string>
#include <vector>

#include "common/wire/grpc_status.h"
#include "server/session/rig_book.h"
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
  EXPECT_EQ(ended.state(), v1::Calibration::STATE_CANCELLED);
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

// With one camera and a frame of its own.
CalibrationResult ResultInAFrame() {
  CalibrationResult result;
  result.cameras.resize(1);
  result.cameras[0].camera = "left";
  result.cameras[0].image_size_px = MakeCamera("left").image_size_px;
  result.cameras[0].intrinsics = *MakeCamera("left").intrinsics;
  result.cameras[0].clock_id = "left";
  result.frame.emplace().source = FrameSource::kFloor;
  result.information.emplace();
  result.information->parameters = {
      {"left", ParameterInformation::Kind::kPosition, "x", 0.001, {}}};
  return result;
}

v1::CreateCalibrationRequest OriginRequestOf(const std::string& parent) {
  v1::CreateCalibrationRequest request;
  request.mutable_options()->set_kind(v1::CalibrationOptions::KIND_ORIGIN);
  request.mutable_options()->set_parent_id(parent);
  request.mutable_options()->mutable_origin()->set_source(v1::FRAME_SOURCE_DOWN);
  request.mutable_options()->mutable_origin()->mutable_down()->set_y(1);
  return request;
}

TEST_F(CalibrationService, ANewOriginNeedsAParentAndNoSession) {
  solver_.SetOutcome(ResultInAFrame());
  ASSERT_OK_AND_ASSIGN(const v1::Calibration parent, client().Calibrate("wave"));
  v1::CreateCalibrationRequest request = OriginRequestOf(parent.id());
  request.set_reason("level");
  v1::MarkerViews* const seen = request.mutable_options()->mutable_origin()->add_measured();
  for (const char* camera : {"left", "right"}) {
    v1::MarkerView* const view = seen->add_views();
    view->set_camera(camera);
    view->set_cov_xx_px2(1);
    view->set_cov_yy_px2(1);
  }
  ASSERT_OK_AND_ASSIGN(const v1::Calibration created, Create(request));
  runner().WaitIdle();
  ASSERT_OK_AND_ASSIGN(const v1::Calibration made, Get(created.id()));
  EXPECT_EQ(made.state(), v1::Calibration::STATE_SUCCEEDED) << made.error();
  EXPECT_EQ(made.session_ids_size(), 0);
  EXPECT_EQ(made.rig(), parent.rig());
  EXPECT_EQ(made.version(), parent.version() + 1);
  EXPECT_EQ(made.reason(), "level");
  EXPECT_THAT(made.held(), ElementsAre("everything but the frame"));
  EXPECT_EQ(made.options().origin().measured_size(), 0);

  EXPECT_THAT(Create(OriginRequestOf("c-000099")),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("c-000099")));
  seen->mutable_views()->RemoveLast();
  EXPECT_THAT(Create(request), StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("1 views")));
  request = OriginRequestOf(parent.id());
  request.add_session_ids("wave");
  EXPECT_THAT(Create(request), StatusIs(absl::StatusCode::kFailedPrecondition,
                                        HasSubstr("the session has 1 of the cameras")));
  request.add_session_ids("other");
  EXPECT_THAT(Create(request), StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("of one")));
}

TEST_F(CalibrationService, AFullSolveKeepsTheFrameOfTheActiveOne) {
  v1::CreateCalibrationRequest keep;
  keep.add_session_ids("wave");
  keep.mutable_options()->set_frame(v1::CalibrationOptions::FRAME_KEEP);
  EXPECT_THAT(Create(keep),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("no frame of rig")));
  solver_.SetOutcome(ResultInAFrame());
  ASSERT_OK_AND_ASSIGN(const v1::Calibration first, client().Calibrate("wave"));
  EXPECT_EQ(first.options().frame(), v1::CalibrationOptions::FRAME_UNSPECIFIED);
  server::RigBook rigs(store_.get());
  ASSERT_THAT(rigs.Activate(first.id(), {.operator_name = "", .reason = "", .force = true}),
              IsOk());
  ASSERT_OK_AND_ASSIGN(const v1::Calibration second, client().Calibrate("wave"));
  EXPECT_EQ(second.options().frame(), v1::CalibrationOptions::FRAME_KEEP_IF_POSSIBLE);
  EXPECT_EQ(second.options().parent_id(), first.id());
  keep.mutable_options()->set_frame(v1::CalibrationOptions::FRAME_OWN);
  ASSERT_OK_AND_ASSIGN(const v1::Calibration own, Create(keep));
  EXPECT_EQ(own.options().parent_id(), "");
  runner().WaitIdle();
}

TEST_F(CalibrationService, ExplainsWhatHoldsACalibration) {
  const auto explain =
      [&](const std::string& id) -> absl::StatusOr<v1::ExplainCalibrationResponse> {
    grpc::ClientContext context;
    SetDeadline(&context);
    v1::ExplainCalibrationRequest request;
    request.set_id(id);
    v1::ExplainCalibrationResponse response;
    const absl::Status status =
        wire::FromGrpc(stub_->ExplainCalibration(&context, request, &response));
    if (!status.ok()) return status;
    return response;
  };
  EXPECT_THAT(explain("nobody"), StatusIs(absl::StatusCode::kNotFound, HasSubstr("nobody")));
  ASSERT_OK_AND_ASSIGN(const v1::Calibration without, client().Calibrate("wave"));
  EXPECT_THAT(explain(without.id()),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("keeps no figures")));
  solver_.SetOutcome(ResultInAFrame());
  ASSERT_OK_AND_ASSIGN(const v1::Calibration with, client().Calibrate("wave"));
  ASSERT_OK_AND_ASSIGN(const v1::ExplainCalibrationResponse explained, explain(with.id()));
  EXPECT_EQ(explained.id(), with.id());
  EXPECT_EQ(explained.information().parameters(0).name(), "x");
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
  EXPECT_THAT(Create(request), StatusIs(absl::StatusCode::kFailedPrecondition,
                                        AllOf(HasSubstr("'wave'"), HasSubstr("'smaller'"),
                                              HasSubstr("'left'"), HasSubstr("image size"))));
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
