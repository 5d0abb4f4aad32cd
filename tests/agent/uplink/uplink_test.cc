// SPDX-License-Identifier: Apache-2.0
#include "agent/uplink/uplink.h"

#include <grpcpp/grpcpp.h>

#include <algorithm>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "agent/spool/memory_spool.h"
#include "common/wire/protocol_version.h"
#include "tests/agent/uplink/fake_server.h"
#include "tests/agent/uplink/scripted_source.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::agent::uplink_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using std::chrono::milliseconds;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;
using State = FakeServer::State;

const StreamKey kLeft{"s-1", "left", 7};
const StreamKey kRight{"s-1", "right", 7};
constexpr milliseconds kPatience{30'000};

UplinkOptions QuickOptions() {
  UplinkOptions options;
  options.server = "fake";
  options.agent_id = "pc-1";
  options.incarnation = 7;
  options.host = "pc";
  options.rig = "hall";
  options.flush_interval = milliseconds(1);
  options.lowest_wait = milliseconds(1);
  options.highest_wait = milliseconds(20);
  options.refused_wait = milliseconds(5);
  return options;
}

class UplinkTest : public ::testing::Test {
 protected:
  void Start(UplinkOptions options = QuickOptions(),
             const std::string& left_timebase = "recording") {
    Start(std::move(options), left_timebase, [this] { return server_.Channel(); });
  }
  void Start(UplinkOptions options, const std::string& left_timebase,
             Uplink::ChannelFactory make_channel) {
    auto left = std::make_unique<ScriptedSource>("left", left_timebase);
    auto right = std::make_unique<ScriptedSource>("right");
    left_ = left.get();
    right_ = right.get();
    std::vector<std::unique_ptr<ObservationSource>> sources;
    sources.push_back(std::move(left));
    sources.push_back(std::move(right));
    auto uplink =
        Uplink::Create(std::move(options), std::move(sources), &spool_, std::move(make_channel));
    ASSERT_THAT(uplink, IsOk());
    uplink_ = *std::move(uplink);
    uplink_->Start();
  }
  void TearDown() override {
    if (uplink_) uplink_->Shutdown(milliseconds(0));
    server_.Close();
  }

  // Every row from 1 to `count`, each with the time the source gave it.
  static void ExpectRows(const FakeServer::Stream& stream, uint32_t count) {
    ASSERT_THAT(stream.time_of_seq, SizeIs(count));
    for (const auto& [seq, time_ns] : stream.time_of_seq) {
      ASSERT_EQ(time_ns, (int64_t{seq} - 1) * 1000) << seq;
    }
  }
  State WaitForEnd(const StreamKey& stream) {
    return server_.WaitFor([&](const State& now) { return now.HasEnded(stream); });
  }

  MemorySpool spool_;
  FakeServer server_;
  std::unique_ptr<Uplink> uplink_;
  ScriptedSource* left_ = nullptr;
  ScriptedSource* right_ = nullptr;
};

TEST_F(UplinkTest, SaysWhoItIsAndWhichCamerasItHas) {
  Start();
  const v1::AgentHello hello = server_.WaitForHello(1);
  EXPECT_EQ(hello.agent_id(), "pc-1");
  EXPECT_EQ(hello.incarnation(), 7u);
  EXPECT_EQ(hello.connection(), 1u);
  EXPECT_EQ(hello.host(), "pc");
  EXPECT_EQ(hello.rig(), "hall");
  EXPECT_EQ(hello.protocol_version().major(), wire::kProtocolMajor);
  ASSERT_EQ(hello.cameras_size(), 2);
  EXPECT_EQ(hello.cameras(0).description().camera(), "left");
  EXPECT_EQ(hello.cameras(0).description().clock().clock_id(), "left");
  EXPECT_EQ(hello.cameras(0).stream_epoch(), 7u);
  EXPECT_EQ(hello.cameras(1).description().camera(), "right");
  EXPECT_EQ(hello.pending_size(), 0);
}

TEST_F(UplinkTest, DeliversACaptureToItsEnd) {
  Start();
  server_.WaitForHello(1);
  left_->SetRefused({{"", RefusalReason::kCsvBadTime, 2, "f.csv:3: bad"}});
  left_->YieldRows(0, 1000);
  left_->YieldEnd();
  right_->YieldEnd();
  server_.StartCapture("s-1", {"left", "right"});
  WaitForEnd(kRight);
  const State state = WaitForEnd(kLeft);
  ExpectRows(state.At(kLeft), 1000);
  EXPECT_LE(state.At(kLeft).largest_batch, 256u);
  EXPECT_EQ(left_->target(), MakeTarget());
  EXPECT_EQ(state.At(kLeft).end->last_seq, 1000u);
  EXPECT_EQ(state.At(kLeft).end->report.observation_count, 1000u);
  EXPECT_THAT(state.At(kLeft).end->report.refused,
              ElementsAre(Refusal{"", RefusalReason::kCsvBadTime, 2, "f.csv:3: bad"}));
  EXPECT_EQ(state.At(kRight).end->last_seq, 0u);
  EXPECT_THAT(state.hellos, SizeIs(1));
}

TEST_F(UplinkTest, DoesNotBeginACaptureTwice) {
  Start();
  server_.WaitForHello(1);
  server_.StartCapture("s-1", {"left"});
  server_.StartCapture("s-1", {"left"});
  left_->WaitUntilStarted(1);
  left_->YieldRows(0, 5);
  server_.WaitFor([](const State& now) { return now.At(kLeft).durable_seq == 5; });
  server_.StartCapture("s-1", {"left"});
  left_->YieldEnd();
  WaitForEnd(kLeft);
  // Not even after its end; the end is repeated, in case the server has missed it.
  const uint32_t messages = server_.Now().message_count;
  server_.StartCapture("s-1", {"left"});
  server_.WaitFor([&](const State& now) { return now.message_count > messages; });
  EXPECT_EQ(left_->starts(), 1);
  ExpectRows(server_.Now().At(kLeft), 5);
}

TEST_F(UplinkTest, EndsACaptureWhenTold) {
  Start();
  server_.WaitForHello(1);
  server_.StartCapture("s-1", {"left"});
  left_->WaitUntilStarted(1);
  left_->YieldRows(0, 3);
  server_.WaitFor([](const State& now) { return now.At(kLeft).durable_seq == 3; });
  server_.StopCapture("s-1");
  EXPECT_EQ(WaitForEnd(kLeft).At(kLeft).end->last_seq, 3u);
}

TEST_F(UplinkTest, GoesOnBehindWhatIsDurableAfterALostConnection) {
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

TEST_F(UplinkTest, DeliversEverythingOverAConnectionThatBreaksAgainAndAgain) {
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

TEST_F(UplinkTest, KeepsEverythingWhileNothingIsAcknowledged) {
  server_.Set([](FakeBehaviour& behaviour) { behaviour.acknowledges = false; });
  Start();
  server_.WaitForHello(1);
  server_.StartCapture("s-1", {"left"});
  left_->YieldRows(0, 100);
  left_->YieldEnd();
  server_.WaitFor([](const State& now) { return now.At(kLeft).end.has_value(); });
  server_.Disconnect(grpc::Status(grpc::StatusCode::UNAVAILABLE, "cable"));
  server_.WaitForHello(2);
  server_.WaitFor([](const State& now) {
    const auto& received = now.At(kLeft).times_received;
    return received.contains(100) && received.at(100) == 2;
  });
  EXPECT_TRUE(spool_.Find(kLeft).has_value());
  server_.AcknowledgeAll();
  ExpectRows(WaitForEnd(kLeft).At(kLeft), 100);
}

TEST_F(UplinkTest, KeepsToItsCredit) {
  server_.Set([](FakeBehaviour& behaviour) { behaviour.window = 10; });
  Start();
  server_.WaitForHello(1);
  server_.StartCapture("s-1", {"left"});
  left_->YieldRows(0, 500);
  left_->YieldEnd();
  const State state = WaitForEnd(kLeft);
  ExpectRows(state.At(kLeft), 500);
  EXPECT_FALSE(state.At(kLeft).exceeded_credit);
}

TEST_F(UplinkTest, SendsNoMoreThanItsCreditWithoutAcknowledgement) {
  server_.Set([](FakeBehaviour& behaviour) {
    behaviour.window = 10;
    behaviour.acknowledges = false;
  });
  UplinkOptions options = QuickOptions();
  options.ping_interval = milliseconds(2);
  Start(options);
  server_.WaitForHello(1);
  server_.StartCapture("s-1", {"left"});
  left_->YieldRows(0, 500);
  server_.WaitFor([](const State& now) { return now.At(kLeft).times_received.contains(10); });
  // The connection stays, with nothing but pings.
  const uint32_t pings = server_.Now().ping_count;
  const State state =
      server_.WaitFor([&](const State& now) { return now.ping_count >= pings + 5; });
  EXPECT_THAT(state.At(kLeft).time_of_seq, SizeIs(10));
}

TEST_F(UplinkTest, KeepsToTheServersBatchLimit) {
  server_.Set([](FakeBehaviour& behaviour) { behaviour.max_batch_observations = 16; });
  Start();
  server_.WaitForHello(1);
  left_->YieldRows(0, 300);
  left_->YieldEnd();
  server_.StartCapture("s-1", {"left"});
  const State state = WaitForEnd(kLeft);
  ExpectRows(state.At(kLeft), 300);
  EXPECT_LE(state.At(kLeft).largest_batch, 16u);
}

TEST_F(UplinkTest, DropsASessionTheServerNoLongerKnows) {
  server_.Set([](FakeBehaviour& behaviour) { behaviour.acknowledges = false; });
  Start();
  server_.WaitForHello(1);
  server_.StartCapture("s-1", {"left"});
  left_->YieldRows(0, 10);
  server_.WaitFor([](const State& now) { return now.At(kLeft).times_received.contains(10); });
  server_.Set([](FakeBehaviour& behaviour) {
    behaviour.acknowledges = true;
    behaviour.unknown_sessions = {"s-1"};
  });
  server_.Disconnect(grpc::Status(grpc::StatusCode::NOT_FOUND, "session s-1 was deleted"));
  EXPECT_EQ(server_.WaitForHello(2).pending_size(), 1);
  // The camera is free for the next session at once.
  server_.WaitFor([](const State& now) { return now.ping_count >= 2; });
  server_.StartCapture("s-2", {"left"});
  left_->WaitUntilStarted(2);
  left_->YieldRows(0, 3);
  left_->YieldEnd();
  const State state = WaitForEnd({"s-2", "left", 7});
  ExpectRows(state.At({"s-2", "left", 7}), 3);
  EXPECT_EQ(state.At(kLeft).times_received.at(10), 1u);
}

TEST_F(UplinkTest, ComesBackFromAServerThatDoesNotAnswerItsHello) {
  server_.Set([](FakeBehaviour& behaviour) { behaviour.answers_hello = false; });
  UplinkOptions options = QuickOptions();
  options.hello_timeout = milliseconds(20);
  Start(options);
  EXPECT_EQ(server_.WaitForHello(2).connection(), 2u);
  server_.Set([](FakeBehaviour& behaviour) { behaviour.answers_hello = true; });
  server_.WaitFor([](const State& now) { return now.ping_count >= 1; });
}

TEST_F(UplinkTest, ComesBackWithAHigherConnectionFromAServerThatFellSilent) {
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

TEST_F(UplinkTest, TriesAgainWhileAnotherAgentHoldsItsCamera) {
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

TEST_F(UplinkTest, SaysNothingToAServerOfAnotherProtocol) {
  server_.Set(
      [](FakeBehaviour& behaviour) { behaviour.protocol_major = wire::kProtocolMajor + 1; });
  Start();
  EXPECT_EQ(server_.WaitForHello(3).connection(), 3u);
  EXPECT_EQ(server_.Now().message_count, 0u);
}

TEST_F(UplinkTest, GivesUpAStreamTheServerDoesNotUnderstandAndDeliversTheOther) {
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

TEST_F(UplinkTest, TakesThePositionsOfAnotherStoreAsTheyAre) {
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

TEST_F(UplinkTest, SendsAHostAlignmentAheadOfAClockThatNeedsIt) {
  Start(QuickOptions(), "");
  server_.WaitForHello(1);
  server_.StartCapture("s-1", {"left", "right"});
  left_->AddClockSample({10, 20, 30, 40});
  left_->YieldRows(0, 1);
  left_->YieldEnd();
  const State state = WaitForEnd(kLeft);
  ASSERT_THAT(state.At(kLeft).batches, SizeIs(1));
  const ObservationBatch& batch = state.At(kLeft).batches[0];
  EXPECT_THAT(batch.clock_samples, ElementsAre(ClockSample{10, 20, 30, 40}));
  ASSERT_THAT(batch.host_alignments, SizeIs(1));
  // The fake server's clock is this PC's.
  EXPECT_LE(std::abs(batch.host_alignments[0].server_minus_host_ns),
            batch.host_alignments[0].uncertainty_ns + 1'000'000);
}

TEST_F(UplinkTest, DeliversWithoutAlignmentWhenPingsAreNotAnswered) {
  server_.Set([](FakeBehaviour& behaviour) { behaviour.answers_pings = false; });
  UplinkOptions options = QuickOptions();
  options.alignment_timeout = milliseconds(20);
  Start(options, "");
  server_.WaitForHello(1);
  server_.StartCapture("s-1", {"left"});
  left_->YieldRows(0, 1);
  left_->YieldEnd();
  EXPECT_THAT(WaitForEnd(kLeft).At(kLeft).batches.at(0).host_alignments, IsEmpty());
}

TEST_F(UplinkTest, EndsACaptureWhoseSessionEndedWhileTheServerWasAway) {
  Start();
  server_.WaitForHello(1);
  server_.StartCapture("s-1", {"left"});
  left_->WaitUntilStarted(1);
  server_.Disconnect(grpc::Status(grpc::StatusCode::UNAVAILABLE, "cable"));
  server_.WaitForHello(2);
  // No command to continue s-1 arrives.
  server_.StartCapture("s-2", {"left"});
  left_->WaitUntilStarted(2);
  EXPECT_EQ(WaitForEnd(kLeft).At(kLeft).end->last_seq, 0u);
  left_->YieldEnd();
  WaitForEnd({"s-2", "left", 7});
}

TEST_F(UplinkTest, LetsASecondCaptureOfACameraWaitForTheFirst) {
  Start();
  server_.WaitForHello(1);
  server_.StartCapture("s-1", {"left"});
  left_->WaitUntilStarted(1);
  server_.StartCapture("s-2", {"left"});
  // A session that stops before its turn comes has its end at once.
  server_.StartCapture("s-3", {"left"});
  server_.StopCapture("s-3");
  EXPECT_EQ(WaitForEnd({"s-3", "left", 7}).At({"s-3", "left", 7}).end->last_seq, 0u);
  EXPECT_EQ(left_->starts(), 1);
  left_->YieldRows(0, 2);
  left_->YieldEnd();
  ExpectRows(WaitForEnd(kLeft).At(kLeft), 2);
  left_->WaitUntilStarted(2);
  left_->YieldRows(0, 1);
  left_->YieldEnd();
  ExpectRows(WaitForEnd({"s-2", "left", 7}).At({"s-2", "left", 7}), 1);
}

TEST_F(UplinkTest, NumbersBehindWhatAnEarlierLifeHasDelivered) {
  Start();
  server_.WaitForHello(1);
  v1::ConnectResponse message;
  v1::StartCapture* command = message.mutable_start_capture();
  command->set_session_id("s-1");
  command->mutable_target()->set_kind(v1::Target::KIND_WAND);
  command->mutable_target()->add_marker_positions_m(0);
  command->mutable_target()->add_marker_positions_m(0.3);
  v1::StreamPosition* position = command->add_cameras();
  position->mutable_stream()->set_session_id("s-1");
  position->mutable_stream()->set_camera("left");
  position->mutable_stream()->set_stream_epoch(7);
  position->set_durable_seq(40);
  position->set_send_limit_seq(1000);
  server_.Send(message);
  left_->YieldRows(0, 2);
  left_->YieldEnd();
  const State state =
      server_.WaitFor([](const State& now) { return now.At(kLeft).end.has_value(); });
  EXPECT_EQ(state.At(kLeft).end->last_seq, 42u);
  EXPECT_TRUE(state.At(kLeft).time_of_seq.contains(41));
  EXPECT_FALSE(state.At(kLeft).time_of_seq.contains(1));
}

TEST_F(UplinkTest, IgnoresCommandsForWhatItDoesNotHave) {
  Start();
  server_.WaitForHello(1);
  server_.StartCapture("s-1", {"nobody"});
  server_.StartCapture("s-1", {"left"}, 99);
  server_.StopCapture("s-9");
  server_.Send(v1::ConnectResponse());
  v1::ConnectResponse bad_target;
  bad_target.mutable_start_capture()->set_session_id("s-1");
  server_.Send(bad_target);
  v1::ConnectResponse stray_ack;
  stray_ack.mutable_ack()->set_session_id("s-9");
  stray_ack.mutable_ack()->set_camera("left");
  stray_ack.mutable_ack()->set_stream_epoch(7);
  stray_ack.mutable_ack()->set_complete(true);
  server_.Send(stray_ack);
  v1::ConnectResponse stray_pong;
  stray_pong.mutable_time_pong()->set_host_monotonic_ns(1);
  server_.Send(stray_pong);
  server_.StartCapture("s-1", {"left"});
  left_->YieldRows(0, 1);
  left_->YieldEnd();
  const State state = WaitForEnd(kLeft);
  ExpectRows(state.At(kLeft), 1);
  EXPECT_THAT(state.hellos, SizeIs(1));
}

TEST_F(UplinkTest, ReportsWhatASourceRefusesWhileItRuns) {
  UplinkOptions options = QuickOptions();
  options.report_interval = milliseconds(5);
  Start(options);
  server_.WaitForHello(1);
  left_->SetRefused({{"", RefusalReason::kCsvBadTime, 2, "f.csv:3: bad"}});
  server_.StartCapture("s-1", {"left"});
  int rows = 0;
  while (!server_.Now().At(kLeft).report) {
    left_->YieldRows(rows++, 1);
    server_.WaitFor(
        [&](const State& now) { return now.At(kLeft).durable_seq >= static_cast<uint32_t>(rows); });
  }
  EXPECT_THAT(server_.Now().At(kLeft).report->refused,
              ElementsAre(Refusal{"", RefusalReason::kCsvBadTime, 2, "f.csv:3: bad"}));
}

TEST_F(UplinkTest, DeliversWhatIsThereBeforeItEnds) {
  Start();
  server_.WaitForHello(1);
  server_.StartCapture("s-1", {"left"});
  left_->YieldRows(0, 700);
  server_.WaitFor([](const State& now) { return now.At(kLeft).durable_seq >= 1; });
  // Ends the capture wherever it is; all it has captured by then is delivered.
  EXPECT_EQ(uplink_->Shutdown(kPatience), 0u);
  const State state = server_.Now();
  ASSERT_TRUE(state.HasEnded(kLeft));
  ExpectRows(state.At(kLeft), state.At(kLeft).end->last_seq);
}

TEST_F(UplinkTest, CountsWhatCannotBeDeliveredBeforeItEnds) {
  server_.Set([](FakeBehaviour& behaviour) { behaviour.acknowledges = false; });
  Start();
  server_.WaitForHello(1);
  server_.StartCapture("s-1", {"left"});
  left_->YieldRows(0, 7);
  server_.WaitFor([](const State& now) { return now.At(kLeft).times_received.contains(7); });
  EXPECT_EQ(uplink_->Shutdown(milliseconds(20)), 7u);
}

TEST_F(UplinkTest, EndsWhileNoServerIsThere) {
  Start(QuickOptions(), "recording", [] { return Uplink::MakeChannel("127.0.0.1:1"); });
  EXPECT_EQ(uplink_->Shutdown(kPatience), 0u);
}

TEST_F(UplinkTest, DeliversEachObservationOnceInEffectThroughAServersRestart) {
  FakeServer server(0);
  const std::string address = "127.0.0.1:" + std::to_string(server.port());
  Start(QuickOptions(), "recording", [address] { return Uplink::MakeChannel(address); });
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

}  // namespace
}  // namespace rigcal::agent::uplink_test
