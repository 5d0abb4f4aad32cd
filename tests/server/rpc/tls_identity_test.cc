// SPDX-License-Identifier: Apache-2.0
// T9 and T10: who gets in with which certificate, and who stays in.
#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <atomic>
#include <string>
#include <thread>

#include "common/wire/grpc_status.h"
#include "server/identity/generation_proof.h"
#include "server/identity/server_identity.h"
#include "tests/server/rpc/tls_fixture.h"
#include "tests/testing/process.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing::tls_identity_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::SizeIs;

class TlsIdentity : public TlsFixture {
 protected:
  // Asks with a deadline of its own: a refused client tries again and again.
  absl::Status Ask(const std::shared_ptr<grpc::Channel>& channel) {
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(30));
    v1::GetStatusResponse response;
    return wire::FromGrpc(v1::StatusService::NewStub(channel)->GetStatus(&context, {}, &response));
  }
  bool AuditSays(const std::string& text) {
    return WaitFor([&] { return Audit().find(text) != std::string::npos; });
  }
};

TEST_F(TlsIdentity, WhoHasNoCertificateOfThisCaDoesNotGetIn) {
  EXPECT_THAT(Ask(UserChannel("viewer")), IsOk());
  EXPECT_THAT(Ask(Channel({})), StatusIs(absl::StatusCode::kUnavailable, HasSubstr("")));
  EXPECT_TRUE(AuditSays("connection_without_call")) << Audit();
  const TestCa other;
  EXPECT_THAT(Ask(Channel(other.MakeUser("kim", "viewer"))),
              StatusIs(absl::StatusCode::kUnavailable, HasSubstr("")));
  EXPECT_TRUE(AuditSays("another CA")) << Audit();
  EXPECT_THAT(Ask(Channel(ca_.Make({.common_name = "self", .self_signed = true}))),
              StatusIs(absl::StatusCode::kUnavailable, HasSubstr("")));
  EXPECT_TRUE(AuditSays("'self'")) << Audit();
  EXPECT_THAT(Ask(UserChannel("viewer")), IsOk()) << "the others are still served";
}

TEST_F(TlsIdentity, OutsideItsTimeACertificateDoesNotGetIn) {
  EXPECT_THAT(Ask(Channel(ca_.Make({.begins_in_s = -7200, .ends_in_s = -60}))),
              StatusIs(absl::StatusCode::kUnavailable, HasSubstr("")));
  EXPECT_TRUE(AuditSays("expired")) << Audit();
  EXPECT_THAT(Ask(Channel(ca_.Make({.begins_in_s = 3600}))),
              StatusIs(absl::StatusCode::kUnavailable, HasSubstr("")));
  EXPECT_TRUE(AuditSays("not yet valid")) << Audit();
}

TEST_F(TlsIdentity, ACertificateOfAnotherUseOrFormDoesNotGetIn) {
  EXPECT_THAT(Ask(Channel(server_certificate_)),
              StatusIs(absl::StatusCode::kUnavailable, HasSubstr("")));
  EXPECT_THAT(Ask(Channel(ca_.Make({.role = "root"}))),
              StatusIs(absl::StatusCode::kUnavailable, HasSubstr("")));
  EXPECT_TRUE(AuditSays("'root'")) << Audit();
}

TEST_F(TlsIdentity, AClientDoesNotTrustAServerOfAnotherCa) {
  const TestCa other;
  EXPECT_THAT(Ask(Channel(ca_.MakeUser("kim", "viewer"), other.certificate_pem())),
              StatusIs(absl::StatusCode::kUnavailable, HasSubstr("")));
}

TEST_F(TlsIdentity, ARevokedPeerIsCutAndStaysOut) {
  const TestCertificate revoked = ca_.MakeAgent("pc1");
  const auto channel = Channel(revoked);
  TestAgent agent(channel, MakeHello("pc1", {"left"}));
  agent.ReadHello();
  TestAgent other(AgentChannel("pc2"), MakeHello("pc2", {"right"}));
  other.ReadHello();
  Deny("rigcal://agents/pc1", revoked.serial);
  const auto before = std::chrono::steady_clock::now();
  EXPECT_FALSE(agent.AwaitEnd().ok());
  EXPECT_LT(std::chrono::steady_clock::now() - before, std::chrono::seconds(5));
  EXPECT_TRUE(AuditSays("connection_cut")) << Audit();
  TestAgent again(Channel(revoked), MakeHello("pc1", {"left"}, 1, 2));
  EXPECT_THAT(again.AwaitEnd(), StatusIs(absl::StatusCode::kUnavailable, HasSubstr("")));
  EXPECT_TRUE(AuditSays("was revoked; to let it in again")) << Audit();
  TestAgent joined_again(AgentChannel("pc1"), MakeHello("pc1", {"left"}, 1, 3));
  joined_again.ReadHello();
  v1::ConnectRequest ping;
  ping.mutable_time_ping()->set_host_monotonic_ns(1);
  other.Send(ping);
  other.ReadUntil(v1::ConnectResponse::kTimePong);
}

TEST_F(TlsIdentity, AWatchOfARevokedUserIsCut) {
  StartWave({"left"});
  const auto channel = UserChannel("viewer");
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(60));
  v1::WatchSessionRequest request;
  request.set_id("wave");
  const auto reader = v1::SessionService::NewStub(channel)->WatchSession(&context, request);
  v1::WatchSessionResponse response;
  ASSERT_TRUE(reader->Read(&response));
  Deny("rigcal://users/kim");
  const auto before = std::chrono::steady_clock::now();
  while (reader->Read(&response)) {
  }
  EXPECT_LT(std::chrono::steady_clock::now() - before, std::chrono::seconds(5));
  EXPECT_FALSE(reader->Finish().ok());
}

// An agent that cannot renew, and one that has renewed: both are cut at the end of the certificate
// that they came with; the second comes back with its new one, and nothing is lost.
TEST_F(TlsIdentity, AStreamEndsWithItsCertificate) {
  // Long enough to connect and to send.
  constexpr int64_t kLife_s = 4;
  TestAgent agent(Channel(ca_.Make({.ends_in_s = kLife_s})), MakeHello("pc1", {"left"}));
  agent.ReadHello();
  StartWave();
  agent.SendBatch(MakeBatch({"wave", "left", 1}, 1, 10));
  EXPECT_EQ(agent.ReadAck("left", 10).durable_seq(), 10u);
  TestAgent other(AgentChannel("pc2"), MakeHello("pc2", {"right"}));
  other.ReadHello();
  // Is it in time? What it sends at the end may not arrive, and is sent again.
  agent.SendBatch(MakeBatch({"wave", "left", 1}, 11, 20));
  EXPECT_FALSE(agent.AwaitEnd().ok());
  EXPECT_TRUE(AuditSays("its certificate has ended, at 20")) << Audit();
  TestAgent renewed(AgentChannel("pc1"), MakeHello("pc1", {"left"}, 1, 2));
  renewed.ReadHello();
  renewed.SendBatch(MakeBatch({"wave", "left", 1}, 11, 30));
  EXPECT_EQ(renewed.ReadAck("left", 30).durable_seq(), 30u);
  EXPECT_THAT(ReadRows(store(), "wave"), SizeIs(30));
  v1::ConnectRequest ping;
  ping.mutable_time_ping()->set_host_monotonic_ns(1);
  other.Send(ping);
  other.ReadUntil(v1::ConnectResponse::kTimePong);
}

class TlsRecord : public TlsIdentity {
 protected:
  TlsRecord() { has_ca_key_ = true; }
};

TEST_F(TlsRecord, OnlyCertificatesOnRecordGetInAndStayIn) {
  const TestCertificate known = ca_.MakeAgent("pc1");
  const TestCertificate ghost = ca_.MakeAgent("pc1");
  Record(known);
  EXPECT_THAT(Ask(Channel(ghost)), StatusIs(absl::StatusCode::kUnavailable, HasSubstr("")));
  EXPECT_TRUE(AuditSays("is not on record here")) << Audit();
  TestAgent agent(Channel(known), MakeHello("pc1", {"left"}));
  agent.ReadHello();
  Record(ghost);
  TestAgent again(Channel(ghost), MakeHello("pc1", {"left"}, 1, 2));
  again.ReadHello();
  std::filesystem::remove(identity() / "identities.json");
  EXPECT_FALSE(again.AwaitEnd().ok());
  EXPECT_TRUE(AuditSays("its certificate is not on record")) << Audit();
}

TEST_F(TlsRecord, AnAgentsWordAloneDoesNotStopAServer) {
  uint64_t superseded = 0;
  standbys_->OnSuperseded(
      [&](uint64_t generation, const std::string&) { superseded = generation; });
  const TestCertificate certificate = ca_.MakeAgent("pc1");
  Record(certificate);
  v1::AgentHello hello = MakeHello("pc1", {"left"});
  hello.set_known_server_id(store().server_id());
  hello.set_known_generation(7);
  const TemporaryDirectory elsewhere;
  ASSERT_THAT(server::EnsureServerIdentity(elsewhere.path(), {"pc"}), IsOk());
  ASSERT_OK_AND_ASSIGN(
      const std::string others,
      server::ProveGeneration(server::IdentityDirectory(elsewhere.path()), store().server_id(), 7));
  ASSERT_OK_AND_ASSIGN(const std::string lower,
                       server::ProveGeneration(identity(), store().server_id(), 6));
  for (const std::string& proof : {std::string(), others, lower}) {
    hello.set_known_generation_proof(proof);
    TestAgent agent(Channel(certificate), hello);
    EXPECT_THAT(agent.AwaitEnd(),
                StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("cannot prove it")));
    EXPECT_EQ(superseded, 0u);
  }
  ASSERT_OK_AND_ASSIGN(const std::string proof,
                       server::ProveGeneration(identity(), store().server_id(), 7));
  hello.set_known_generation_proof(proof);
  TestAgent agent(Channel(certificate), hello);
  EXPECT_THAT(agent.AwaitEnd(), StatusIs(absl::StatusCode::kFailedPrecondition,
                                         HasSubstr("a standby has taken over")));
  EXPECT_EQ(superseded, 7u);
}

TEST_F(TlsIdentity, ANewServerCertificateIsTakenUnderLoadAndABrokenOneIsNot) {
  TestAgent agent(AgentChannel("pc1"), MakeHello("pc1", {"left"}));
  agent.ReadHello();
  StartWave();
  std::atomic<bool> stop = false;
  uint32_t last_seq = 0;
  std::thread load([&] {
    while (!stop) {
      agent.SendBatch(MakeBatch({"wave", "left", 1}, last_seq + 1, last_seq + 10));
      last_seq += 10;
      SleepBriefly();
    }
  });
  const auto served = [&] {
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(30));
    v1::GetStatusResponse response;
    const auto channel = UserChannel("viewer");
    EXPECT_TRUE(v1::StatusService::NewStub(channel)->GetStatus(&context, {}, &response).ok());
    const auto pem = context.auth_context()->FindPropertyValues("x509_pem_cert");
    return pem.empty() ? "" : std::string(pem[0].data(), pem[0].size());
  };
  EXPECT_EQ(served(), server_certificate_.certificate_pem);
  const TestCertificate fresh = ca_.MakeServer();
  const TestCa other;
  ReplaceTestFile(identity() / "server.crt", other.MakeServer().certificate_pem);
  std::this_thread::sleep_for(std::chrono::milliseconds(2500));
  EXPECT_EQ(served(), server_certificate_.certificate_pem) << "a broken one is not served";
  ca_.WriteServerFolder(identity(), fresh);
  EXPECT_TRUE(WaitFor([&] { return served() == fresh.certificate_pem; }, std::chrono::seconds(15)));
  stop = true;
  load.join();
  EXPECT_EQ(agent.ReadAck("left", last_seq).durable_seq(), last_seq);
  EXPECT_THAT(ReadRows(store(), "wave"), SizeIs(last_seq)) << "no batch was lost";
}

}  // namespace
}  // namespace rigcal::testing::tls_identity_test
