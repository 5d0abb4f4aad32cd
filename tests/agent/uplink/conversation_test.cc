// SPDX-License-Identifier: Apache-2.0
#include "agent/uplink/conversation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "agent/spool/memory_spool.h"
#include "common/wire/camera_wire.h"
#include "common/wire/observation_wire.h"
#include "common/wire/protocol_version.h"
#include "tests/agent/uplink/scripted_source.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::agent::conversation_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using std::chrono::milliseconds;
using ::testing::_;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

const StreamKey kLeft{"s-1", "left", 1};

class ConversationTest : public ::testing::Test {
 protected:
  ConversationTest() {
    options_.agent_id = "pc-1";
    auto left = std::make_unique<ScriptedSource>("left");
    left_ = left.get();
    std::vector<std::unique_ptr<ObservationSource>> sources;
    sources.push_back(std::move(left));
    cameras_ = *MakePipelines(std::move(sources), &spool_, [] {});
    cameras_.at("left")->Start();
    agent_ = {.spool = &spool_,
              .cameras = &cameras_,
              .previews = &previews_,
              .detectors = &detectors_,
              .plan = &plan_};
  }
  ~ConversationTest() override {
    previews_.Shutdown();
    spool_.Shutdown();
    cameras_.at("left")->Shutdown();
  }

  // A conversation over a new connection; the agent's hello has been sent.
  Conversation Connect() {
    Conversation conversation(options_, "fake", ++connection_, &agent_, now_);
    hello_ = conversation.Hello().hello();
    return conversation;
  }
  // The server's answer to hello_: `durable_seq` of every pending stream.
  v1::ConnectResponse Greeting(uint32_t durable_seq = 0) const {
    v1::ConnectResponse message;
    v1::ServerHello* hello = message.mutable_hello();
    *hello->mutable_protocol_version() = wire::OwnProtocolVersion();
    hello->set_server_id("store-1");
    for (const v1::StreamKey& stream : hello_.pending()) {
      v1::StreamPosition* position = hello->add_positions();
      *position->mutable_stream() = stream;
      position->set_durable_seq(durable_seq);
      position->set_send_limit_seq(durable_seq + 1000);
    }
    return message;
  }
  static v1::ConnectResponse StartMessage(const std::string& session_id) {
    v1::ConnectResponse message;
    v1::StartCapture* start = message.mutable_start_capture();
    start->set_session_id(session_id);
    *start->mutable_target() = wire::ToProto(MakeTarget());
    v1::StreamPosition* position = start->add_cameras();
    *position->mutable_stream() = wire::ToProto(StreamKey{session_id, "left", 1});
    position->set_send_limit_seq(1000);
    return message;
  }
  void SpoolRows(uint32_t count) {
    ASSERT_THAT(spool_.Open(kLeft, 2, 1), IsOk());
    for (uint32_t row = 0; row < count; ++row) {
      ASSERT_THAT(spool_.Append(kLeft, MakeObservation(row * 1000, 0, 2), {}), IsOk());
    }
  }

  UplinkOptions options_;
  MemorySpool spool_;
  ScriptedSource* left_ = nullptr;
  CameraPipelines cameras_;
  PreviewWorker previews_{options_.previews, [] {}};
  DetectorLearner detectors_{{}, {{"left", nullptr}}, [] {}};
  DeliveryPlan plan_{&spool_, options_.flush_interval};
  Conversation::Agent agent_;
  Conversation::Clock::time_point now_ = Conversation::Clock::now();
  uint32_t connection_ = 0;
  v1::AgentHello hello_;
};

TEST_F(ConversationTest, BeginsWithTheAgentsHelloAndItsPendingStreams) {
  SpoolRows(3);
  const Conversation conversation = Connect();
  EXPECT_EQ(hello_.agent_id(), "pc-1");
  EXPECT_EQ(hello_.connection(), 1u);
  ASSERT_EQ(hello_.cameras_size(), 1);
  ASSERT_EQ(hello_.pending_size(), 1);
  EXPECT_EQ(hello_.pending(0).camera(), "left");
  EXPECT_FALSE(conversation.greeted());
}

TEST_F(ConversationTest, AcceptsNothingBeforeTheServersHello) {
  Conversation conversation = Connect();
  EXPECT_THAT(conversation.Handle(StartMessage("s-1"), now_),
              StatusIs(absl::StatusCode::kInternal, HasSubstr("before its hello")));
  EXPECT_EQ(left_->starts(), 0);
}

TEST_F(ConversationTest, AcceptsOneHelloThatFitsItsOwn) {
  SpoolRows(3);
  Conversation conversation = Connect();
  v1::ConnectResponse without_positions = Greeting();
  without_positions.mutable_hello()->clear_positions();
  EXPECT_THAT(conversation.Handle(without_positions, now_),
              StatusIs(absl::StatusCode::kInternal, HasSubstr("0 positions for 1")));
  v1::ConnectResponse newer = Greeting();
  newer.mutable_hello()->mutable_protocol_version()->set_major(99);
  EXPECT_THAT(conversation.Handle(newer, now_), StatusIs(absl::StatusCode::kFailedPrecondition, _));
  newer = Greeting();
  newer.mutable_hello()->mutable_protocol_version()->set_minor(wire::kProtocolMinor + 2);
  EXPECT_THAT(conversation.Handle(newer, now_),
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       AllOf(HasSubstr("speaks protocol 2.2"), HasSubstr("speaks 2.0"))));
  EXPECT_FALSE(conversation.greeted());
  newer.mutable_hello()->mutable_protocol_version()->set_minor(wire::kProtocolMinor + 1);
  EXPECT_THAT(conversation.Handle(newer, now_), IsOk());
  EXPECT_TRUE(conversation.greeted());
  EXPECT_EQ(agent_.server_id, "store-1");
  EXPECT_THAT(conversation.Handle(Greeting(), now_),
              StatusIs(absl::StatusCode::kInternal, HasSubstr("two hellos")));
}

TEST_F(ConversationTest, SendsAPingAndThenTheRowsBehindTheDurableOnes) {
  SpoolRows(5);
  Conversation conversation = Connect();
  ASSERT_THAT(conversation.Handle(Greeting(2), now_), IsOk());
  EXPECT_TRUE(conversation.Next(now_)->has_time_ping());
  now_ += options_.flush_interval;
  const std::optional<v1::ConnectRequest> rows = conversation.Next(now_);
  ASSERT_TRUE(rows && rows->has_batch());
  EXPECT_EQ(rows->batch().first_seq(), 3u);
  EXPECT_EQ(rows->batch().time_ns_size(), 3);
  EXPECT_FALSE(conversation.Next(now_));
  now_ += options_.ping_interval;
  EXPECT_TRUE(conversation.Next(now_)->has_time_ping());
}

TEST_F(ConversationTest, IgnoresAPongThatBelongsToNoPing) {
  plan_.RequireAlignment("left");
  SpoolRows(5);
  Conversation conversation = Connect();
  ASSERT_THAT(conversation.Handle(Greeting(), now_), IsOk());
  v1::ConnectResponse pong;
  pong.mutable_time_pong()->set_host_monotonic_ns(
      conversation.Next(now_)->time_ping().host_monotonic_ns() - 1);
  ASSERT_THAT(conversation.Handle(pong, now_), IsOk());
  now_ += options_.flush_interval;
  EXPECT_FALSE(conversation.Next(now_)) << "rows wait for an alignment";
  pong.mutable_time_pong()->set_host_monotonic_ns(pong.time_pong().host_monotonic_ns() + 1);
  ASSERT_THAT(conversation.Handle(pong, now_), IsOk());
  const std::optional<v1::ConnectRequest> rows = conversation.Next(now_);
  ASSERT_TRUE(rows && rows->has_batch());
  EXPECT_EQ(rows->batch().host_alignments_size(), 1);
}

TEST_F(ConversationTest, TimesOutWithoutAHelloAndInLongSilence) {
  Conversation conversation = Connect();
  EXPECT_THAT(conversation.CheckTimeouts(now_ + options_.hello_timeout - milliseconds(1)), IsOk());
  EXPECT_THAT(conversation.CheckTimeouts(now_ + options_.hello_timeout),
              StatusIs(absl::StatusCode::kDeadlineExceeded, HasSubstr("no answer")));
  EXPECT_EQ(conversation.NextDeadline(now_, true), now_ + options_.hello_timeout);
  ASSERT_THAT(conversation.Handle(Greeting(), now_), IsOk());
  EXPECT_THAT(conversation.CheckTimeouts(now_ + options_.hello_timeout), IsOk());
  EXPECT_THAT(conversation.CheckTimeouts(now_ + options_.silence_timeout),
              StatusIs(absl::StatusCode::kDeadlineExceeded, HasSubstr("silent")));
  EXPECT_EQ(conversation.NextDeadline(now_, false), now_ + options_.silence_timeout);
}

TEST_F(ConversationTest, IsGoodOnceSomethingBecameDurableOrItStoodForAWhile) {
  SpoolRows(3);
  Conversation conversation = Connect();
  ASSERT_THAT(conversation.Handle(Greeting(), now_), IsOk());
  EXPECT_FALSE(conversation.IsGood(now_));
  EXPECT_TRUE(conversation.IsGood(now_ + std::chrono::seconds(10)));
  BatchAck ack;
  ack.stream = kLeft;
  ack.durable_seq = 2;
  v1::ConnectResponse message;
  *message.mutable_ack() = wire::ToProto(ack);
  ASSERT_THAT(conversation.Handle(message, now_), IsOk());
  EXPECT_TRUE(conversation.IsGood(now_));
}

TEST_F(ConversationTest, EndsACaptureWhoseSessionEndedBetweenTwoConnections) {
  {
    Conversation first = Connect();
    ASSERT_THAT(first.Handle(Greeting(), now_), IsOk());
    ASSERT_THAT(first.Handle(StartMessage("s-1"), now_), IsOk());
    left_->WaitUntilStarted(1);
  }
  Conversation second = Connect();
  ASSERT_THAT(second.Handle(Greeting(), now_), IsOk());
  ASSERT_THAT(second.Handle(StartMessage("s-2"), now_), IsOk());
  left_->WaitUntilStarted(2);
  EXPECT_THAT(cameras_.at("left")->Sessions(), ElementsAre("s-2"));
}

}  // namespace
}  // namespace rigcal::agent::conversation_test
