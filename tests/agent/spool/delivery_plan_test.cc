// SPDX-License-Identifier: Apache-2.0
#include "agent/spool/delivery_plan.h"

#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "agent/spool/memory_spool.h"
#include "tests/agent/uplink/scripted_source.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::agent::delivery_plan_test {
namespace {

using ::rigcal::testing::IsOk;
using std::chrono::milliseconds;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::SizeIs;

const StreamKey kLeft{"s-1", "left", 1};
const StreamKey kRight{"s-1", "right", 1};
constexpr uint32_t kNoLimit = 1'000'000;
constexpr size_t kBatchRows = 10;

class DeliveryPlanTest : public ::testing::Test {
 protected:
  DeliveryPlanTest() {
    for (const StreamKey& stream : {kLeft, kRight}) {
      EXPECT_THAT(spool_.Open(stream, 1, 1), IsOk());
    }
    plan_.BeginConnection(kBatchRows);
  }

  void Append(const StreamKey& stream, int rows) {
    for (int row = 0; row < rows; ++row) {
      EXPECT_THAT(spool_.Append(stream, MakeObservation(++time_ns_), {}), IsOk());
    }
  }
  void Finish(const StreamKey& stream) { EXPECT_THAT(spool_.Finish(stream, {}), IsOk()); }

  static std::string Show(const DeliveryPlan::Message& message) {
    if (const auto* end = std::get_if<EndOfCapture>(&message)) {
      return end->stream.camera + " end " + std::to_string(end->last_seq);
    }
    const auto& batch = std::get<ObservationBatch>(message);
    std::string text = batch.stream.camera;
    for (const DroppedRange& range : batch.dropped) {
      text += " dropped " + std::to_string(range.first_seq) + "+" + std::to_string(range.count);
    }
    if (batch.rows() == 0) return text;
    return text + " " + std::to_string(batch.first_seq) + "-" + std::to_string(batch.end_seq() - 1);
  }
  // Everything that is sent now.
  std::vector<std::string> Sent() {
    std::vector<std::string> sent;
    while (auto message = plan_.Next(now_)) sent.push_back(Show(*message));
    return sent;
  }
  bool Acknowledge(const StreamKey& stream, uint32_t durable_seq, bool complete = false,
                   uint32_t send_limit_seq = 0) {
    BatchAck ack;
    ack.stream = stream;
    ack.durable_seq = durable_seq;
    ack.send_limit_seq = send_limit_seq;
    ack.complete = complete;
    return plan_.Acknowledge(ack, now_);
  }
  void PassTime(milliseconds time = milliseconds(20)) { now_ += time; }
  // Batches of one row each, acknowledged after so long.
  void DeliverEachIn(milliseconds round_trip, uint32_t* seq, int times) {
    for (int i = 0; i < times; ++i) {
      Append(kLeft, 1);
      PassTime(DeliveryPlan::kLongestWait);
      ++*seq;
      ASSERT_THAT(Sent(), ElementsAre(absl::StrCat("left ", *seq, "-", *seq)));
      PassTime(round_trip);
      EXPECT_TRUE(Acknowledge(kLeft, *seq));
    }
  }
  // From now on the server keeps batches waiting for 20 ms, and has acknowledged all 41 rows.
  void BeBusy() {
    plan_.SetPosition(kLeft, 0, kNoLimit);
    uint32_t seq = 0;
    DeliverEachIn(milliseconds(2), &seq, 1);
    DeliverEachIn(milliseconds(22), &seq, 40);
    PassTime(DeliveryPlan::kLongestWait);
  }

  int64_t time_ns_ = 0;
  DeliveryPlan::Clock::time_point now_{std::chrono::seconds(100)};
  MemorySpool spool_;
  DeliveryPlan plan_{&spool_, milliseconds(20)};
};

TEST_F(DeliveryPlanTest, SendsNothingOfAStreamWithoutPosition) {
  Append(kLeft, 3);
  EXPECT_THAT(Sent(), IsEmpty());
  plan_.SetPosition(kLeft, 0, kNoLimit);
  EXPECT_THAT(Sent(), ElementsAre("left 1-3"));
}

TEST_F(DeliveryPlanTest, SendsFullBatchesAtOnceAndSmallerOnesAfterAWhile) {
  plan_.SetPosition(kLeft, 0, kNoLimit);
  Append(kLeft, 25);
  EXPECT_THAT(Sent(), ElementsAre("left 1-10", "left 11-20"));
  Append(kLeft, 1);
  EXPECT_THAT(Sent(), IsEmpty());
  PassTime();
  EXPECT_THAT(Sent(), ElementsAre("left 21-26"));
  PassTime();
  EXPECT_THAT(Sent(), IsEmpty());
  // A single row after a pause does not wait.
  Append(kLeft, 1);
  EXPECT_THAT(Sent(), ElementsAre("left 27-27"));
}

TEST_F(DeliveryPlanTest, NamesTheTimeAtWhichRowsThatWaitAreDue) {
  plan_.SetPosition(kLeft, 0, kNoLimit);
  EXPECT_THAT(Sent(), IsEmpty());
  EXPECT_EQ(plan_.next_due(), DeliveryPlan::Clock::time_point::max());
  Append(kLeft, 1);
  EXPECT_THAT(Sent(), ElementsAre("left 1-1"));
  const auto due = now_ + milliseconds(20);
  PassTime(milliseconds(15));
  Append(kLeft, 1);
  EXPECT_THAT(Sent(), IsEmpty());
  EXPECT_EQ(plan_.next_due(), due);
  now_ = due;
  EXPECT_THAT(Sent(), ElementsAre("left 2-2"));
  EXPECT_EQ(plan_.next_due(), DeliveryPlan::Clock::time_point::max());
}

TEST_F(DeliveryPlanTest, CollectsRowsWhileTheServerIsBusy) {
  BeBusy();
  Append(kLeft, 1);
  EXPECT_THAT(Sent(), ElementsAre("left 42-42"));
  PassTime();
  Append(kLeft, 1);
  EXPECT_THAT(Sent(), IsEmpty());
  PassTime(milliseconds(2));
  EXPECT_TRUE(Acknowledge(kLeft, 42));
  EXPECT_THAT(Sent(), IsEmpty());
  PassTime(milliseconds(38));
  Append(kLeft, 2);
  EXPECT_THAT(Sent(), IsEmpty());
  EXPECT_GT(plan_.next_due(), now_ + milliseconds(15));
  EXPECT_LT(plan_.next_due(), now_ + milliseconds(25));
  PassTime();
  EXPECT_THAT(Sent(), ElementsAre("left 43-45"));
}

TEST_F(DeliveryPlanTest, SendsSmallBatchesAgainOnceTheServerIsIdle) {
  BeBusy();
  uint32_t seq = 41;
  DeliverEachIn(milliseconds(2), &seq, 40);
  Append(kLeft, 1);
  PassTime();
  EXPECT_THAT(Sent(), ElementsAre("left 82-82"));
  PassTime(milliseconds(2));
  EXPECT_TRUE(Acknowledge(kLeft, 82));
  Append(kLeft, 1);
  EXPECT_THAT(Sent(), IsEmpty());
  PassTime(milliseconds(18));
  EXPECT_THAT(Sent(), ElementsAre("left 83-83"));
}

TEST_F(DeliveryPlanTest, SendsFullBatchesWhateverIsOnItsWay) {
  BeBusy();
  Append(kLeft, 3 * kBatchRows + 1);
  EXPECT_THAT(Sent(), ElementsAre("left 42-51", "left 52-61", "left 62-71"));
  PassTime();
  EXPECT_THAT(Sent(), IsEmpty());
}

TEST_F(DeliveryPlanTest, EndsAStreamAtOnceWhateverIsOnItsWay) {
  BeBusy();
  Append(kLeft, 1);
  EXPECT_THAT(Sent(), ElementsAre("left 42-42"));
  Append(kLeft, 2);
  EXPECT_THAT(Sent(), IsEmpty());
  Finish(kLeft);
  EXPECT_THAT(Sent(), ElementsAre("left 43-44", "left end 44"));
}

TEST_F(DeliveryPlanTest, DoesNotWaitForASlowLink) {
  plan_.SetPosition(kLeft, 0, kNoLimit);
  uint32_t seq = 0;
  DeliverEachIn(milliseconds(300), &seq, 10);
  for (int i = 0; i < 5; ++i) {
    Append(kLeft, 1);
    PassTime();
    EXPECT_THAT(Sent(), SizeIs(1));
  }
}

// Still something, in case the acknowledgement will never come.
TEST_F(DeliveryPlanTest, SendsLittleToAServerThatStandsStill) {
  plan_.SetPosition(kLeft, 0, kNoLimit);
  uint32_t seq = 0;
  DeliverEachIn(milliseconds(2), &seq, 10);
  Append(kLeft, 1);
  PassTime();
  EXPECT_THAT(Sent(), ElementsAre("left 11-11"));
  for (int i = 0; i < 3; ++i) {
    Append(kLeft, 1);
    PassTime(DeliveryPlan::kLongestWait - milliseconds(1));
    EXPECT_THAT(Sent(), IsEmpty()) << i;
    PassTime(milliseconds(1));
    EXPECT_THAT(Sent(), SizeIs(1)) << i;
  }
}

TEST_F(DeliveryPlanTest, SendsCollectedRowsAtOnceAfterAReconnection) {
  BeBusy();
  Append(kLeft, 1);
  EXPECT_THAT(Sent(), ElementsAre("left 42-42"));
  Append(kLeft, 3);
  PassTime();
  EXPECT_THAT(Sent(), IsEmpty());
  // The acknowledgement of 42 is lost with the connection; whether it is durable, the server says.
  plan_.BeginConnection(kBatchRows);
  plan_.SetPosition(kLeft, 41, kNoLimit);
  EXPECT_THAT(Sent(), ElementsAre("left 42-45"));
  // What was known of the old connection says nothing about this one.
  Append(kLeft, 1);
  PassTime();
  EXPECT_THAT(Sent(), ElementsAre("left 46-46"));
}

TEST_F(DeliveryPlanTest, RowsOfAStreamDoNotWaitBecauseOfAnotherOnes) {
  BeBusy();
  plan_.SetPosition(kRight, 0, kNoLimit);
  Append(kLeft, 1);
  EXPECT_THAT(Sent(), ElementsAre("left 42-42"));
  Append(kLeft, 1);
  Append(kRight, 1);
  PassTime();
  EXPECT_THAT(Sent(), ElementsAre("right 1-1"));
}

TEST_F(DeliveryPlanTest, LetsStreamsTakeTurns) {
  plan_.SetPosition(kLeft, 0, kNoLimit);
  plan_.SetPosition(kRight, 0, kNoLimit);
  Append(kLeft, 30);
  Append(kRight, 20);
  EXPECT_THAT(Sent(),
              ElementsAre("left 1-10", "right 1-10", "left 11-20", "right 11-20", "left 21-30"));
}

TEST_F(DeliveryPlanTest, KeepsToTheServersCredit) {
  plan_.SetPosition(kLeft, 0, 12);
  Append(kLeft, 30);
  EXPECT_THAT(Sent(), ElementsAre("left 1-10"));
  PassTime();
  EXPECT_THAT(Sent(), ElementsAre("left 11-12"));
  PassTime();
  EXPECT_THAT(Sent(), IsEmpty());
  EXPECT_TRUE(Acknowledge(kLeft, 10, false, 22));
  EXPECT_THAT(Sent(), ElementsAre("left 13-22"));
  // A limit never sinks.
  Acknowledge(kLeft, 12, false, 5);
  Acknowledge(kLeft, 12, false, 24);
  PassTime();
  EXPECT_THAT(Sent(), ElementsAre("left 23-24"));
}

TEST_F(DeliveryPlanTest, EndsAStreamBehindItsLastRowAndNeedsNoCreditForIt) {
  plan_.SetPosition(kLeft, 0, 3);
  Append(kLeft, 3);
  Finish(kLeft);
  EXPECT_THAT(Sent(), ElementsAre("left 1-3", "left end 3"));
  EXPECT_TRUE(plan_.HasOpenStreams());
  EXPECT_TRUE(Acknowledge(kLeft, 3));
  EXPECT_TRUE(spool_.Find(kLeft).has_value());
  EXPECT_TRUE(Acknowledge(kLeft, 3, true));
  EXPECT_FALSE(spool_.Find(kLeft).has_value());
  EXPECT_FALSE(plan_.HasOpenStreams());
  EXPECT_TRUE(plan_.Knows(kLeft));
}

TEST_F(DeliveryPlanTest, EndsAnEmptyStream) {
  plan_.SetPosition(kLeft, 0, kNoLimit);
  Finish(kLeft);
  Finish(kRight);
  EXPECT_THAT(Sent(), ElementsAre("left end 0"));
  EXPECT_TRUE(Acknowledge(kLeft, 0, true));
  EXPECT_FALSE(plan_.IsDelivered());
  plan_.SetPosition(kRight, 0, kNoLimit);
  EXPECT_THAT(Sent(), ElementsAre("right end 0"));
  EXPECT_TRUE(Acknowledge(kRight, 0, true));
  EXPECT_TRUE(plan_.IsDelivered());
}

TEST_F(DeliveryPlanTest, GoesOnBehindWhatIsDurableAfterAReconnection) {
  plan_.SetPosition(kLeft, 0, kNoLimit);
  Append(kLeft, 30);
  Finish(kLeft);
  EXPECT_THAT(Sent(), SizeIs(4));
  Acknowledge(kLeft, 10);
  plan_.BeginConnection(kBatchRows);
  EXPECT_THAT(Sent(), IsEmpty());
  plan_.SetPosition(kLeft, 15, kNoLimit);
  EXPECT_THAT(Sent(), ElementsAre("left 16-25", "left 26-30", "left end 30"));
  // A batch of the old connection that became durable late.
  plan_.BeginConnection(kBatchRows);
  plan_.SetPosition(kLeft, 15, kNoLimit);
  Acknowledge(kLeft, 28);
  EXPECT_THAT(Sent(), ElementsAre("left 29-30", "left end 30"));
}

TEST_F(DeliveryPlanTest, DoesNotSendAgainWhenAPositionIsRepeated) {
  plan_.SetPosition(kLeft, 0, kNoLimit);
  Append(kLeft, 10);
  EXPECT_THAT(Sent(), ElementsAre("left 1-10"));
  plan_.SetPosition(kLeft, 0, kNoLimit);
  PassTime();
  EXPECT_THAT(Sent(), IsEmpty());
}

TEST_F(DeliveryPlanTest, RepeatsTheEndOfADeliveredStreamWhenAsked) {
  plan_.SetPosition(kLeft, 0, kNoLimit);
  Append(kLeft, 3);
  Finish(kLeft);
  Sent();
  Acknowledge(kLeft, 3, true);
  EXPECT_THAT(Sent(), IsEmpty());
  plan_.BeginConnection(kBatchRows);
  EXPECT_THAT(Sent(), IsEmpty());
  plan_.SetPosition(kLeft, 3, kNoLimit);
  EXPECT_THAT(Sent(), ElementsAre("left end 3"));
}

TEST_F(DeliveryPlanTest, DoesNotBelieveThatWhatWasNeverCapturedIsDurable) {
  plan_.SetPosition(kLeft, 0, kNoLimit);
  Append(kLeft, 3);
  Sent();
  Acknowledge(kLeft, 900);
  Append(kLeft, 2);
  PassTime();
  EXPECT_THAT(Sent(), ElementsAre("left 4-5"));
}

TEST_F(DeliveryPlanTest, IgnoresAcknowledgementsOfStreamsItDoesNotKnow) {
  EXPECT_FALSE(Acknowledge({"s-9", "left", 1}, 5, true));
  EXPECT_FALSE(plan_.Knows({"s-9", "left", 1}));
  plan_.SetPosition({"s-9", "left", 1}, 5, 10);
  EXPECT_THAT(Sent(), IsEmpty());
}

TEST_F(DeliveryPlanTest, SaysWhatAServerThatWentBackInTimeCannotHaveAgain) {
  plan_.SetPosition(kLeft, 0, kNoLimit);
  Append(kLeft, 300);
  Finish(kLeft);
  Sent();
  Acknowledge(kLeft, 256);
  plan_.BeginConnection(100);
  plan_.SetPosition(kLeft, 100, 120);
  EXPECT_THAT(Sent(), ElementsAre("left dropped 101+156"));
  Acknowledge(kLeft, 256, false, 400);
  EXPECT_THAT(Sent(), ElementsAre("left 257-300", "left end 300"));
}

TEST_F(DeliveryPlanTest, CountsWhatIsLostWithADiscardedStream) {
  plan_.SetPosition(kLeft, 0, kNoLimit);
  Append(kLeft, 30);
  Acknowledge(kLeft, 10);
  EXPECT_EQ(plan_.Discard(kLeft), 20u);
  EXPECT_FALSE(plan_.Knows(kLeft));
  EXPECT_THAT(Sent(), IsEmpty());
}

TEST_F(DeliveryPlanTest, SendsEachAlignmentOncePerStreamAndConnection) {
  plan_.SetPosition(kLeft, 0, kNoLimit);
  plan_.SetPosition(kRight, 0, kNoLimit);
  const HostAlignment first{1, 2, 3};
  plan_.AddAlignment(first);
  Append(kLeft, 20);
  Append(kRight, 10);
  std::vector<size_t> counts;
  while (auto message = plan_.Next(now_)) {
    const auto& batch = std::get<ObservationBatch>(*message);
    counts.push_back(batch.host_alignments.size());
    if (!batch.host_alignments.empty()) {
      EXPECT_EQ(batch.host_alignments[0], first);
    }
  }
  EXPECT_THAT(counts, ElementsAre(1, 1, 0));
  // Many of them stay bounded.
  for (int i = 0; i < 1000; ++i) plan_.AddAlignment({i, 0, 0});
  Append(kRight, 10);
  const auto message = plan_.Next(now_);
  ASSERT_TRUE(message);
  EXPECT_THAT(std::get<ObservationBatch>(*message).host_alignments, SizeIs(64));
}

TEST_F(DeliveryPlanTest, HoldsBackACameraThatNeedsAnAlignmentUntilThereIsOneOrTimeIsUp) {
  plan_.RequireAlignment("left");
  plan_.BeginConnection(kBatchRows);
  plan_.SetPosition(kLeft, 0, kNoLimit);
  plan_.SetPosition(kRight, 0, kNoLimit);
  Append(kLeft, 10);
  Append(kRight, 10);
  EXPECT_THAT(Sent(), ElementsAre("right 1-10"));
  plan_.AddAlignment({1, 2, 3});
  EXPECT_THAT(Sent(), ElementsAre("left 1-10"));
  plan_.BeginConnection(kBatchRows);
  plan_.SetPosition(kLeft, 0, kNoLimit);
  EXPECT_THAT(Sent(), IsEmpty());
  plan_.StopWaitingForAlignment();
  EXPECT_THAT(Sent(), ElementsAre("left 1-10"));
}

class ProtocolFaultTest : public DeliveryPlanTest {
 protected:
  void Reconnect() {
    plan_.BeginConnection(kBatchRows);
    plan_.SetPosition(kLeft, 5, kNoLimit);
    plan_.SetPosition(kRight, 0, kNoLimit);
  }
};

TEST_F(ProtocolFaultTest, FindsTheGuiltyStreamAndEndsItWhereTheServerStands) {
  Append(kLeft, 20);
  Append(kRight, 20);
  Reconnect();
  EXPECT_FALSE(plan_.SuspectsFault());
  Sent();
  EXPECT_TRUE(plan_.SuspectsFault());
  EXPECT_FALSE(plan_.OnProtocolFault("x_px: size"));
  // From now on messages are sent one at a time.
  Reconnect();
  EXPECT_TRUE(plan_.SendsOneAtATime());
  EXPECT_FALSE(plan_.SuspectsFault());
  std::vector<std::string> sent = Sent();
  ASSERT_THAT(sent, SizeIs(1));
  if (sent[0] == "right 1-10") {
    Acknowledge(kRight, 10);
    sent = Sent();
  }
  EXPECT_THAT(sent, ElementsAre("left 6-15"));
  EXPECT_TRUE(plan_.SuspectsFault());
  const auto given_up = plan_.OnProtocolFault("x_px: size");
  ASSERT_TRUE(given_up);
  EXPECT_EQ(given_up->stream, kLeft);
  EXPECT_EQ(given_up->lost_count, 15u);
  // A repeated start does not begin the stream again, and its end has the reason.
  EXPECT_TRUE(plan_.Knows(kLeft));
  Reconnect();
  const auto end = plan_.Next(now_);
  ASSERT_TRUE(end);
  ASSERT_EQ(Show(*end), "left end 5");
  EXPECT_THAT(std::get<EndOfCapture>(*end).report.refused,
              ElementsAre(Refusal{"", RefusalReason::kProtocolFault, 15, "x_px: size"}));
  Acknowledge(kLeft, 5, true);
  EXPECT_THAT(Sent(), SizeIs(1));
}

TEST_F(ProtocolFaultTest, GivesUpAnEndThatIsNotUnderstood) {
  Append(kLeft, 5);
  Finish(kLeft);
  Reconnect();
  Sent();
  EXPECT_FALSE(plan_.OnProtocolFault("end"));
  Reconnect();
  EXPECT_THAT(Sent(), ElementsAre("left end 5"));
  const auto given_up = plan_.OnProtocolFault("end");
  ASSERT_TRUE(given_up);
  EXPECT_EQ(given_up->lost_count, 0u);
  Reconnect();
  EXPECT_THAT(Sent(), IsEmpty());
  EXPECT_FALSE(plan_.SuspectsFault());
}

TEST_F(ProtocolFaultTest, SendsFreelyAgainOnceAllIsDelivered) {
  Append(kLeft, 20);
  Finish(kLeft);
  Finish(kRight);
  Reconnect();
  Sent();
  plan_.OnProtocolFault("once");
  Reconnect();
  for (int message = 0; message < 10; ++message) {
    Sent();
    Acknowledge(kLeft, 15);
    Sent();
    Acknowledge(kLeft, 20, true);
    Acknowledge(kRight, 0, true);
  }
  EXPECT_TRUE(plan_.IsDelivered());
  Reconnect();
  EXPECT_FALSE(plan_.SendsOneAtATime());
}

TEST_F(DeliveryPlanTest, TellsTheGapOfAStreamThatIsNotHereAnyMore) {
  Append(kLeft, 5);
  Finish(kLeft);
  plan_.SetPosition(kLeft, 0, kNoLimit);
  EXPECT_THAT(Sent(), ElementsAre("left 1-5", "left end 5"));
  Acknowledge(kLeft, 5, true);
  EXPECT_FALSE(spool_.Find(kLeft));
  // A standby that had only the first three has taken over.
  plan_.BeginConnection(kBatchRows);
  plan_.SetPosition(kLeft, 3, kNoLimit);
  EXPECT_THAT(Sent(), ElementsAre("left dropped 4+2", "left end 5"));
}

class KeptUntilStandby : public DeliveryPlanTest {
 protected:
  bool AcknowledgeAtStandby(uint32_t durable_seq, bool complete = false) {
    BatchAck ack;
    ack.stream = kLeft;
    ack.standby_durable_seq = durable_seq;
    ack.standby_complete = complete;
    return kept_.Acknowledge(ack, now_);
  }
  void AcknowledgeAtServer(uint32_t durable_seq, bool complete = false) {
    BatchAck ack;
    ack.stream = kLeft;
    ack.durable_seq = durable_seq;
    ack.complete = complete;
    kept_.Acknowledge(ack, now_);
  }
  std::vector<std::string> SentByKept() {
    std::vector<std::string> sent;
    while (auto message = kept_.Next(now_)) sent.push_back(Show(*message));
    return sent;
  }

  DeliveryPlan kept_{&spool_, milliseconds(20), /*keeps_until_standby=*/true};
};

TEST_F(KeptUntilStandby, TheServersAcknowledgementFreesNothing) {
  Append(kLeft, 5);
  Finish(kLeft);
  kept_.BeginConnection(kBatchRows);
  kept_.SetPosition(kLeft, 0, kNoLimit);
  EXPECT_THAT(SentByKept(), ElementsAre("left 1-5", "left end 5"));
  AcknowledgeAtServer(5, true);
  ASSERT_TRUE(spool_.Find(kLeft));
  EXPECT_EQ(spool_.Find(kLeft)->row_count, 5u);
  AcknowledgeAtStandby(3);
  EXPECT_EQ(spool_.Find(kLeft)->row_count, 2u);
  // All rows, but not the end.
  AcknowledgeAtStandby(5);
  EXPECT_TRUE(spool_.Find(kLeft));
  AcknowledgeAtStandby(5, true);
  EXPECT_FALSE(spool_.Find(kLeft));
}

TEST_F(KeptUntilStandby, SendsAgainWhatTheStandbyDoesNotHave) {
  Append(kLeft, 5);
  kept_.BeginConnection(kBatchRows);
  kept_.SetPosition(kLeft, 0, kNoLimit);
  EXPECT_THAT(SentByKept(), ElementsAre("left 1-5"));
  AcknowledgeAtServer(5);
  AcknowledgeAtStandby(2);
  // It has taken over, with one row more than it could say.
  kept_.BeginConnection(kBatchRows);
  kept_.SetPosition(kLeft, 3, kNoLimit);
  EXPECT_THAT(SentByKept(), ElementsAre("left 4-5"));
}

}  // namespace
}  // namespace rigcal::agent::delivery_plan_test
