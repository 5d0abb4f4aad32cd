// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "client/commands/doctor_command.h"
#include "common/wire/protocol_version.h"
#include "tests/client/sample_messages.h"

namespace rigcal::client::doctor_checks_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

TEST(CheckVersions, ComparesBothSides) {
  v1::GetStatusResponse status;
  status.set_software_version(std::string(wire::kSoftwareVersion));
  *status.mutable_protocol_version() = wire::OwnProtocolVersion();
  EXPECT_EQ(CheckVersions(status).level, CheckLevel::kOk);
  status.set_software_version("9.9.9");
  EXPECT_EQ(CheckVersions(status).level, CheckLevel::kWarn);
  status.mutable_protocol_version()->set_major(wire::kProtocolMajor + 1);
  EXPECT_EQ(CheckVersions(status).level, CheckLevel::kFail);
  EXPECT_THAT(CheckVersions(status).advice, Not(IsEmpty()));
}

TEST(CheckIngest, FailsOnAProblemAndWarnsOfAFullQueue) {
  v1::IngestStatus ingest;
  ingest.set_queue_limit_bytes(1000);
  EXPECT_EQ(CheckIngest(ingest).level, CheckLevel::kOk);
  ingest.set_refused_observation_count(2);
  EXPECT_EQ(CheckIngest(ingest).level, CheckLevel::kWarn);
  ingest.set_queue_bytes(950);
  EXPECT_THAT(CheckIngest(ingest).message, HasSubstr("nearly full"));
  ingest.set_problem("the disk is full");
  EXPECT_EQ(CheckIngest(ingest).level, CheckLevel::kFail);
  EXPECT_THAT(CheckIngest(ingest).message, HasSubstr("the disk is full"));
}

TEST(CheckConnections, NamesWhoFloodedTheServer) {
  v1::ConnectionStatus connections;
  connections.set_open_count(3);
  connections.set_limit(1024);
  EXPECT_EQ(CheckConnections(connections).level, CheckLevel::kOk);
  connections.set_flooding_count(2);
  v1::FloodRecord* flood = connections.add_floods();
  flood->set_peer("agent 'pc-3' (certificate 1a)");
  flood->set_address("10.0.0.5:41002");
  flood->set_reason("it has sent 9.0 MB that no call accounts for");
  EXPECT_EQ(CheckConnections(connections).level, CheckLevel::kWarn);
  EXPECT_THAT(CheckConnections(connections).message,
              AllOf(HasSubstr("agent 'pc-3'"), HasSubstr("10.0.0.5:41002"), HasSubstr("9.0 MB")));
  EXPECT_THAT(CheckConnections(connections).advice, HasSubstr("rigcal agent forget"));
  connections.clear_flooding_count();
  connections.set_deaf(true);
  EXPECT_EQ(CheckConnections(connections).level, CheckLevel::kFail);
}

TEST(CheckStore, WarnsBeforeItFails) {
  v1::StoreStatus store;
  store.set_kind("sqlite");
  store.set_free_bytes(uint64_t{100} << 30);
  EXPECT_EQ(CheckStore(store).level, CheckLevel::kOk);
  store.set_free_bytes(uint64_t{1} << 30);
  EXPECT_EQ(CheckStore(store).level, CheckLevel::kWarn);
  store.set_free_bytes(0);
  EXPECT_EQ(CheckStore(store).level, CheckLevel::kFail);
}

TEST(CheckStore, SaysThatTheReserveIsReachedAndThatTheStoreIsBroken) {
  v1::StoreStatus store;
  store.set_free_bytes(uint64_t{1} << 30);
  store.set_reserve_bytes(uint64_t{1} << 31);
  EXPECT_EQ(CheckStore(store).level, CheckLevel::kFail);
  store.set_free_bytes(uint64_t{100} << 30);
  store.set_problem("a sync has failed");
  EXPECT_EQ(CheckStore(store).level, CheckLevel::kFail);
  EXPECT_THAT(CheckStore(store).message, HasSubstr("a sync has failed"));
}

TEST(CheckStore, NamesPostgresqlAndNoDiskWhereItIsAway) {
  v1::StoreStatus store;
  store.set_kind("postgresql");
  EXPECT_EQ(CheckStore(store).level, CheckLevel::kOk);
  store.set_problem("postgresql://rigcal@db/rigcal cannot be reached");
  const Check check = CheckStore(store);
  EXPECT_EQ(check.level, CheckLevel::kFail);
  EXPECT_EQ(check.name, "database");
  EXPECT_THAT(check.message, HasSubstr("cannot be reached"));
  EXPECT_THAT(check.advice, HasSubstr("PostgreSQL"));
}

TEST(CheckSessions, NamesADamagedRecord) {
  v1::ListSessionsResponse sessions;
  sessions.add_sessions()->set_damage("the record of session wave is damaged");
  EXPECT_EQ(CheckSessions(sessions, 0).level, CheckLevel::kFail);
  EXPECT_THAT(CheckSessions(sessions, 0).message, HasSubstr("session wave"));
}

TEST(CheckOfferedCameras, NamesChosenOnesThatAreAway) {
  v1::ListAgentsResponse agents;
  v1::Agent* agent = agents.add_agents();
  agent->set_agent_id("pc-1");
  agent->set_connected(true);
  EXPECT_FALSE(CheckOfferedCameras(agents).has_value());
  v1::OfferedCamera* camera = agent->add_offered();
  camera->set_device("2345");
  camera->set_use(v1::OfferedCamera::USE_FREE);
  ASSERT_TRUE(CheckOfferedCameras(agents).has_value());
  EXPECT_EQ(CheckOfferedCameras(agents)->level, CheckLevel::kOk);
  EXPECT_THAT(CheckOfferedCameras(agents)->message, HasSubstr("1 camera found, 1 of them not"));
  camera->set_camera("left");
  camera->set_use(v1::OfferedCamera::USE_GONE);
  camera->set_note("it does not answer");
  EXPECT_EQ(CheckOfferedCameras(agents)->level, CheckLevel::kWarn);
  EXPECT_THAT(CheckOfferedCameras(agents)->message, HasSubstr("pc-1/2345 (left)"));
  EXPECT_THAT(CheckOfferedCameras(agents)->advice, HasSubstr("it does not answer"));
  agent->set_connected(false);
  EXPECT_FALSE(CheckOfferedCameras(agents).has_value());
}

TEST(CheckAgents, CountsAndNamesTheGone) {
  v1::ListAgentsResponse agents;
  EXPECT_EQ(CheckAgents(agents).level, CheckLevel::kWarn);
  v1::Agent* agent = agents.add_agents();
  agent->set_agent_id("pc-1");
  agent->set_connected(true);
  agent->add_cameras()->set_camera("left");
  EXPECT_EQ(CheckAgents(agents).level, CheckLevel::kOk);
  EXPECT_THAT(CheckAgents(agents).message, HasSubstr("1 agent with 1 camera "));
  agents.add_agents()->set_agent_id("pc-2");
  EXPECT_EQ(CheckAgents(agents).level, CheckLevel::kWarn);
  EXPECT_THAT(CheckAgents(agents).message, HasSubstr("pc-2"));
}

TEST(CheckIntrinsics, NamesConnectedCamerasWithoutThem) {
  v1::ListAgentsResponse agents;
  v1::Agent* agent = agents.add_agents();
  agent->set_rig("lab");
  agent->set_connected(true);
  agent->add_cameras()->set_camera("left");
  agent->mutable_cameras(0)->mutable_intrinsics();
  EXPECT_EQ(CheckIntrinsics(agents).level, CheckLevel::kOk);
  agent->add_cameras()->set_camera("right");
  EXPECT_EQ(CheckIntrinsics(agents).level, CheckLevel::kWarn);
  EXPECT_THAT(CheckIntrinsics(agents).message,
              AllOf(HasSubstr("lab/right"), Not(HasSubstr("left"))));
  agent->set_connected(false);
  EXPECT_EQ(CheckIntrinsics(agents).level, CheckLevel::kOk);
}

TEST(CheckSessions, FindsTheStuck) {
  v1::ListSessionsResponse sessions;
  *sessions.add_sessions() = rigcal::testing::FullSession("wave");
  v1::Session* session = sessions.mutable_sessions(0);
  EXPECT_EQ(CheckSessions(sessions, 1000).level, CheckLevel::kOk);
  session->mutable_cameras(1)->set_connected(false);
  EXPECT_EQ(CheckSessions(sessions, 1000).level, CheckLevel::kWarn);
  EXPECT_THAT(CheckSessions(sessions, 1000).message,
              AllOf(HasSubstr("wave"), HasSubstr("right"), Not(HasSubstr("left"))));
  // A camera that has delivered everything may go.
  session->mutable_cameras(1)->set_ended(true);
  EXPECT_EQ(CheckSessions(sessions, 1000).level, CheckLevel::kOk);
  session->set_state(v1::Session::STATE_DRAINING);
  session->mutable_drain_deadline()->set_seconds(900);
  EXPECT_EQ(CheckSessions(sessions, 905).level, CheckLevel::kOk);
  EXPECT_THAT(CheckSessions(sessions, 1000).message, HasSubstr("past its deadline"));
  session->set_state(v1::Session::STATE_FINISHED);
  EXPECT_EQ(CheckSessions(sessions, 1000).level, CheckLevel::kOk);
}

TEST(CheckHealthWord, OnlyServingIsHealthy) {
  EXPECT_EQ(CheckHealthWord("SERVING").level, CheckLevel::kOk);
  EXPECT_EQ(CheckHealthWord("NOT_SERVING").level, CheckLevel::kFail);
}

}  // namespace
}  // namespace rigcal::client::doctor_checks_test
