// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/agent_stream.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <future>
#include <limits>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "common/wire/observation_wire.h"
#include "common/wire/protocol_version.h"
#include "server/session/utc_clock.h"
#include "tests/server/rpc/rpc_fixture.h"
#include "tests/testing/process.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing::agent_stream_test {
namespace {

using ::testing::AllOf;
using ::testing::AnyOf;
using ::testing::HasSubstr;
using ::testing::SizeIs;

const StreamKey kLeft{"wave", "left", 1};

class AgentStream : public RpcFixture {
 protected:
  // An agent with camera left, told to capture for "wave".
  std::unique_ptr<TestAgent> CapturingAgent() {
    auto agent = std::make_unique<TestAgent>(channel(), MakeHello("pc", {"left"}));
    agent->ReadHello();
    StartWave();
    EXPECT_EQ(agent->ReadStart().session_id(), "wave");
    return agent;
  }
};

TEST_F(AgentStream, AnswersTheHelloWithLimitsAndIdentity) {
  TestAgent agent(channel(), MakeHello("pc", {"left"}));
  const v1::ServerHello hello = agent.ReadHello();
  EXPECT_EQ(hello.server_id(), store().server_id());
  EXPECT_EQ(hello.protocol_version().major(), wire::kProtocolMajor);
  EXPECT_EQ(hello.max_message_bytes(), 4u << 20);
  EXPECT_GT(hello.max_batch_observations(), 0u);
  EXPECT_THAT(directory_of_agents_->ConnectedCameraNames("rig"), ::testing::ElementsAre("left"));
  EXPECT_THAT(agent.Finish(), IsOk());
  EXPECT_TRUE(WaitFor([&] { return directory_of_agents_->ConnectedCount() == 0; }));
}

TEST_F(AgentStream, RefusesOtherVersionsNamingBoth) {
  v1::AgentHello hello = MakeHello("pc", {"left"});
  hello.mutable_protocol_version()->set_major(9);
  TestAgent agent(channel(), hello);
  EXPECT_THAT(agent.AwaitEnd(),
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       AllOf(HasSubstr("'pc'"), HasSubstr("9.0"), HasSubstr("2.0"))));
}

TEST_F(AgentStream, RefusesMalformedHellosWithTheField) {
  const std::vector<std::pair<std::function<void(v1::AgentHello*)>, std::string>> cases = {
      {[](auto* hello) { hello->clear_agent_id(); }, "hello.agent_id"},
      {[](auto* hello) { hello->set_rig("a b"); }, "hello.rig"},
      {[](auto* hello) { hello->set_host(std::string(100'000, 'x')); }, "hello.host"},
      {[](auto* hello) { hello->mutable_cameras(0)->set_stream_epoch(0); },
       "hello.cameras[0].stream_epoch"},
      {[](auto* hello) { hello->mutable_cameras(0)->clear_description(); },
       "hello.cameras[0].description"},
      {[](auto* hello) {
         hello->mutable_cameras(0)->mutable_description()->mutable_intrinsics()->set_fx_px(-1);
       },
       "hello.cameras[0].description"},
      {[](auto* hello) { hello->add_pending(); }, "hello.pending[0]"},
  };
  for (const auto& [damage, said] : cases) {
    v1::AgentHello hello = MakeHello("pc", {"left"});
    damage(&hello);
    TestAgent agent(channel(), hello);
    EXPECT_THAT(agent.AwaitEnd(), StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr(said)));
  }
}

TEST_F(AgentStream, TheFirstMessageMustBeAHelloAndTheOnlyOne) {
  TestAgent silent(channel());
  silent.SendBatch(MakeBatch(kLeft, 1, 3));
  EXPECT_THAT(silent.AwaitEnd(), StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("hello")));
  TestAgent twice(channel(), MakeHello("pc", {"left"}));
  v1::ConnectRequest again;
  *again.mutable_hello() = MakeHello("pc", {"left"}, 1, 2);
  twice.Send(again);
  EXPECT_THAT(twice.AwaitEnd(), StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("already")));
  TestAgent empty(channel(), MakeHello("pc", {"left"}, 1, 3));
  empty.Send(v1::ConnectRequest());
  EXPECT_THAT(empty.AwaitEnd(), StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("not set")));
}

TEST_F(AgentStream, AStreamWithoutAHelloIsClosed) {
  rpc_options_.agents.hello_timeout = std::chrono::milliseconds(20);
  RestartServer();
  TestAgent agent(channel());
  EXPECT_THAT(agent.AwaitEnd(), StatusIs(absl::StatusCode::kDeadlineExceeded, HasSubstr("hello")));
}

TEST_F(AgentStream, ATakenCameraIsRefusedNamingBothAgents) {
  TestAgent first(channel(), MakeHello("first", {"left"}));
  first.ReadHello();
  TestAgent second(channel(), MakeHello("second", {"left"}));
  EXPECT_THAT(second.AwaitEnd(),
              StatusIs(absl::StatusCode::kAlreadyExists,
                       AllOf(HasSubstr("'first'"), HasSubstr("'second'"), HasSubstr("rig/left"))));
  EXPECT_THAT(first.Finish(), IsOk());
}

TEST_F(AgentStream, TheSameAgentComesBackOverItsHalfDeadStream) {
  auto first = CapturingAgent();
  first->SendBatch(MakeBatch(kLeft, 1, 10));
  first->ReadAck("left", 10);
  // A higher connection, then a higher incarnation.
  TestAgent second(channel(), MakeHello("pc", {"left"}, 1, 2));
  EXPECT_EQ(second.ReadStart().cameras(0).durable_seq(), 10u);
  EXPECT_THAT(first->AwaitEnd(), StatusIs(absl::StatusCode::kAborted, HasSubstr("connection 2")));
  TestAgent third(channel(), MakeHello("pc", {"left"}, 2, 1));
  EXPECT_EQ(third.ReadStart().cameras(0).durable_seq(), 10u);
  EXPECT_THAT(second.AwaitEnd(), StatusIs(absl::StatusCode::kAborted, HasSubstr("incarnation 2")));
  // The one before that must not take it back.
  TestAgent stale(channel(), MakeHello("pc", {"left"}, 1, 9));
  EXPECT_THAT(stale.AwaitEnd(), StatusIs(absl::StatusCode::kAborted, HasSubstr("incarnation 2")));
  third.SendBatch(MakeBatch(kLeft, 11, 12));
  EXPECT_EQ(third.ReadAck("left", 12).durable_seq(), 12u);
}

TEST_F(AgentStream, AcknowledgesWhatIsDurableWithCredit) {
  auto agent = CapturingAgent();
  agent->SendBatch(MakeBatch(kLeft, 1, 16));
  const v1::BatchAck ack = agent->ReadAck("left", 16);
  EXPECT_EQ(ack.session_id(), "wave");
  EXPECT_EQ(ack.stream_epoch(), 1u);
  EXPECT_EQ(ack.send_limit_seq(), 16 + ingest_options_.send_window);
  EXPECT_THAT(ReadRows(store(), "wave"), SizeIs(16));
}

TEST_F(AgentStream, RepeatedAndReorderedBatchesAreStoredOnce) {
  auto agent = CapturingAgent();
  for (const auto& [first, last] :
       std::vector<std::pair<uint32_t, uint32_t>>{{21, 30}, {1, 10}, {1, 10}, {5, 20}, {11, 30}}) {
    agent->SendBatch(MakeBatch(kLeft, first, last));
  }
  agent->ReadAck("left", 30);
  agent->Send(EndMessage(kLeft, 30));
  while (!agent->ReadAck("left", 30).complete()) {
  }
  EXPECT_THAT(ReadRows(store(), "wave"), SizeIs(30));
  EXPECT_EQ(AwaitState("wave", v1::Session::STATE_FINISHED).observation_count(), 30u);
}

TEST_F(AgentStream, FaultsInDataAreAnsweredAndDoNotStopTheStream) {
  auto agent = CapturingAgent();
  ObservationBatch batch = MakeBatch(kLeft, 1, 20);
  batch.x_px[3 * 3 + 1] = std::numeric_limits<float>::quiet_NaN();
  batch.visible_mask[3] = 7;
  batch.centre_kind[3 * 3 + 1] = 1;
  agent->SendBatch(batch);
  const v1::BatchAck ack = agent->ReadAck("left", 20);
  EXPECT_EQ(ack.fault_count(), 1u);
  ASSERT_EQ(ack.faults_size(), 1);
  EXPECT_EQ(ack.faults(0).seq(), 4u);
  EXPECT_EQ(ack.faults(0).field(), "x_px[10]");
  agent->SendBatch(MakeBatch(kLeft, 21, 22));
  EXPECT_EQ(agent->ReadAck("left", 22).fault_count(), 0u);
  const auto session = client().GetSession("wave");
  ASSERT_THAT(session, IsOk());
  ASSERT_EQ(session->cameras(0).refused_size(), 1);
  EXPECT_EQ(session->cameras(0).refused(0).count(), 1u);
}

TEST_F(AgentStream, FaultsInProtocolCloseTheStreamWithTheField) {
  const std::vector<std::pair<std::function<void(v1::ObservationBatch*)>, std::string>> cases = {
      {[](auto* batch) { batch->mutable_y_px()->RemoveLast(); }, "batch.y_px"},
      {[](auto* batch) { batch->set_visible_mask(0, 0xff); }, "batch.visible_mask[0]"},
      {[](auto* batch) { batch->mutable_centre_kind()->Set(0, static_cast<v1::CentreKind>(77)); },
       "batch.centre_kind[0]"},
      {[](auto* batch) { batch->clear_session_id(); }, "session_id"},
      {[](auto* batch) { batch->set_stream_epoch(0); }, "stream_epoch"},
      {[](auto* batch) { wire::ToProto(MakeBatch(kLeft, 1, 9000), batch); }, "batch.time_ns"},
  };
  auto agent = CapturingAgent();
  uint32_t connection = 2;
  for (const auto& [damage, said] : cases) {
    TestAgent next(channel(), MakeHello("pc", {"left"}, 1, connection++));
    next.ReadStart();
    v1::ConnectRequest message = BatchMessage(MakeBatch(kLeft, 1, 4));
    damage(message.mutable_batch());
    next.Send(message);
    EXPECT_THAT(next.AwaitEnd(), StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr(said)));
  }
  EXPECT_THAT(ReadRows(store(), "wave"), SizeIs(0));
}

TEST_F(AgentStream, TheMarkersMustBeThoseOfTheTarget) {
  auto agent = CapturingAgent();
  ObservationBatch batch;
  batch.stream = {"wave", "left", 1};
  batch.marker_count = 1;
  Observation observation;
  observation.markers.resize(1);
  batch.Append(observation);
  agent->SendBatch(batch);
  EXPECT_THAT(agent->AwaitEnd(),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("marker_count")));
}

TEST_F(AgentStream, OnlyAnnouncedCamerasMayBeDelivered) {
  auto agent = CapturingAgent();
  agent->SendBatch(MakeBatch({"wave", "right", 1}, 1, 3));
  EXPECT_THAT(agent->AwaitEnd(), StatusIs(absl::StatusCode::kPermissionDenied,
                                          AllOf(HasSubstr("'right'"), HasSubstr("'pc'"))));
}

TEST_F(AgentStream, CamerasOfAnotherRigsSessionMayNotBeDelivered) {
  auto agent = CapturingAgent();
  v1::AgentHello hello = MakeHello("intruder", {"left"});
  hello.set_rig("other");
  TestAgent intruder(channel(), hello);
  intruder.ReadHello();
  intruder.SendBatch(MakeBatch(kLeft, 1, 3));
  EXPECT_THAT(intruder.AwaitEnd(), StatusIs(absl::StatusCode::kPermissionDenied,
                                            AllOf(HasSubstr("'other'"), HasSubstr("'wave'"))));
}

TEST_F(AgentStream, AnUnknownSessionIsNamed) {
  TestAgent agent(channel(), MakeHello("pc", {"left"}));
  agent.ReadHello();
  agent.SendBatch(MakeBatch({"nobody", "left", 1}, 1, 3));
  EXPECT_THAT(agent.AwaitEnd(), StatusIs(absl::StatusCode::kNotFound, HasSubstr("nobody")));
}

TEST_F(AgentStream, TellsWhereEachPendingStreamStands) {
  auto first = CapturingAgent();
  first->SendBatch(MakeBatch(kLeft, 1, 12));
  first->ReadAck("left", 12);
  RestartServer();
  v1::AgentHello hello = MakeHello("pc", {"left"}, 1, 2);
  *hello.add_pending() = wire::ToProto(StreamKey{"gone", "left", 1});
  *hello.add_pending() = wire::ToProto(kLeft);
  TestAgent agent(channel(), hello);
  const v1::ServerHello answer = agent.ReadHello();
  ASSERT_EQ(answer.positions_size(), 2);
  EXPECT_TRUE(answer.positions(0).unknown());
  EXPECT_EQ(answer.positions(1).durable_seq(), 12u);
  EXPECT_EQ(answer.positions(1).send_limit_seq(), 12 + ingest_options_.send_window);
  // After a restart the session goes on; what is repeated is stored once.
  EXPECT_EQ(agent.ReadStart().cameras(0).durable_seq(), 12u);
  agent.SendBatch(MakeBatch(kLeft, 5, 20));
  agent.Send(EndMessage(kLeft, 20));
  agent.ReadAck("left", 20);
  EXPECT_EQ(AwaitState("wave", v1::Session::STATE_FINISHED).observation_count(), 20u);
}

TEST_F(AgentStream, IsToldToStopAndThenEndsTheSession) {
  auto agent = CapturingAgent();
  ASSERT_THAT(client().StopSession("wave", 60), IsOk());
  EXPECT_EQ(agent->ReadUntil(v1::ConnectResponse::kStopCapture).stop_capture().session_id(),
            "wave");
  agent->Send(EndMessage(kLeft, 0));
  const v1::Session finished = AwaitState("wave", v1::Session::STATE_FINISHED);
  EXPECT_EQ(finished.missing_cameras_size(), 0);
  EXPECT_TRUE(finished.cameras(0).ended());
}

TEST_F(AgentStream, ReportsAreKeptWithTheSession) {
  auto agent = CapturingAgent();
  v1::ConnectRequest message;
  CameraReport report{.stream = kLeft, .observation_count = 5, .refused = {}};
  report.refused.push_back({.camera = "",
                            .reason = RefusalReason::kCsvFieldCount,
                            .count = 2,
                            .example = "left.csv:7: 5 fields"});
  *message.mutable_report() = wire::ToProto(report);
  agent->Send(message);
  agent->SendBatch(MakeBatch(kLeft, 1, 3));
  agent->ReadAck("left", 3);
  const auto session = client().GetSession("wave");
  ASSERT_THAT(session, IsOk());
  ASSERT_EQ(session->cameras(0).refused_size(), 1);
  EXPECT_EQ(session->cameras(0).refused(0).reason(), v1::REFUSAL_REASON_CSV_FIELD_COUNT);
  EXPECT_EQ(session->cameras(0).refused(0).example(), "left.csv:7: 5 fields");
}

TEST_F(AgentStream, AnAuditHasTheAgentsLastWordsBeforeTheyAreStored) {
  auto agent = CapturingAgent();
  agent->SendBatch(MakeBatch(kLeft, 1, 3));
  agent->ReadAck("left", 3);
  // The disk is slow from now on.
  std::promise<void> release;
  const std::shared_future<void> released = release.get_future().share();
  faulty().OnCall("Append", [released] { released.wait(); });
  v1::ConnectRequest message;
  CameraReport report{.stream = kLeft, .observation_count = 50, .refused = {}};
  report.spool = SpoolReport{.last_seq = 50, .acknowledged_seq = 3, .spooled_count = 47};
  *message.mutable_report() = wire::ToProto(report);
  agent->Send(message);
  const auto stub = v1::SessionService::NewStub(channel());
  v1::GetSessionResponse response;
  const auto audit = [&] {
    grpc::ClientContext context;
    v1::GetSessionRequest request;
    request.set_id("wave");
    request.set_audit(true);
    return stub->GetSession(&context, request, &response).ok() && response.audit_size() == 1 &&
           response.audit(0).reported().last_seq() == 50;
  };
  EXPECT_TRUE(WaitFor(audit));
  EXPECT_EQ(response.audit(0).reported().spooled_count(), 47u);
  EXPECT_EQ(response.audit(0).stored_count(), 3u);
  EXPECT_FALSE(response.audit(0).ended());
  EXPECT_EQ(response.audit(0).holder(), v1::StreamAudit::HOLDER_CONNECTED);
  // They stay when the agent is gone.
  agent->Cancel();
  EXPECT_TRUE(WaitFor(
      [&] { return audit() && response.audit(0).holder() == v1::StreamAudit::HOLDER_AWAY; }));
  release.set_value();
  faulty().OnCall("Append", nullptr);
}

TEST_F(AgentStream, AnswersPingsWithItsTime) {
  TestAgent agent(channel(), MakeHello("pc", {"left"}));
  const int64_t before = server::UtcNowNs({});
  for (int64_t i = 1; i <= 3; ++i) {
    v1::ConnectRequest ping;
    ping.mutable_time_ping()->set_host_monotonic_ns(i);
    agent.Send(ping);
    const v1::TimePong pong = agent.ReadUntil(v1::ConnectResponse::kTimePong).time_pong();
    EXPECT_EQ(pong.host_monotonic_ns(), i);
    EXPECT_GE(pong.server_utc_ns(), before);
  }
}

TEST_F(AgentStream, AFullQueueHoldsTheStreamAndLosesNothing) {
  // One delivery fills the queue, and the disk is slow.
  ingest_options_.queue_limit_bytes = 1;
  RestartServer();
  faulty().OnCall("Append", [] { std::this_thread::sleep_for(std::chrono::milliseconds(2)); });
  auto agent = CapturingAgent();
  for (uint32_t i = 0; i < 100; ++i) agent->SendBatch(MakeBatch(kLeft, 10 * i + 1, 10 * i + 10));
  agent->Send(EndMessage(kLeft, 1000));
  agent->ReadAck("left", 1000);
  EXPECT_EQ(AwaitState("wave", v1::Session::STATE_FINISHED).observation_count(), 1000u);
}

TEST_F(AgentStream, AFullDiskEndsTheStreamAndTheComebackGoesOn) {
  auto agent = CapturingAgent();
  faulty().Fail("Append", absl::ResourceExhaustedError("disk full"));
  agent->SendBatch(MakeBatch(kLeft, 1, 10));
  EXPECT_THAT(agent->AwaitEnd(),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("disk full")));
  faulty().Fail("Append", absl::OkStatus());
  TestAgent back(channel(), MakeHello("pc", {"left"}, 1, 2));
  EXPECT_EQ(back.ReadStart().cameras(0).durable_seq(), 0u);
  back.SendBatch(MakeBatch(kLeft, 1, 10));
  EXPECT_EQ(back.ReadAck("left", 10).durable_seq(), 10u);
}

TEST_F(AgentStream, HalfClosingWaitsForTheLastAcknowledgement) {
  auto agent = CapturingAgent();
  for (uint32_t i = 0; i < 20; ++i) agent->SendBatch(MakeBatch(kLeft, 10 * i + 1, 10 * i + 10));
  EXPECT_THAT(agent->Finish(), IsOk());
  EXPECT_THAT(ReadRows(store(), "wave"), SizeIs(200));
}

TEST_F(AgentStream, StreamsThatGoInTheMiddleLeaveNothingBehind) {
  StartWave({"by_hand"});
  for (uint32_t i = 1; i <= 50; ++i) {
    TestAgent agent(channel(), MakeHello("pc", {"left"}, 1, i));
    if (i % 2 == 0) agent.SendBatch(MakeBatch(kLeft, 1, 3));
    if (i % 3 == 0) agent.Cancel();
  }
  EXPECT_TRUE(WaitFor([&] { return directory_of_agents_->ConnectedCount() == 0; }));
  // The server ends when every stream has.
  RestartServer();
  TestAgent agent(channel(), MakeHello("pc", {"left"}));
  agent.ReadHello();
}

TEST_F(AgentStream, ManyAgentsAtOnce) {
  constexpr int kAgents = 8;
  constexpr uint32_t kRows = 500;
  std::vector<std::unique_ptr<TestAgent>> agents;
  for (int i = 0; i < kAgents; ++i) {
    const std::string n = std::to_string(i);
    agents.push_back(std::make_unique<TestAgent>(channel(), MakeHello("pc-" + n, {"camera_" + n})));
    agents.back()->ReadHello();
  }
  StartWave();
  std::vector<std::thread> threads;
  for (int i = 0; i < kAgents; ++i) {
    threads.emplace_back([&, i] {
      const StreamKey stream{"wave", "camera_" + std::to_string(i), 1};
      agents[i]->ReadStart();
      for (uint32_t seq = 1; seq <= kRows; seq += 10) {
        agents[i]->SendBatch(MakeBatch(stream, seq, seq + 9));
      }
      agents[i]->Send(EndMessage(stream, kRows));
      agents[i]->ReadAck(stream.camera, kRows);
    });
  }
  for (std::thread& thread : threads) thread.join();
  const v1::Session finished = AwaitState("wave", v1::Session::STATE_FINISHED);
  EXPECT_EQ(finished.observation_count(), kAgents * kRows);
  EXPECT_EQ(finished.missing_cameras_size(), 0);
}

TEST_F(AgentStream, IsToldWhenTheServerGoes) {
  RestartServerOnPort();
  auto agent = CapturingAgent();
  std::thread closer([this] { rpc_->Shutdown(std::chrono::seconds(5)); });
  EXPECT_THAT(agent->AwaitEnd(),
              StatusIs(absl::StatusCode::kUnavailable, HasSubstr("shutting down")));
  closer.join();
}

}  // namespace
}  // namespace rigcal::testing::agent_stream_test
