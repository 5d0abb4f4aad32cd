// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <future>
#include <string>

#include "common/wire/grpc_status.h"
#include "common/wire/time_wire.h"
#include "rigcal/v1/camera_service.grpc.pb.h"
#include "tests/server/rpc/rpc_fixture.h"
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

TEST_F(CameraService, RefusesWaitsThatAreNone) {
  EXPECT_THAT(Get("left", -1), StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("max_wait")));
  EXPECT_THAT(Get("left", 1e8),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("max_wait")));
}

}  // namespace
}  // namespace rigcal::testing::camera_service_test
