// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/outgoing_messages.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace rigcal::testing::outgoing_messages_test {
namespace {

using server::OutgoingMessages;

BatchAck Ack(const std::string& camera, uint32_t durable_seq, uint32_t faults = 0) {
  BatchAck ack{.stream = {"wave", camera, 1},
               .durable_seq = durable_seq,
               .send_limit_seq = durable_seq + 100,
               .faults = {},
               .fault_count = faults,
               .complete = false};
  for (uint32_t i = 0; i < faults; ++i) {
    ack.faults.push_back(
        {.seq = durable_seq - i, .field = "x_px[0]", .reason = RefusalReason::kNotFinite});
  }
  return ack;
}

v1::ConnectResponse Stop(const std::string& session) {
  v1::ConnectResponse message;
  message.mutable_stop_capture()->set_session_id(session);
  return message;
}

// Everything that may be written now.
std::vector<v1::ConnectResponse> Drain(OutgoingMessages* outgoing) {
  std::vector<v1::ConnectResponse> messages;
  v1::ConnectResponse message;
  while (outgoing->Next(77, &message)) {
    messages.push_back(message);
    message.Clear();
  }
  return messages;
}

class OutgoingMessagesTest : public ::testing::Test {
 protected:
  void SendHello() {
    outgoing_.SetHello({});
    ASSERT_EQ(Drain(&outgoing_).size(), 1u);
  }
  OutgoingMessages outgoing_;
};

TEST_F(OutgoingMessagesTest, NothingGoesBeforeTheHello) {
  EXPECT_TRUE(outgoing_.AddCommand(Stop("wave")));
  EXPECT_TRUE(outgoing_.AddAck(Ack("left", 5)));
  outgoing_.AddPing(1);
  EXPECT_TRUE(Drain(&outgoing_).empty());
  EXPECT_FALSE(outgoing_.empty());
  v1::ServerHello hello;
  hello.set_server_id("me");
  outgoing_.SetHello(hello);
  const auto messages = Drain(&outgoing_);
  ASSERT_EQ(messages.size(), 4u);
  EXPECT_EQ(messages[0].hello().server_id(), "me");
  EXPECT_EQ(messages[1].time_pong().server_utc_ns(), 77);
  EXPECT_EQ(messages[2].stop_capture().session_id(), "wave");
  EXPECT_EQ(messages[3].ack().durable_seq(), 5u);
  EXPECT_TRUE(outgoing_.empty());
}

TEST_F(OutgoingMessagesTest, MergesAcknowledgementsOfOneStream) {
  SendHello();
  EXPECT_TRUE(outgoing_.AddAck(Ack("left", 5, 2)));
  EXPECT_TRUE(outgoing_.AddAck(Ack("right", 7)));
  BatchAck complete = Ack("left", 9, 1);
  complete.complete = true;
  complete.conflict_count = 4;
  EXPECT_TRUE(outgoing_.AddAck(complete));
  EXPECT_TRUE(outgoing_.AddAck(Ack("left", 8)));  // an older one must not make it sink
  const auto messages = Drain(&outgoing_);
  ASSERT_EQ(messages.size(), 2u);
  EXPECT_EQ(messages[0].ack().camera(), "left");
  EXPECT_EQ(messages[0].ack().durable_seq(), 9u);
  EXPECT_EQ(messages[0].ack().send_limit_seq(), 109u);
  EXPECT_EQ(messages[0].ack().fault_count(), 3u);
  EXPECT_EQ(messages[0].ack().faults_size(), 3);
  EXPECT_TRUE(messages[0].ack().complete());
  EXPECT_EQ(messages[0].ack().conflict_count(), 4u);
  EXPECT_EQ(messages[1].ack().camera(), "right");
  EXPECT_FALSE(messages[1].ack().complete());
}

TEST_F(OutgoingMessagesTest, ListsSixteenFaultsAndCountsAll) {
  SendHello();
  for (uint32_t i = 1; i <= 10; ++i) EXPECT_TRUE(outgoing_.AddAck(Ack("left", 10 * i, 3)));
  const auto messages = Drain(&outgoing_);
  ASSERT_EQ(messages.size(), 1u);
  EXPECT_EQ(messages[0].ack().faults_size(), 16);
  EXPECT_EQ(messages[0].ack().fault_count(), 30u);
}

TEST_F(OutgoingMessagesTest, IsBounded) {
  for (size_t i = 0; i < OutgoingMessages::kMaxCommands; ++i) {
    EXPECT_TRUE(outgoing_.AddCommand(Stop("wave")));
  }
  EXPECT_FALSE(outgoing_.AddCommand(Stop("wave")));
  for (size_t i = 0; i < OutgoingMessages::kMaxAckStreams; ++i) {
    EXPECT_TRUE(outgoing_.AddAck(Ack("camera_" + std::to_string(i), 1)));
  }
  EXPECT_FALSE(outgoing_.AddAck(Ack("one_more", 1)));
  EXPECT_TRUE(outgoing_.AddAck(Ack("camera_3", 2))) << "its place is there";
  for (int64_t i = 0; i < 100; ++i) outgoing_.AddPing(i);
  outgoing_.SetHello({});
  const auto messages = Drain(&outgoing_);
  ASSERT_EQ(messages.size(), 1 + OutgoingMessages::kMaxPings + OutgoingMessages::kMaxCommands +
                                 OutgoingMessages::kMaxAckStreams);
  EXPECT_EQ(messages[1].time_pong().host_monotonic_ns(), 84) << "the oldest are left unanswered";
}

}  // namespace
}  // namespace rigcal::testing::outgoing_messages_test
