// SPDX-License-Identifier: Apache-2.0
// Connections that break, stall or are refused.
#include <grpcpp/grpcpp.h>

#include <chrono>
#include <memory>
#include <optional>
#include <string>

#include "common/wire/protocol_version.h"
#include "tests/agent/uplink/uplink_fixture.h"

namespace rigcal::agent::uplink_connection_test {
namespace {

using std::chrono::milliseconds;
using ::testing::HasSubstr;
using ::testing::SizeIs;

constexpr milliseconds kPatience{30'000};

class UplinkConnections : public UplinkFixture {};

TEST_F(UplinkConnections, GoesOnBehindWhatIsDurableAfterALostConnection) {
  Start();
  server_.WaitForHello(1);
  server_.StartCapture("s-1", {"left"});
  left_->YieldRows(0, 300);
  server_.WaitFor([](const State& now) { return now.At(kLeft).durable_seq == 300; });
  server_.Set([](FakeBehaviour& behaviour) { behaviour.acknowledges = false; });
  left_->YieldRows(300, 200);
  server_.WaitFor([](const State& now) { return now.At(kLeft).times_received.contains(500); });
  server_.Set([](FakeBehaviour& behaviour) { behaviour.acknowledges = true; });
  server_.Disconnect(grpc::Status(grpc::StatusCode::UNAVAILABLE, "cable"));

  const v1::AgentHello hello = server_.WaitForHello(2);
  EXPECT_EQ(hello.incarnation(), 7u);
  EXPECT_EQ(hello.connection(), 2u);
  ASSERT_EQ(hello.pending_size(), 1);
  EXPECT_EQ(hello.pending(0).session_id(), "s-1");
  EXPECT_EQ(hello.pending(0).camera(), "left");
  EXPECT_EQ(hello.pending(0).stream_epoch(), 7u);
  left_->YieldEnd();
  const State state = WaitForEnd(kLeft);
  ExpectRows(state.At(kLeft), 500);
  EXPECT_EQ(state.At(kLeft).times_received.at(300), 1u);
  EXPECT_EQ(state.At(kLeft).times_received.at(301), 2u);
  EXPECT_EQ(left_->starts(), 1);
}

TEST_F(UplinkConnections, DeliversEverythingOverAConnectionThatBreaksAgainAndAgain) {
  // Every 7th message ends the stream, half of them after having been stored.
  auto count = std::make_shared<int>(0);
  server_.Set([count](FakeBehaviour& behaviour) {
    behaviour.refuses = [count](const v1::ConnectRequest& message) -> std::optional<grpc::Status> {
      if (message.has_hello() || ++*count % 7 != 0) return std::nullopt;
      return grpc::Status(grpc::StatusCode::UNAVAILABLE, "flapping");
    };
  });
  Start();
  left_->YieldRows(0, 5000);
  left_->YieldEnd();
  right_->YieldRows(0, 3000);
  right_->YieldEnd();
  server_.WaitForHello(1);
  server_.StartCapture("s-1", {"left", "right"});
  WaitForEnd(kLeft);
  const State state = WaitForEnd(kRight);
  ExpectRows(state.At(kLeft), 5000);
  ExpectRows(state.At(kRight), 3000);
  EXPECT_GE(state.hellos.size(), 2u);
  for (size_t i = 0; i < state.hellos.size(); ++i) {
    EXPECT_EQ(state.hellos[i].connection(), i + 1);
  }
}

// As for a renewed certificate, in the middle of a capture.
TEST_F(UplinkConnections, ConnectsAgainWhenAskedAndLosesNothing) {
  Start();
  server_.WaitForHello(1);
  server_.StartCapture("s-1", {"left"});
  left_->WaitUntilStarted(1);
  for (int i = 0; i < 5; ++i) {
    left_->YieldRows(i * 200, 100);
    uplink_->Reconnect();
    left_->YieldRows(i * 200 + 100, 100);
    EXPECT_EQ(server_.WaitForHello(static_cast<size_t>(i) + 2).connection(),
              static_cast<uint32_t>(i) + 2);
  }
  left_->YieldEnd();
  ExpectRows(WaitForEnd(kLeft).At(kLeft), 1000);
}

TEST_F(UplinkConnections, DeliversEachObservationOnceInEffectThroughAServersRestart) {
  FakeServer server(0);
  const std::string address = "127.0.0.1:" + std::to_string(server.port());
  Start(QuickOptions(), "recording",
        [address](const std::string&, bool) { return Uplink::MakeChannel(address); });
  server.WaitForHello(1);
  server.StartCapture("s-1", {"left"});
  left_->YieldRows(0, 1000);
  server.WaitFor([](const State& now) { return now.At(kLeft).durable_seq >= 500; });
  server.Close();
  left_->YieldRows(1000, 1000);
  left_->YieldEnd();
  server.Listen();
  const State state = server.WaitFor([](const State& now) { return now.HasEnded(kLeft); });
  ExpectRows(state.At(kLeft), 2000);
  EXPECT_EQ(left_->starts(), 1);
  uplink_->Shutdown(kPatience);
}

TEST_F(UplinkConnections, ComesBackFromAServerThatDoesNotAnswerItsHello) {
  server_.Set([](FakeBehaviour& behaviour) { behaviour.answers_hello = false; });
  UplinkOptions options = QuickOptions();
  options.hello_timeout = milliseconds(20);
  Start(options);
  EXPECT_EQ(server_.WaitForHello(2).connection(), 2u);
  server_.Set([](FakeBehaviour& behaviour) { behaviour.answers_hello = true; });
  server_.WaitFor([](const State& now) { return now.ping_count >= 1; });
}

TEST_F(UplinkConnections, ComesBackWithAHigherConnectionFromAServerThatFellSilent) {
  UplinkOptions options = QuickOptions();
  options.ping_interval = milliseconds(5);
  options.silence_timeout = milliseconds(50);
  Start(options);
  server_.WaitForHello(1);
  server_.StartCapture("s-1", {"left"});
  left_->YieldRows(0, 20);
  server_.WaitFor([](const State& now) { return now.At(kLeft).durable_seq == 20; });
  server_.Set([](FakeBehaviour& behaviour) {
    behaviour.answers_pings = false;
    behaviour.acknowledges = false;
  });
  left_->YieldRows(20, 20);
  const v1::AgentHello hello = server_.WaitForHello(2);
  EXPECT_EQ(hello.incarnation(), 7u);
  EXPECT_EQ(hello.connection(), 2u);
  server_.Set([](FakeBehaviour& behaviour) {
    behaviour.answers_pings = true;
    behaviour.acknowledges = true;
  });
  left_->YieldEnd();
  ExpectRows(WaitForEnd(kLeft).At(kLeft), 40);
}

TEST_F(UplinkConnections, TriesAgainWhileAnotherAgentHoldsItsCamera) {
  auto refusals = std::make_shared<int>(0);
  server_.Set([refusals](FakeBehaviour& behaviour) {
    behaviour.refuses =
        [refusals](const v1::ConnectRequest& message) -> std::optional<grpc::Status> {
      if (!message.has_hello() || ++*refusals > 3) return std::nullopt;
      return grpc::Status(grpc::StatusCode::ALREADY_EXISTS, "camera left is held by pc-2");
    };
  });
  Start();
  server_.WaitForHello(4);
  server_.StartCapture("s-1", {"left"});
  left_->YieldRows(0, 2);
  left_->YieldEnd();
  ExpectRows(WaitForEnd(kLeft).At(kLeft), 2);
}

TEST_F(UplinkConnections, SaysNothingToAServerOfAnotherProtocol) {
  server_.Set(
      [](FakeBehaviour& behaviour) { behaviour.protocol_major = wire::kProtocolMajor + 1; });
  Start();
  EXPECT_EQ(server_.WaitForHello(3).connection(), 3u);
  EXPECT_EQ(server_.Now().message_count, 0u);
}

TEST_F(UplinkConnections, GivesUpAStreamTheServerDoesNotUnderstandAndDeliversTheOther) {
  server_.Set([](FakeBehaviour& behaviour) {
    behaviour.refuses = [](const v1::ConnectRequest& message) -> std::optional<grpc::Status> {
      if (!message.has_batch() || message.batch().camera() != "left") return std::nullopt;
      return grpc::Status(grpc::StatusCode::INVALID_ARGUMENT, "batch.x_px: has 3 values");
    };
  });
  Start();
  left_->YieldRows(0, 600);
  left_->YieldEnd();
  right_->YieldRows(0, 600);
  right_->YieldEnd();
  // The real server repeats the command after each connection.
  for (size_t connection = 1;; ++connection) {
    const State state = server_.WaitFor([&](const State& now) {
      return now.hellos.size() >= connection || (now.HasEnded(kLeft) && now.HasEnded(kRight));
    });
    if (state.HasEnded(kLeft) && state.HasEnded(kRight)) break;
    ASSERT_LE(connection, 10u) << "it loops";
    server_.StartCapture("s-1", {"left", "right"});
  }
  const State state = server_.Now();
  ExpectRows(state.At(kRight), 600);
  EXPECT_EQ(state.At(kLeft).end->last_seq, 0u);
  ASSERT_THAT(state.At(kLeft).end->report.refused, SizeIs(1));
  EXPECT_EQ(state.At(kLeft).end->report.refused[0].reason, RefusalReason::kProtocolFault);
  EXPECT_THAT(state.At(kLeft).end->report.refused[0].example, HasSubstr("x_px: has 3 values"));
  EXPECT_EQ(left_->starts(), 1);
}

TEST_F(UplinkConnections, TakesThePositionsOfAnotherStoreAsTheyAre) {
  Start();
  server_.WaitForHello(1);
  server_.StartCapture("s-1", {"left"});
  left_->YieldRows(0, 10);
  server_.WaitFor([](const State& now) { return now.At(kLeft).durable_seq == 10; });
  server_.Set([](FakeBehaviour& behaviour) { behaviour.server_id = "store-2"; });
  server_.Disconnect(grpc::Status(grpc::StatusCode::UNAVAILABLE, "moved"));
  server_.WaitForHello(2);
  left_->YieldRows(10, 10);
  left_->YieldEnd();
  ExpectRows(WaitForEnd(kLeft).At(kLeft), 20);
}

TEST_F(UplinkConnections, EndsWhileNoServerIsThere) {
  Start(QuickOptions(), "recording",
        [](const std::string&, bool) { return Uplink::MakeChannel("127.0.0.1:1"); });
  EXPECT_EQ(uplink_->Shutdown(kPatience).row_count, 0u);
}

}  // namespace
}  // namespace rigcal::agent::uplink_connection_test
