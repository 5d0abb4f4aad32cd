// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <future>
#include <string>

#include "common/wire/detector_wire.h"
#include "common/wire/grpc_status.h"
#include "common/wire/time_wire.h"
#include "rigcal/v1/agent_service.grpc.pb.h"
#include "rigcal/v1/camera_service.grpc.pb.h"
#include "tests/server/rpc/rpc_fixture.h"
#include "tests/testing/process.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing::camera_service_test {
namespace {

using ::testing::HasSubstr;

class CameraService : public RpcFixture {
 protected:
  absl::StatusOr<v1::GetPreviewResponse> Get(const std::string& camera, double max_wait_s = 0) {
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(60));
    v1::GetPreviewRequest request;
    request.set_camera(camera);
    *request.mutable_max_wait() = wire::ToDuration(max_wait_s);
    v1::GetPreviewResponse response;
    const absl::Status status = wire::FromGrpc(
        v1::CameraService::NewStub(channel())->GetPreview(&context, request, &response));
    if (!status.ok()) return status;
    return response;
  }
  // What the agent says to the next request.
  static v1::ConnectRequest Answer(TestAgent& agent) {
    const v1::PreviewRequest request =
        agent.ReadUntil(v1::ConnectResponse::kPreviewRequest).preview_request();
    EXPECT_EQ(request.camera(), "left");
    v1::ConnectRequest message;
    v1::Preview* preview = message.mutable_preview();
    preview->set_request_id(request.request_id());
    preview->set_status(v1::PREVIEW_STATUS_OK);
    preview->set_jpeg("jpeg");
    preview->mutable_info()->set_camera("left");
    preview->mutable_info()->set_outcome(v1::DETECTION_OUTCOME_WAND);
    return message;
  }
};

TEST_F(CameraService, BringsThePreviewOfAnAgentOverItsStream) {
  TestAgent agent(channel(), MakeHello("pc", {"left"}));
  agent.ReadHello();
  std::future<absl::StatusOr<v1::GetPreviewResponse>> preview =
      std::async(std::launch::async, [&] { return Get("left"); });
  agent.Send(Answer(agent));
  ASSERT_OK_AND_ASSIGN(const v1::GetPreviewResponse response, preview.get());
  EXPECT_EQ(response.agent_id(), "pc");
  EXPECT_EQ(response.jpeg(), "jpeg");
  EXPECT_EQ(response.info().jpeg_bytes(), 4u);
  EXPECT_EQ(response.info().outcome(), v1::DETECTION_OUTCOME_WAND);
  EXPECT_THAT(Get("right"), StatusIs(absl::StatusCode::kNotFound, HasSubstr("rig/left")));
}

TEST_F(CameraService, AMalformedAnswerEndsTheStreamAndTheWait) {
  TestAgent agent(channel(), MakeHello("pc", {"left"}));
  agent.ReadHello();
  std::future<absl::StatusOr<v1::GetPreviewResponse>> preview =
      std::async(std::launch::async, [&] { return Get("left"); });
  v1::ConnectRequest answer = Answer(agent);
  answer.mutable_preview()->clear_jpeg();
  agent.Send(answer);
  EXPECT_THAT(agent.AwaitEnd(),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("preview.jpeg")));
  EXPECT_THAT(preview.get(), StatusIs(absl::StatusCode::kAborted, HasSubstr("disconnected")));
}

TEST_F(CameraService, BringsTheDetectorOfAnAgentOverItsStream) {
  TestAgent agent(channel(), MakeHello("pc", {"left"}));
  agent.ReadHello();
  v1::LearnMaskRequest request;
  request.set_camera("left");
  request.set_frame_count(30);
  v1::LearnMaskResponse response;
  std::future<absl::Status> learn = std::async(std::launch::async, [&] {
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(60));
    return wire::FromGrpc(
        v1::CameraService::NewStub(channel())->LearnMask(&context, request, &response));
  });
  const v1::DetectorRequest asked =
      agent.ReadUntil(v1::ConnectResponse::kDetectorRequest).detector_request();
  EXPECT_EQ(asked.camera(), "left");
  EXPECT_EQ(asked.command(), v1::DETECTOR_COMMAND_LEARN_MASK);
  EXPECT_EQ(asked.frame_count(), 30u);
  v1::ConnectRequest message;
  DetectorAnswer answer{.request_id = asked.request_id(), .status = {}, .state = {}};
  answer.state.ignored_pixel_count = 5;
  *message.mutable_detector_answer() = wire::ToProto(answer);
  agent.Send(message);
  ASSERT_THAT(learn.get(), IsOk());
  EXPECT_EQ(response.agent_id(), "pc");
  EXPECT_EQ(response.rig(), "rig");
  EXPECT_EQ(response.detector().ignored_pixel_count(), 5u);
  EXPECT_EQ(response.detector().colour().value_min(), 60u);
}

TEST_F(CameraService, AnAgentWithoutACameraOffersSomeAndIsAskedToUseOne) {
  TestAgent agent(channel(), MakeHello("pc", {}));
  agent.ReadHello();
  v1::ConnectRequest message;
  v1::OfferedCamera* const offered = message.mutable_offer()->add_cameras();
  offered->set_device("2345");
  offered->set_kind("aravis");
  offered->set_use(v1::OfferedCamera::USE_FREE);
  agent.Send(message);
  const auto list = [this] {
    grpc::ClientContext context;
    v1::ListAgentsResponse response;
    EXPECT_TRUE(v1::AgentService::NewStub(channel())->ListAgents(&context, {}, &response).ok());
    return response;
  };
  ASSERT_TRUE(WaitFor([&] { return list().agents(0).offered_size() == 1; }));
  EXPECT_EQ(list().agents(0).offered(0).device(), "2345");

  auto used = std::async(std::launch::async, [&]() -> absl::StatusOr<v1::UseCameraResponse> {
    grpc::ClientContext context;
    v1::UseCameraRequest request;
    request.set_device("2345");
    request.set_camera("left");
    request.set_calibration_yaml("lens");
    v1::UseCameraResponse response;
    const absl::Status status = wire::FromGrpc(
        v1::CameraService::NewStub(channel())->UseCamera(&context, request, &response));
    if (!status.ok()) return status;
    return response;
  });
  const v1::ChoiceRequest asked =
      agent.ReadUntil(v1::ConnectResponse::kChoiceRequest).choice_request();
  EXPECT_EQ(asked.device(), "2345");
  EXPECT_EQ(asked.camera(), "left");
  EXPECT_EQ(asked.calibration_yaml(), "lens");
  message.mutable_choice_answer()->set_request_id(asked.request_id());
  message.mutable_choice_answer()->set_status(v1::CHOICE_STATUS_OK);
  agent.Send(message);
  ASSERT_OK_AND_ASSIGN(const v1::UseCameraResponse response, used.get());
  EXPECT_EQ(response.agent_id(), "pc");
  EXPECT_EQ(response.rig(), "rig");
  EXPECT_EQ(response.camera(), "left");

  message.mutable_offer()->add_cameras();
  agent.Send(message);
  EXPECT_THAT(agent.AwaitEnd(),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("offer.cameras[0].device")));
  ASSERT_TRUE(WaitFor([&] { return list().agents(0).offered().empty(); }));
}

TEST_F(CameraService, RefusesAColourThatIsNone) {
  grpc::ClientContext context;
  v1::SetDetectorColourRequest request;
  request.set_camera("left");
  request.mutable_colour()->set_hue_min_deg(400);
  v1::SetDetectorColourResponse response;
  EXPECT_THAT(wire::FromGrpc(v1::CameraService::NewStub(channel())->SetDetectorColour(
                  &context, request, &response)),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("hue_min is 400")));
}

TEST_F(CameraService, RefusesWaitsThatAreNone) {
  EXPECT_THAT(Get("left", -1), StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("max_wait")));
  EXPECT_THAT(Get("left", 1e8),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("max_wait")));
}

}  // namespace
}  // namespace rigcal::testing::camera_service_test
