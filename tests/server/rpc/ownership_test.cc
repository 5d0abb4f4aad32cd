// SPDX-License-Identifier: Apache-2.0
// Who may write which stream, by either way in; and whose an agent_id and a camera are.
#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "common/wire/grpc_status.h"
#include "common/wire/observation_wire.h"
#include "rigcal/v1/camera_service.grpc.pb.h"
#include "tests/server/rpc/tls_fixture.h"
#include "tests/testing/process.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing::ownership_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::SizeIs;

const StreamKey kLeft{"wave", "left", 1};

absl::Status Upload(const std::shared_ptr<grpc::Channel>& channel,
                    const v1::UploadBatchRequest& request) {
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(60));
  v1::UploadBatchResponse response;
  return wire::FromGrpc(
      v1::IngestService::NewStub(channel)->UploadBatch(&context, request, &response));
}

absl::StatusOr<v1::MoveCameraResponse> Move(const std::shared_ptr<grpc::Channel>& channel,
                                            const std::string& camera,
                                            const std::string& agent_id) {
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(60));
  v1::MoveCameraRequest request;
  request.set_camera(camera);
  request.set_agent_id(agent_id);
  v1::MoveCameraResponse response;
  const grpc::Status status =
      v1::CameraService::NewStub(channel)->MoveCamera(&context, request, &response);
  if (!status.ok()) return wire::FromGrpc(status);
  return response;
}

v1::UploadBatchRequest Rows(const StreamKey& stream, uint32_t first, uint32_t last) {
  v1::UploadBatchRequest request;
  wire::ToProto(MakeBatch(stream, first, last), request.mutable_batch());
  return request;
}

// What swallowed 1 257 rows of a live agent: rows 5 to 1000 are said to be dropped.
v1::UploadBatchRequest ForgedDrops() {
  v1::UploadBatchRequest request = Rows(kLeft, 4, 4);
  v1::DroppedRange* range = request.mutable_batch()->add_dropped();
  range->set_first_seq(5);
  range->set_count(996);
  range->set_reason(v1::RefusalReason(1));
  return request;
}

v1::UploadBatchRequest ForgedEnd() {
  v1::UploadBatchRequest request;
  *request.mutable_end_of_capture() = EndMessage(kLeft, 2).end_of_capture();
  return request;
}

std::vector<v1::UploadBatchRequest> Forgeries() {
  return {Rows(kLeft, 4, 400), ForgedDrops(), ForgedEnd()};
}

class Ownership : public RpcFixture {
 protected:
  void SetUp() override {
    audit_ = std::make_unique<server::AuditLog>(folder_.path() / "audit.jsonl");
    auto registry = server::AgentRegistry::Open({.file = folder_.path() / "agents.json"});
    ASSERT_THAT(registry, IsOk());
    registry_ = *std::move(registry);
    RpcFixture::SetUp();
  }
  static v1::AgentHello Hello(const std::string& agent_id, const std::string& secret,
                              uint32_t incarnation = 1) {
    v1::AgentHello hello = MakeHello(agent_id, {"left"}, incarnation);
    hello.set_installation_secret(secret);
    return hello;
  }
  std::string Audit() const {
    std::ifstream stream(folder_.path() / "audit.jsonl");
    return {std::istreambuf_iterator<char>(stream), {}};
  }

  TemporaryDirectory folder_;
};

TEST_F(Ownership, AnUploadForALiveAgentIsRefusedAndItsRowsAreExact) {
  TestAgent agent(channel(), Hello("pc1", "secret"));
  agent.ReadHello();
  StartWave();
  agent.SendBatch(MakeBatch(kLeft, 1, 3));
  agent.ReadAck("left", 3);
  for (v1::UploadBatchRequest forgery : Forgeries()) {
    EXPECT_THAT(Upload(channel(), forgery),
                StatusIs(absl::StatusCode::kPermissionDenied,
                         AllOf(HasSubstr("left"), HasSubstr("'pc1'"), HasSubstr("no agent"))));
    forgery.set_agent_id("eve");
    EXPECT_THAT(Upload(channel(), forgery),
                StatusIs(absl::StatusCode::kPermissionDenied, HasSubstr("'eve'")));
    for (const char* secret : {"", "guess"}) {
      forgery.set_agent_id("pc1");
      forgery.set_installation_secret(secret);
      EXPECT_THAT(Upload(channel(), forgery),
                  StatusIs(absl::StatusCode::kAlreadyExists, HasSubstr("'pc1'")));
    }
  }
  agent.SendBatch(MakeBatch(kLeft, 4, 6));
  EXPECT_EQ(agent.ReadAck("left", 6).durable_seq(), 6u);
  EXPECT_THAT(ReadRows(store(), "wave"), SizeIs(6));
  EXPECT_EQ(client().GetSession("wave")->state(), v1::Session::STATE_CAPTURING);
  EXPECT_THAT(Audit(), AllOf(HasSubstr("\"refused\""), HasSubstr("eve"), HasSubstr("left")));
}

TEST_F(Ownership, TheAgentItselfMayUpload) {
  {
    TestAgent agent(channel(), Hello("pc1", "secret"));
    agent.ReadHello();
    StartWave();
  }
  v1::UploadBatchRequest request = Rows(kLeft, 1, 3);
  request.set_agent_id("pc1");
  request.set_installation_secret("secret");
  EXPECT_THAT(Upload(channel(), request), IsOk());
  EXPECT_THAT(ReadRows(store(), "wave"), SizeIs(3));
}

TEST_F(Ownership, ACameraDescribedByHandIsForWhoeverIsNoAgent) {
  StartWave({"left"});
  v1::UploadBatchRequest request = Rows(kLeft, 1, 3);
  EXPECT_THAT(Upload(channel(), request), IsOk());
  request.set_agent_id("pc1");
  EXPECT_THAT(Upload(channel(), request),
              StatusIs(absl::StatusCode::kPermissionDenied, HasSubstr("by hand")));
}

TEST_F(Ownership, AHigherIncarnationAloneFencesNobody) {
  TestAgent agent(channel(), Hello("pc1", "secret"));
  agent.ReadHello();
  StartWave();
  for (const char* secret : {"", "guess"}) {
    TestAgent thief(channel(), Hello("pc1", secret, 4'000'000'000));
    EXPECT_THAT(thief.AwaitEnd(), StatusIs(absl::StatusCode::kAlreadyExists,
                                           AllOf(HasSubstr("'pc1'"), HasSubstr("another secret"))));
  }
  agent.SendBatch(MakeBatch(kLeft, 1, 3));
  EXPECT_EQ(agent.ReadAck("left", 3).durable_seq(), 3u) << "the true one goes on";
  TestAgent restarted(channel(), Hello("pc1", "secret", 2));
  restarted.ReadHello();
  EXPECT_THAT(agent.AwaitEnd(), StatusIs(absl::StatusCode::kAborted, HasSubstr("took over")));
}

TEST_F(Ownership, AnAgentOfAnEarlierReleaseIsNotDisplacedByASecret) {
  TestAgent old(channel(), Hello("pc1", ""));
  old.ReadHello();
  TestAgent thief(channel(), Hello("pc1", "guess", 7));
  EXPECT_THAT(thief.AwaitEnd(),
              StatusIs(absl::StatusCode::kAlreadyExists, HasSubstr("another installation")));
  TestAgent restarted(channel(), Hello("pc1", "", 2));
  restarted.ReadHello();
}

TEST_F(Ownership, ACameraStaysWithItsAgentUntilItIsMoved) {
  {
    TestAgent first(channel(), Hello("pc1", "1"));
    first.ReadHello();
    EXPECT_THAT(Move(channel(), "left", "pc2"),
                StatusIs(absl::StatusCode::kFailedPrecondition,
                         AllOf(HasSubstr("'pc1'"), HasSubstr("stop that agent"))));
  }
  ASSERT_TRUE(WaitFor([&] { return directory_of_agents_->ConnectedCount() == 0; }));
  TestAgent second(channel(), Hello("pc2", "2"));
  EXPECT_THAT(second.AwaitEnd(), StatusIs(absl::StatusCode::kAlreadyExists,
                                          AllOf(HasSubstr("rig/left"), HasSubstr("'pc1'"),
                                                HasSubstr("rigcal camera move"))));
  ASSERT_OK_AND_ASSIGN(const v1::MoveCameraResponse moved, Move(channel(), "left", "pc2"));
  EXPECT_EQ(moved.previous_agent_id(), "pc1");
  EXPECT_EQ(moved.rig(), "rig");
  TestAgent again(channel(), Hello("pc2", "2"));
  again.ReadHello();
  TestAgent first(channel(), Hello("pc1", "1", 2));
  EXPECT_THAT(first.AwaitEnd(), StatusIs(absl::StatusCode::kAlreadyExists, HasSubstr("'pc2'")));
  EXPECT_THAT(Move(channel(), "", "pc2"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("camera")));
  EXPECT_THAT(Audit(), AllOf(HasSubstr("agent_connected"), HasSubstr("MoveCamera")));
}

// The same over TLS, where certificates name the callers.
class OwnershipOverTls : public TlsFixture {};

TEST_F(OwnershipOverTls, AnAgentIsWhomItsCertificateNames) {
  TestAgent wrong(AgentChannel("pc2"), MakeHello("pc1", {"left"}));
  EXPECT_THAT(wrong.AwaitEnd(),
              StatusIs(absl::StatusCode::kPermissionDenied,
                       AllOf(HasSubstr("agent 'pc2'"), HasSubstr("as agent 'pc1'"))));
  EXPECT_THAT(Audit(),
              AllOf(HasSubstr("\"refused\""), HasSubstr("agent 'pc2'"), HasSubstr("127.0.0.1:")));
}

TEST_F(OwnershipOverTls, NobodyButTheOwnerWritesToACamera) {
  TestAgent agent(AgentChannel("pc1"), MakeHello("pc1", {"left"}));
  agent.ReadHello();
  StartWave();
  agent.SendBatch(MakeBatch(kLeft, 1, 3));
  agent.ReadAck("left", 3);
  for (v1::UploadBatchRequest forgery : Forgeries()) {
    EXPECT_THAT(Upload(UserChannel("viewer"), forgery),
                StatusIs(absl::StatusCode::kPermissionDenied, HasSubstr("role viewer")));
    for (const char* role : {"operator", "admin"}) {
      EXPECT_THAT(Upload(UserChannel(role), forgery),
                  StatusIs(absl::StatusCode::kPermissionDenied, HasSubstr("'pc1'")));
    }
    EXPECT_THAT(Upload(AgentChannel("pc2"), forgery),
                StatusIs(absl::StatusCode::kPermissionDenied, HasSubstr("'pc2'")));
    forgery.set_agent_id("pc1");
    for (const auto& channel : {AgentChannel("pc2"), UserChannel("operator")}) {
      EXPECT_THAT(Upload(channel, forgery),
                  StatusIs(absl::StatusCode::kPermissionDenied, HasSubstr("as agent 'pc1'")));
    }
  }
  // By its own stream, too: announced or not.
  TestAgent unannounced(AgentChannel("pc2"), MakeHello("pc2", {"right"}));
  unannounced.ReadHello();
  unannounced.SendBatch(MakeBatch(kLeft, 4, 6));
  EXPECT_THAT(unannounced.AwaitEnd(),
              StatusIs(absl::StatusCode::kPermissionDenied, HasSubstr("announced")));
  TestAgent announced(AgentChannel("pc2"), MakeHello("pc2", {"left"}, 2));
  EXPECT_THAT(announced.AwaitEnd(), StatusIs(absl::StatusCode::kAlreadyExists, HasSubstr("pc1")));
  agent.SendBatch(MakeBatch(kLeft, 4, 6));
  EXPECT_EQ(agent.ReadAck("left", 6).durable_seq(), 6u);
  EXPECT_THAT(ReadRows(store(), "wave"), SizeIs(6));
  EXPECT_THAT(Upload(AgentChannel("pc1"), Rows(kLeft, 7, 8)), IsOk()) << "the owner itself";
  EXPECT_THAT(ReadRows(store(), "wave"), SizeIs(8));
}

TEST_F(OwnershipOverTls, AnOperatorUploadsAndMovesAndAnAgentDoesNot) {
  StartWave({"left"});
  EXPECT_THAT(Upload(UserChannel("operator"), Rows(kLeft, 1, 3)), IsOk());
  EXPECT_THAT(Upload(AgentChannel("pc1"), Rows(kLeft, 4, 5)),
              StatusIs(absl::StatusCode::kPermissionDenied, HasSubstr("by hand")));
  EXPECT_THAT(Move(AgentChannel("pc2"), "left", "pc2"),
              StatusIs(absl::StatusCode::kPermissionDenied, HasSubstr("role agent")));
  EXPECT_THAT(Move(UserChannel("operator"), "left", "pc2"), IsOk());
}

}  // namespace
}  // namespace rigcal::testing::ownership_test
