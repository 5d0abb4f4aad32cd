// SPDX-License-Identifier: Apache-2.0
#include "client/results/session_verification.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace rigcal::client::session_verification_test {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Pair;

// A stream that has been delivered to its end.
v1::StreamAudit Complete(uint32_t last_seq) {
  v1::StreamAudit audit;
  audit.set_camera("left");
  audit.set_stream_epoch(77);
  audit.set_agent_id("pc-1");
  audit.set_holder(v1::StreamAudit::HOLDER_GONE);
  audit.set_durable_seq(last_seq);
  audit.set_last_seq(last_seq);
  audit.set_ended(true);
  audit.set_highest_seq(last_seq);
  audit.set_stored_count(last_seq);
  return audit;
}

// A stream of which 60 rows are durable and the agent has reported another 40.
v1::StreamAudit Half() {
  v1::StreamAudit audit = Complete(60);
  audit.set_holder(v1::StreamAudit::HOLDER_CONNECTED);
  audit.set_ended(false);
  audit.set_last_seq(0);
  audit.mutable_reported()->set_last_seq(100);
  audit.mutable_reported()->set_acknowledged_seq(60);
  audit.mutable_reported()->set_spooled_count(40);
  return audit;
}

void AddDrop(uint32_t count, v1::RefusalReason reason,
             google::protobuf::RepeatedPtrField<v1::RefusalCount>* list) {
  v1::RefusalCount* drop = list->Add();
  drop->set_reason(reason);
  drop->set_count(count);
}

VerifiedStream Verify(const v1::StreamAudit& audit) {
  v1::GetSessionResponse response;
  *response.add_audit() = audit;
  const VerifiedStream stream = VerifySession(response).streams.at(0);
  if (stream.fault.empty()) {
    EXPECT_EQ(stream.detected, stream.durable + stream.spooled + stream.dropped_count());
  }
  return stream;
}

TEST(SessionVerification, HoldsForWhatIsDurable) {
  const VerifiedStream stream = Verify(Complete(100));
  EXPECT_THAT(stream.fault, IsEmpty());
  EXPECT_EQ(stream.detected, 100u);
  EXPECT_EQ(stream.durable, 100u);
  EXPECT_EQ(stream.state, "complete");
  EXPECT_THAT(Verify(Complete(0)).fault, IsEmpty());
}

TEST(SessionVerification, CountsWhatTheAgentHasAndWhatItHasLost) {
  v1::StreamAudit audit = Half();
  VerifiedStream stream = Verify(audit);
  EXPECT_THAT(stream.fault, IsEmpty());
  EXPECT_EQ(stream.spooled, 40u);
  // Some of it became durable after the report.
  audit.set_durable_seq(80);
  audit.set_stored_count(80);
  audit.set_highest_seq(80);
  stream = Verify(audit);
  EXPECT_EQ(stream.spooled, 20u);
  // Lost in the spool: of six the server has been told already.
  audit = Half();
  audit.mutable_reported()->set_spooled_count(30);
  AddDrop(10, v1::REFUSAL_REASON_SPOOL_FULL, audit.mutable_reported()->mutable_dropped());
  audit.set_highest_seq(66);
  audit.set_durable_seq(66);
  AddDrop(6, v1::REFUSAL_REASON_SPOOL_FULL, audit.mutable_dropped());
  stream = Verify(audit);
  EXPECT_THAT(stream.fault, IsEmpty());
  EXPECT_THAT(stream.dropped, ElementsAre(Pair("spool_full", 10)));
  EXPECT_EQ(stream.spooled, 30u);
}

TEST(SessionVerification, BelievesTheLastReportOfAnAgentThatIsAway) {
  v1::StreamAudit audit = Half();
  audit.set_holder(v1::StreamAudit::HOLDER_AWAY);
  EXPECT_THAT(Verify(audit).fault, IsEmpty());
  EXPECT_THAT(Verify(audit).state, HasSubstr("away"));
}

TEST(SessionVerification, NamesStreamAndNumbersOfWhatIsMissing) {
  // The store has lost a batch that the agent has not any more.
  v1::StreamAudit audit = Complete(100);
  audit.set_stored_count(84);
  VerifiedStream stream = Verify(audit);
  EXPECT_EQ(stream.missing, 16u);
  EXPECT_THAT(stream.fault, AllOf(HasSubstr("camera left, stream 77"), HasSubstr("detected 100"),
                                  HasSubstr("durable 84"), HasSubstr("16 are missing")));
  // The agent has fewer than it would need to have.
  audit = Half();
  audit.mutable_reported()->set_spooled_count(39);
  EXPECT_EQ(Verify(audit).missing, 1u);
  // The end says that there were more.
  audit = Half();
  audit.set_last_seq(140);
  EXPECT_EQ(Verify(audit).missing, 40u);
  // The agent was killed, and its spool was in memory.
  audit = Half();
  audit.set_holder(v1::StreamAudit::HOLDER_GONE);
  EXPECT_EQ(Verify(audit).missing, 40u);
  audit.clear_reported();
  EXPECT_THAT(Verify(audit).fault, HasSubstr("is not known"));
}

TEST(SessionVerification, SeesAServerThatWentBackInTime) {
  v1::StreamAudit audit = Half();
  audit.set_durable_seq(50);
  audit.set_stored_count(50);
  audit.set_highest_seq(50);
  EXPECT_EQ(Verify(audit).missing, 10u);
  audit.mutable_reported()->set_spooled_count(50);
  EXPECT_THAT(Verify(audit).fault,
              AllOf(HasSubstr("acknowledged all up to 60"), HasSubstr("up to 50")));
}

TEST(SessionVerification, SeesMoreRowsThanWereDetected) {
  v1::StreamAudit audit = Complete(100);
  audit.set_stored_count(103);
  EXPECT_THAT(Verify(audit).fault, HasSubstr("3 too many"));
}

TEST(SessionVerification, TakesARowThatIsStoredForStoredEvenIfTheAgentLostIt) {
  v1::StreamAudit audit = Complete(100);
  AddDrop(1, v1::REFUSAL_REASON_SPOOL_DAMAGED, audit.mutable_reported()->mutable_dropped());
  const VerifiedStream stream = Verify(audit);
  EXPECT_THAT(stream.fault, IsEmpty());
  EXPECT_THAT(stream.dropped, IsEmpty());
}

TEST(SessionVerification, IsPrintedAsATableAndAsJson) {
  v1::GetSessionResponse response;
  response.mutable_session()->set_id("wave");
  EXPECT_THAT(FormatVerification(VerifySession(response)), HasSubstr("wave has no streams"));
  *response.add_audit() = Complete(100);
  *response.add_audit() = Half();
  const SessionVerification good = VerifySession(response);
  EXPECT_TRUE(good.holds());
  EXPECT_THAT(FormatVerification(good),
              HasSubstr("verified: 200 detected = 160 durable + 40 spooled + 0 dropped"));
  response.mutable_audit(0)->set_stored_count(90);
  const SessionVerification bad = VerifySession(response);
  EXPECT_FALSE(bad.holds());
  EXPECT_THAT(FormatVerification(bad), HasSubstr("not verified: camera left, stream 77"));
  const auto json = nlohmann::json::parse(VerificationJson(bad));
  EXPECT_EQ(json.at("session"), "wave");
  EXPECT_EQ(json.at("holds"), false);
  EXPECT_EQ(json.at("streams").at(0).at("missing"), 10);
  EXPECT_EQ(json.at("streams").at(1).at("spooled"), 40);
}

TEST(SessionVerification, SaysThatRetentionHasDeletedWhatIsNotThere) {
  v1::GetSessionResponse response;
  *response.add_audit() = Complete(100);
  response.mutable_audit(0)->set_stored_count(0);
  EXPECT_THAT(VerifySession(response).streams[0].fault, HasSubstr("100 are missing"));
  response.mutable_session()->mutable_observations_delete_time()->set_seconds(1);
  const SessionVerification verification = VerifySession(response);
  EXPECT_FALSE(verification.holds());
  EXPECT_THAT(verification.streams[0].fault,
              AllOf(HasSubstr("camera left, stream 77"), HasSubstr("retention has deleted")));
}

}  // namespace
}  // namespace rigcal::client::session_verification_test
