// SPDX-License-Identifier: Apache-2.0
// What an agent does when it is told to capture, and to end.
#include <chrono>

#include "common/wire/protocol_version.h"
#include "tests/agent/uplink/uplink_fixture.h"

namespace rigcal::agent::uplink_capture_test {
namespace {

using std::chrono::milliseconds;
using ::testing::ElementsAre;
using ::testing::SizeIs;

constexpr milliseconds kPatience{30'000};

class UplinkCapture : public UplinkFixture {};

TEST_F(UplinkCapture, SaysWhoItIsAndWhichCamerasItHas) {
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

TEST_F(UplinkCapture, DeliversACaptureToItsEnd) {
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

TEST_F(UplinkCapture, DoesNotBeginACaptureTwice) {
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

TEST_F(UplinkCapture, EndsACaptureWhenTold) {
  Start();
  server_.WaitForHello(1);
  server_.StartCapture("s-1", {"left"});
  left_->WaitUntilStarted(1);
  left_->YieldRows(0, 3);
  server_.WaitFor([](const State& now) { return now.At(kLeft).durable_seq == 3; });
  server_.StopCapture("s-1");
  EXPECT_EQ(WaitForEnd(kLeft).At(kLeft).end->last_seq, 3u);
}

TEST_F(UplinkCapture, EndsACaptureWhoseSessionEndedWhileTheServerWasAway) {
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

TEST_F(UplinkCapture, LetsASecondCaptureOfACameraWaitForTheFirst) {
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

TEST_F(UplinkCapture, NumbersBehindWhatAnEarlierLifeHasDelivered) {
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

TEST_F(UplinkCapture, IgnoresCommandsForWhatItDoesNotHave) {
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

TEST_F(UplinkCapture, DeliversWhatIsThereBeforeItEnds) {
  Start();
  server_.WaitForHello(1);
  server_.StartCapture("s-1", {"left"});
  left_->YieldRows(0, 700);
  server_.WaitFor([](const State& now) { return now.At(kLeft).durable_seq >= 1; });
  // Ends the capture wherever it is; all it has captured by then is delivered.
  EXPECT_EQ(uplink_->Shutdown(kPatience).row_count, 0u);
  const State state = server_.Now();
  ASSERT_TRUE(state.HasEnded(kLeft));
  ExpectRows(state.At(kLeft), state.At(kLeft).end->last_seq);
}

TEST_F(UplinkCapture, CountsWhatCannotBeDeliveredBeforeItEnds) {
  server_.Set([](FakeBehaviour& behaviour) { behaviour.acknowledges = false; });
  Start();
  server_.WaitForHello(1);
  server_.StartCapture("s-1", {"left"});
  left_->YieldRows(0, 7);
  server_.WaitFor([](const State& now) { return now.At(kLeft).times_received.contains(7); });
  const LeftBehind left = uplink_->Shutdown(milliseconds(20));
  EXPECT_EQ(left.row_count, 7u);
  EXPECT_THAT(left.cameras, ElementsAre("left"));
}

}  // namespace
}  // namespace rigcal::agent::uplink_capture_test
