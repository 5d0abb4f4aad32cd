// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <string>

#include "common/wire/grpc_status.h"
#include "tests/server/rpc/rpc_fixture.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing::status_service_test {
namespace {

using ::testing::HasSubstr;

class StatusService : public RpcFixture {
 protected:
  v1::GetStatusResponse Status() {
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(60));
    v1::GetStatusResponse status;
    EXPECT_THAT(
        wire::FromGrpc(v1::StatusService::NewStub(channel())->GetStatus(&context, {}, &status)),
        IsOk());
    return status;
  }
};

TEST_F(StatusService, CountsWhatTheServerHas) {
  rpc_options_.ingest_queue_limit_bytes = 1000;
  RestartServer();
  StartWave({"left"});
  ASSERT_THAT(client().CreateSession(WaveRequest("second")), IsOk());
  ASSERT_THAT(client().Upload(MakeBatch({"wave", "left", 1}, 1, 10)), IsOk());
  ASSERT_THAT(client().Upload(MakeBatch({"wave", "left", 1}, 6, 12)), IsOk());
  TestAgent agent(channel(), MakeHello("pc", {"right"}));
  agent.ReadHello();
  const v1::GetStatusResponse status = Status();
  EXPECT_EQ(status.software_version(), "0.1.0");
  EXPECT_EQ(status.protocol_version().major(), 2u);
  EXPECT_EQ(status.server_id(), store().server_id());
  EXPECT_TRUE(status.has_start_time());
  EXPECT_EQ(status.connected_agent_count(), 1u);
  EXPECT_EQ(status.session_count(), 2u);
  EXPECT_EQ(status.capturing_session_count(), 1u);
  EXPECT_EQ(status.ingest().stored_observation_count(), 12u);
  EXPECT_EQ(status.ingest().duplicate_observation_count(), 5u);
  EXPECT_EQ(status.ingest().commit_count(), 2u);
  EXPECT_EQ(status.ingest().queue_limit_bytes(), 1000u);
  EXPECT_EQ(status.ingest().problem(), "");
  EXPECT_EQ(status.store().kind(), "sqlite");
  EXPECT_GT(status.store().size_bytes(), 0u);
  ASSERT_EQ(status.workers_size(), 1);
  EXPECT_TRUE(status.workers(0).is_server());
  EXPECT_TRUE(status.workers(0).is_alive());
  EXPECT_EQ(status.workers(0).pid(), getpid());
}

TEST_F(StatusService, SaysWhyNothingIsTaken) {
  StartWave({"left"});
  faulty().Fail("Append", absl::ResourceExhaustedError("disk full"));
  EXPECT_FALSE(client().Upload(MakeBatch({"wave", "left", 1}, 1, 10)).ok());
  EXPECT_EQ(Status().ingest().problem(), "disk full");
}

TEST_F(StatusService, SaysThatTheStoreIsBroken) {
  EXPECT_EQ(Status().store().problem(), "");
  EXPECT_GT(Status().store().reserve_bytes(), 0u);
  EXPECT_FALSE(Status().store().has_retention());
  faulty().Fail("Health", absl::InternalError("a sync has failed; restart the server"));
  EXPECT_EQ(Status().store().problem(), "a sync has failed; restart the server");
}

TEST_F(StatusService, CountsConflicts) {
  StartWave({"left"});
  ASSERT_THAT(client().Upload(MakeBatch({"wave", "left", 1}, 1, 10)), IsOk());
  ObservationBatch forged = MakeBatch({"wave", "left", 1}, 1, 10);
  forged.time_ns[4] += 1;
  ASSERT_OK_AND_ASSIGN(const v1::BatchAck ack, client().Upload(forged));
  EXPECT_EQ(ack.conflict_count(), 1u);
  EXPECT_EQ(ack.durable_seq(), 10u);
  EXPECT_EQ(Status().ingest().conflict_observation_count(), 1u);
  EXPECT_EQ(Status().ingest().duplicate_observation_count(), 9u);
  ASSERT_OK_AND_ASSIGN(const v1::Session session, client().GetSession("wave"));
  EXPECT_EQ(session.cameras(0).conflict_count(), 1u);
  EXPECT_EQ(session.cameras(0).refused(0).reason(), v1::REFUSAL_REASON_CONFLICT);
}

}  // namespace
}  // namespace rigcal::testing::status_service_test
