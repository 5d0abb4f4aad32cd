// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/status_service.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <future>
#include <string>

#include "common/wire/grpc_status.h"
#include "tests/server/rpc/rpc_fixture.h"
#include "tests/testing/process.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing::status_service_test {
namespace {

using ::testing::HasSubstr;

class StatusService : public RpcFixture {
 protected:
  v1::ServerStatus Status() {
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(60));
    v1::ServerStatus status;
    EXPECT_THAT(
        wire::FromGrpc(v1::StatusService::NewStub(channel())->GetStatus(&context, {}, &status)),
        IsOk());
    return status;
  }
};

TEST_F(StatusService, CountsWhatTheServerHas) {
  rpc_options_.ingest_queue_limit_bytes = 1000;
  RestartServer();
  StartWave({"left"});
  ASSERT_THAT(client().CreateSession(WaveRequest("second")), IsOk());
  ASSERT_THAT(client().Upload(MakeBatch({"wave", "left", 1}, 1, 10)), IsOk());
  ASSERT_THAT(client().Upload(MakeBatch({"wave", "left", 1}, 6, 12)), IsOk());
  TestAgent agent(channel(), MakeHello("pc", {"right"}));
  agent.ReadHello();
  const v1::ServerStatus status = Status();
  EXPECT_EQ(status.software_version(), "0.1.0");
  EXPECT_EQ(status.protocol_version().major(), 1u);
  EXPECT_EQ(status.server_id(), store().server_id());
  EXPECT_TRUE(status.has_start_time());
  EXPECT_EQ(status.connected_agent_count(), 1u);
  EXPECT_EQ(status.session_count(), 2u);
  EXPECT_EQ(status.capturing_session_count(), 1u);
  EXPECT_EQ(status.ingest().stored_observation_count(), 12u);
  EXPECT_EQ(status.ingest().duplicate_observation_count(), 5u);
  EXPECT_EQ(status.ingest().commit_count(), 2u);
  EXPECT_EQ(status.ingest().queue_limit_bytes(), 1000u);
  EXPECT_EQ(status.ingest().problem(), "");
  EXPECT_EQ(status.store().kind(), "sqlite");
  EXPECT_GT(status.store().size_kib(), 0u);
}

TEST_F(StatusService, SaysWhyNothingIsTaken) {
  StartWave({"left"});
  faulty().Fail("Append", absl::ResourceExhaustedError("disk full"));
  EXPECT_FALSE(client().Upload(MakeBatch({"wave", "left", 1}, 1, 10)).ok());
  EXPECT_EQ(Status().ingest().problem(), "disk full");
}

TEST_F(StatusService, ListsAgentsThatAreThereAndThatWere) {
  TestAgent first(channel(), MakeHello("first", {"left"}, 3, 4));
  first.ReadHello();
  TestAgent second(channel(), MakeHello("second", {"right"}));
  second.ReadHello();
  ASSERT_THAT(second.Finish(), IsOk());
  ASSERT_TRUE(WaitFor([&] { return Status().connected_agent_count() == 1; }));
  ASSERT_OK_AND_ASSIGN(const auto agents, client().ListAgents());
  ASSERT_EQ(agents.size(), 2u);
  EXPECT_EQ(agents[0].agent_id(), "first");
  EXPECT_TRUE(agents[0].connected());
  EXPECT_EQ(agents[0].incarnation(), 3u);
  EXPECT_EQ(agents[0].connection(), 4u);
  EXPECT_EQ(agents[0].host(), "host-of-first");
  EXPECT_EQ(agents[0].cameras(0).camera(), "left");
  EXPECT_FALSE(agents[0].has_disconnect_time());
  EXPECT_FALSE(agents[1].connected());
  EXPECT_TRUE(agents[1].has_disconnect_time());
}

class PreviewService : public RpcFixture {
 protected:
  absl::StatusOr<v1::GetPreviewResponse> Get(const std::string& camera) {
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(60));
    v1::GetPreviewRequest request;
    request.set_camera(camera);
    v1::GetPreviewResponse response;
    const absl::Status status = wire::FromGrpc(
        v1::StatusService::NewStub(channel())->GetPreview(&context, request, &response));
    if (!status.ok()) return status;
    return response;
  }
  // What the agent says to the next request.
  static v1::AgentMessage Answer(TestAgent& agent) {
    const v1::PreviewRequest request =
        agent.ReadUntil(v1::ServerMessage::kPreviewRequest).preview_request();
    EXPECT_EQ(request.camera(), "left");
    v1::AgentMessage message;
    v1::Preview* preview = message.mutable_preview();
    preview->set_request_id(request.request_id());
    preview->set_jpeg("jpeg");
    preview->mutable_info()->set_camera("left");
    preview->mutable_info()->set_outcome(v1::DETECTION_OUTCOME_WAND);
    return message;
  }
};

TEST_F(PreviewService, BringsThePictureOfAnAgentOverItsStream) {
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

TEST_F(PreviewService, AMalformedAnswerEndsTheStreamAndTheWait) {
  TestAgent agent(channel(), MakeHello("pc", {"left"}));
  agent.ReadHello();
  std::future<absl::StatusOr<v1::GetPreviewResponse>> preview =
      std::async(std::launch::async, [&] { return Get("left"); });
  v1::AgentMessage answer = Answer(agent);
  answer.mutable_preview()->clear_jpeg();
  agent.Send(answer);
  EXPECT_THAT(agent.AwaitEnd(),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("preview.jpeg")));
  EXPECT_THAT(preview.get(), StatusIs(absl::StatusCode::kAborted, HasSubstr("disconnected")));
}

TEST_F(PreviewService, AnOldAgentIsNotAsked) {
  v1::AgentHello hello = MakeHello("pc", {"left"});
  hello.mutable_protocol_version()->set_minor(0);
  TestAgent agent(channel(), hello);
  agent.ReadHello();
  EXPECT_THAT(Get("left"), StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("update")));
}

}  // namespace
}  // namespace rigcal::testing::status_service_test
