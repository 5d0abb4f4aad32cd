// SPDX-License-Identifier: Apache-2.0
#include "client/results/session_verification.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace rigcal::client::session_verification_test {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::Field;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
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

SessionVerification VerifyOne(const v1::StreamAudit& audit) {
  v1::GetSessionResponse response;
  response.mutable_session()->set_id("wave");
  response.mutable_session()->set_state(v1::Session::STATE_FINISHED);
  *response.add_audit() = audit;
  const SessionVerification verification = VerifySession(response);
  const VerifiedStream& stream = verification.streams.at(0);
  if (stream.missing == 0 && verification.holds()) {
    EXPECT_EQ(stream.detected, stream.durable + stream.dropped_count());
  }
  return verification;
}

VerifiedStream StreamOf(const v1::StreamAudit& audit) { return VerifyOne(audit).streams.at(0); }

// Kinds of its problems, and the text of the first one.
std::vector<std::string> KindsOf(const SessionVerification& verification) {
  std::vector<std::string> kinds;
  for (const VerificationProblem& problem : verification.problems) kinds.push_back(problem.kind);
  return kinds;
}
std::string FirstText(const SessionVerification& verification) {
  return verification.problems.empty() ? "" : verification.problems.front().text;
}

auto Rows(uint32_t first, uint32_t last) {
  return AllOf(Field(&VerifiedRows::first, first), Field(&VerifiedRows::last, last));
}

TEST(SessionVerification, HoldsForWhatIsDurable) {
  const SessionVerification verification = VerifyOne(Complete(100));
  EXPECT_THAT(verification.problems, IsEmpty());
  EXPECT_EQ(verification.streams[0].detected, 100u);
  EXPECT_EQ(verification.streams[0].durable, 100u);
  EXPECT_EQ(verification.streams[0].state, "complete");
  EXPECT_TRUE(VerifyOne(Complete(0)).holds());
}

TEST(SessionVerification, DoesNotHoldWhereTheAgentDoesNotKnowWhichRowWasTheLast) {
  v1::StreamAudit audit = Complete(100);
  audit.mutable_reported()->set_last_seq(100);
  EXPECT_TRUE(VerifyOne(audit).holds());
  audit.mutable_reported()->set_end_is_unknown(true);
  const SessionVerification verification = VerifyOne(audit);
  EXPECT_THAT(KindsOf(verification), ElementsAre("end_unknown"));
  EXPECT_THAT(FirstText(verification), HasSubstr("after row 100 is not known: agent pc-1"));
  EXPECT_THAT(verification.problems[0].rows, ElementsAre(Rows(101, 0)));
  EXPECT_EQ(verification.streams[0].state, "end not known");
}

TEST(SessionVerification, DoesNotHoldForDamagedRows) {
  v1::StreamAudit audit = Complete(100);
  audit.set_stored_count(80);
  audit.set_damaged_count(20);
  for (const uint32_t first : {11, 41}) {
    audit.add_damaged()->set_first_seq(first);
    audit.mutable_damaged()->rbegin()->set_count(10);
  }
  audit.set_damage("its checksum is wrong");
  const SessionVerification verification = VerifyOne(audit);
  EXPECT_THAT(KindsOf(verification), ElementsAre("damaged"));
  const VerificationProblem& problem = verification.problems[0];
  EXPECT_EQ(problem.count, 20u);
  EXPECT_THAT(problem.rows, ElementsAre(Rows(11, 20), Rows(41, 50)));
  EXPECT_THAT(problem.text, AllOf(HasSubstr("camera left, stream 77"),
                                  HasSubstr("rows 11 to 20 and 41 to 50 (20)"),
                                  HasSubstr("its checksum is wrong")));
  EXPECT_THAT(problem.what_to_do, HasSubstr("restore"));
}

TEST(SessionVerification, DoesNotHoldWhileRowsWaitInASpool) {
  v1::StreamAudit audit = Half();
  SessionVerification verification = VerifyOne(audit);
  EXPECT_EQ(verification.streams[0].spooled, 40u);
  EXPECT_THAT(KindsOf(verification), ElementsAre("waiting"));
  EXPECT_EQ(verification.problems[0].count, 40u);
  EXPECT_THAT(verification.problems[0].rows, ElementsAre(Rows(61, 100), Rows(101, 0)));
  EXPECT_THAT(FirstText(verification),
              HasSubstr("rows 61 to 100 (40) wait in the spool of agent pc-1"));
  // Some of it became durable after the report.
  audit.set_durable_seq(80);
  audit.set_stored_count(80);
  audit.set_highest_seq(80);
  EXPECT_EQ(StreamOf(audit).spooled, 20u);
  // All of it: its end is still to come.
  audit.set_durable_seq(100);
  audit.set_stored_count(100);
  audit.set_highest_seq(100);
  verification = VerifyOne(audit);
  EXPECT_THAT(KindsOf(verification), ElementsAre("waiting"));
  EXPECT_THAT(FirstText(verification), HasSubstr("its end has not come yet"));
}

TEST(SessionVerification, CountsWhatTheAgentHasLost) {
  // Of ten the server has been told six already.
  v1::StreamAudit audit = Half();
  audit.mutable_reported()->set_spooled_count(30);
  AddDrop(10, v1::REFUSAL_REASON_SPOOL_FULL, audit.mutable_reported()->mutable_dropped());
  audit.set_highest_seq(66);
  audit.set_durable_seq(66);
  AddDrop(6, v1::REFUSAL_REASON_SPOOL_FULL, audit.mutable_dropped());
  const VerifiedStream stream = StreamOf(audit);
  EXPECT_THAT(stream.dropped, ElementsAre(Pair("spool_full", 10)));
  EXPECT_EQ(stream.spooled, 30u);
  EXPECT_EQ(stream.missing, 0u);
  // Dropped and told: that is proved.
  audit = Complete(100);
  audit.set_stored_count(94);
  AddDrop(6, v1::REFUSAL_REASON_SPOOL_FULL, audit.mutable_dropped());
  EXPECT_TRUE(VerifyOne(audit).holds());
}

TEST(SessionVerification, DoesNotHoldWhileAnAgentIsAwayWhateverItLastReported) {
  v1::StreamAudit audit = Half();
  audit.set_holder(v1::StreamAudit::HOLDER_AWAY);
  SessionVerification verification = VerifyOne(audit);
  EXPECT_THAT(KindsOf(verification), ElementsAre("away"));
  EXPECT_THAT(verification.problems[0].rows, ElementsAre(Rows(61, 100), Rows(101, 0)));
  EXPECT_THAT(FirstText(verification),
              AllOf(HasSubstr("agent pc-1 is not connected"), HasSubstr("rows 61 to 100 (40)"),
                    HasSubstr("what was detected after row 100")));
  EXPECT_THAT(verification.problems[0].what_to_do, HasSubstr("start agent pc-1 again"));
  // It reported that everything was delivered; it may have detected more since.
  audit.mutable_reported()->set_last_seq(60);
  audit.mutable_reported()->set_spooled_count(0);
  verification = VerifyOne(audit);
  EXPECT_EQ(verification.streams[0].detected, verification.streams[0].durable);
  EXPECT_THAT(KindsOf(verification), ElementsAre("away"));
  audit.clear_reported();
  EXPECT_THAT(KindsOf(VerifyOne(audit)), ElementsAre("away"));
}

TEST(SessionVerification, SaysWhereTheSpoolIs) {
  v1::GetSessionResponse response;
  *response.add_audit() = Half();
  response.mutable_audit(0)->set_holder(v1::StreamAudit::HOLDER_AWAY);
  v1::ListAgentsResponse agents;
  v1::Agent* const agent = agents.add_agents();
  agent->set_agent_id("pc-1");
  agent->set_host("lab-7");
  agent->mutable_spool()->set_folder("/var/lib/rigcal-agent/spool");
  EXPECT_EQ(VerifySession(response, agents).problems[0].where,
            "the spool of agent pc-1 on lab-7 (/var/lib/rigcal-agent/spool)");
  agent->mutable_spool()->clear_folder();
  EXPECT_THAT(FirstText(VerifySession(response, agents)), HasSubstr("its spool is in memory"));
}

TEST(SessionVerification, KnowsNoEndOfAStreamThatNoAgentDelivers) {
  v1::StreamAudit audit = Half();
  audit.clear_reported();
  audit.clear_agent_id();
  audit.set_holder(v1::StreamAudit::HOLDER_UNSPECIFIED);
  const SessionVerification verification = VerifyOne(audit);
  EXPECT_THAT(KindsOf(verification), ElementsAre("no_agent"));
  EXPECT_THAT(FirstText(verification), HasSubstr("after row 60"));
}

TEST(SessionVerification, NamesStreamAndNumbersOfWhatIsMissing) {
  // The store has lost a batch that the agent has not any more.
  v1::StreamAudit audit = Complete(100);
  audit.set_stored_count(84);
  audit.set_absent_count(16);
  audit.add_absent()->set_first_seq(33);
  audit.mutable_absent(0)->set_count(16);
  SessionVerification verification = VerifyOne(audit);
  EXPECT_THAT(KindsOf(verification), ElementsAre("missing"));
  EXPECT_EQ(verification.streams[0].missing, 16u);
  EXPECT_THAT(FirstText(verification),
              AllOf(HasSubstr("camera left, stream 77"), HasSubstr("detected 100"),
                    HasSubstr("durable 84"), HasSubstr("16 are missing, of rows 33 to 48")));
  // The agent has fewer than it would need to have.
  audit = Half();
  audit.mutable_reported()->set_spooled_count(39);
  EXPECT_EQ(StreamOf(audit).missing, 1u);
  // The end says that there were more.
  audit = Half();
  audit.set_last_seq(140);
  EXPECT_EQ(StreamOf(audit).missing, 40u);
  // The agent was killed, and its spool was in memory.
  audit = Half();
  audit.set_holder(v1::StreamAudit::HOLDER_GONE);
  EXPECT_THAT(KindsOf(VerifyOne(audit)), ElementsAre("gone", "missing"));
  EXPECT_EQ(StreamOf(audit).missing, 40u);
  audit.clear_reported();
  EXPECT_THAT(FirstText(VerifyOne(audit)), HasSubstr("is not known"));
}

TEST(SessionVerification, SeesAServerThatWentBackInTime) {
  v1::StreamAudit audit = Half();
  audit.set_durable_seq(50);
  audit.set_stored_count(50);
  audit.set_highest_seq(50);
  EXPECT_EQ(StreamOf(audit).missing, 10u);
  audit.mutable_reported()->set_spooled_count(50);
  const SessionVerification verification = VerifyOne(audit);
  EXPECT_THAT(KindsOf(verification), ElementsAre("waiting", "went_back"));
  EXPECT_THAT(verification.problems[1].text,
              AllOf(HasSubstr("acknowledged all up to 60"), HasSubstr("up to 50")));
}

TEST(SessionVerification, SeesMoreRowsThanWereDetected) {
  v1::StreamAudit audit = Complete(100);
  audit.set_stored_count(103);
  EXPECT_THAT(KindsOf(VerifyOne(audit)), ElementsAre("surplus"));
  EXPECT_THAT(FirstText(VerifyOne(audit)), HasSubstr("3 too many"));
}

TEST(SessionVerification, TakesARowThatIsStoredForStoredEvenIfTheAgentLostIt) {
  v1::StreamAudit audit = Complete(100);
  AddDrop(1, v1::REFUSAL_REASON_SPOOL_DAMAGED, audit.mutable_reported()->mutable_dropped());
  EXPECT_TRUE(VerifyOne(audit).holds());
  EXPECT_THAT(StreamOf(audit).dropped, IsEmpty());
}

TEST(SessionVerification, DoesNotHoldBeforeTheSessionHasFinished) {
  const std::pair<v1::Session::State, std::string> cases[] = {
      {v1::Session::STATE_CREATED, "not_started"},
      {v1::Session::STATE_CAPTURING, "capturing"},
      {v1::Session::STATE_DRAINING, "draining"}};
  for (const auto& [state, kind] : cases) {
    v1::GetSessionResponse response;
    response.mutable_session()->set_state(state);
    *response.add_audit() = Complete(100);
    EXPECT_THAT(KindsOf(VerifySession(response)), ElementsAre(kind));
  }
}

TEST(SessionVerification, DoesNotHoldForACameraOfWhichNothingIsKnown) {
  v1::GetSessionResponse response;
  response.mutable_session()->set_state(v1::Session::STATE_FINISHED);
  for (const char* camera : {"left", "right"}) {
    response.mutable_session()->add_cameras()->mutable_description()->set_camera(camera);
  }
  *response.add_audit() = Complete(100);
  const SessionVerification verification = VerifySession(response);
  EXPECT_THAT(KindsOf(verification), ElementsAre("no_stream"));
  EXPECT_EQ(verification.problems[0].camera, "right");
}

TEST(SessionVerification, DoesNotHoldWhereRowsCameUnderNumbersThatWereTaken) {
  v1::GetSessionResponse response;
  response.mutable_session()->set_state(v1::Session::STATE_FINISHED);
  v1::SessionCamera* const camera = response.mutable_session()->add_cameras();
  camera->mutable_description()->set_camera("left");
  camera->set_conflict_count(3);
  *response.add_audit() = Complete(100);
  const SessionVerification verification = VerifySession(response);
  EXPECT_THAT(KindsOf(verification), ElementsAre("conflict"));
  EXPECT_EQ(verification.problems[0].count, 3u);
}

TEST(SessionVerification, IsPrintedAsATableAndAsJson) {
  v1::GetSessionResponse response;
  response.mutable_session()->set_id("wave");
  EXPECT_FALSE(VerifySession(response).holds());
  EXPECT_THAT(FormatVerification(VerifySession(response)), HasSubstr("wave has no streams"));
  *response.add_audit() = Complete(100);
  *response.add_audit() = Complete(60);
  response.mutable_audit(1)->set_late_count(7);
  const SessionVerification good = VerifySession(response);
  EXPECT_TRUE(good.holds());
  EXPECT_THAT(FormatVerification(good),
              AllOf(HasSubstr("verified: 160 detected = 160 durable and readable + 0 damaged + 0 "
                              "spooled + 0 dropped\n"),
                    HasSubstr("7 of the durable ones came after the session had finished")));
  response.mutable_audit(0)->set_stored_count(90);
  *response.mutable_audit(1) = Half();
  const SessionVerification bad = VerifySession(response);
  EXPECT_FALSE(bad.holds());
  EXPECT_THAT(FormatVerification(bad), AllOf(HasSubstr("\nnot verified: camera left, stream 77"),
                                             Not(HasSubstr("\nverified"))));
  const auto json = nlohmann::json::parse(VerificationJson(bad));
  EXPECT_EQ(json.at("session"), "wave");
  EXPECT_EQ(json.at("holds"), false);
  EXPECT_EQ(json.at("sum").at("detected"), 200);
  EXPECT_EQ(json.at("streams").at(0).at("missing"), 10);
  EXPECT_EQ(json.at("streams").at(1).at("spooled"), 40);
  EXPECT_EQ(json.at("problems").at(1).at("kind"), "waiting");
  EXPECT_EQ(json.at("problems").at(1).at("rows").dump(),
            R"([{"first":61,"last":100},{"first":101,"last":null}])");
}

TEST(SessionVerification, SaysThatRetentionHasDeletedWhatIsNotThere) {
  v1::GetSessionResponse response;
  *response.add_audit() = Complete(100);
  response.mutable_audit(0)->set_stored_count(0);
  response.mutable_session()->mutable_observations_delete_time()->set_seconds(1);
  const SessionVerification verification = VerifySession(response);
  EXPECT_THAT(KindsOf(verification), ElementsAre("deleted"));
  EXPECT_THAT(FirstText(verification), HasSubstr("retention has deleted"));
}

}  // namespace
}  // namespace rigcal::client::session_verification_test
