// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/rpc_server.h"

#include <gmock/gmock.h>
#include <google/protobuf/descriptor.h>
#include <grpc/health/v1/health.pb.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <chrono>
#include <memory>
#include <string>

#include "common/wire/grpc_status.h"
#include "rigcal/v1/ingest_service.pb.h"
#include "tests/server/rpc/rpc_fixture.h"
#include "tests/testing/process.h"
#include "tests/testing/reflection_client.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing::rpc_server_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

class RpcServer : public RpcFixture {
 protected:
  std::string Health(const std::string& service) {
    grpc::health::v1::HealthCheckRequest request;
    request.set_service(service);
    const auto answer =
        CallRaw(channel(), "/grpc.health.v1.Health/Check", request.SerializeAsString());
    if (!answer.ok()) return answer.status().ToString();
    grpc::health::v1::HealthCheckResponse response;
    EXPECT_TRUE(response.ParseFromString(*answer));
    return grpc::health::v1::HealthCheckResponse::ServingStatus_Name(response.status());
  }
};

TEST_F(RpcServer, HealthKnowsEveryService) {
  EXPECT_EQ(Health(""), "SERVING");
  for (const char* service :
       {"IngestService", "AgentService", "CameraService", "IdentityService", "SessionService",
        "CalibrationService", "MaintenanceService", "RigService", "StatusService"}) {
    EXPECT_EQ(Health(std::string("rigcal.v1.") + service), "SERVING") << service;
  }
  EXPECT_THAT(Health("rigcal.v1.Nobody"), HasSubstr("NOT_FOUND"));
}

TEST_F(RpcServer, HealthTellsWhenIngestTakesNothing) {
  rpc_options_.health_interval = std::chrono::milliseconds(5);
  RestartServer();
  StartWave({"left"});
  faulty().Fail("Append", absl::ResourceExhaustedError("disk full"));
  EXPECT_FALSE(client().Upload(MakeBatch({"wave", "left", 1}, 1, 3)).ok());
  EXPECT_TRUE(WaitFor([&] { return Health("rigcal.v1.IngestService") == "NOT_SERVING"; }));
  EXPECT_EQ(Health("rigcal.v1.SessionService"), "SERVING") << "reads and deletes still work";
  faulty().Fail("Append", absl::OkStatus());
  EXPECT_THAT(client().Upload(MakeBatch({"wave", "left", 1}, 1, 3)), IsOk());
  EXPECT_TRUE(WaitFor([&] { return Health("rigcal.v1.IngestService") == "SERVING"; }));
}

// Not only ingest finds a broken disk.
TEST_F(RpcServer, HealthTellsWhenTheStoreIsBroken) {
  rpc_options_.health_interval = std::chrono::milliseconds(5);
  RestartServer();
  faulty().Fail("Health", absl::InternalError("a sync has failed; restart the server"));
  for (const char* service : {"", "rigcal.v1.IngestService", "rigcal.v1.SessionService",
                              "rigcal.v1.CalibrationService"}) {
    EXPECT_TRUE(WaitFor([&] { return Health(service) == "NOT_SERVING"; })) << service;
  }
  EXPECT_EQ(Health("rigcal.v1.StatusService"), "SERVING");
}

TEST_F(RpcServer, ReflectionListsAndDescribesServices) {
  EXPECT_THAT(Reflect(channel(), "list_services: ''"),
              AllOf(HasSubstr("rigcal.v1.AgentService"), HasSubstr("rigcal.v1.StatusService"),
                    HasSubstr("grpc.health.v1.Health")));
  EXPECT_THAT(Reflect(channel(), "file_containing_symbol: 'rigcal.v1.AgentService'"),
              AllOf(HasSubstr("file_descriptor_proto"), HasSubstr("agent_service.proto")));
  EXPECT_THAT(Reflect(channel(), "file_containing_symbol: 'grpc.health.v1.Health'"),
              AllOf(HasSubstr("file_descriptor_proto"), HasSubstr("health.proto")));
  EXPECT_THAT(Reflect(channel(), "file_containing_symbol: 'rigcal.v1.Nobody'"),
              HasSubstr("error_response"));
}

TEST_F(RpcServer, ServesOnAPortOfItsOwnAndNamesOneInUse) {
  rpc_options_.endpoint.listen_address = "127.0.0.1:0";
  RestartServer();
  ASSERT_GT(port_, 0);
  const std::string address = "127.0.0.1:" + std::to_string(port_);
  EXPECT_THAT(ServerClient(address).ListAgents(), IsOk());

  server::RpcServerOptions options = rpc_options_;
  options.endpoint.listen_address = address;
  server::RpcServer second(options, {.store = faulty_.get(),
                                     .ingest = ingest_.get(),
                                     .directory = directory_of_agents_.get(),
                                     .coordinator = coordinator_.get(),
                                     .runner = runner_.get()});
  EXPECT_THAT(second.Start(), StatusIs(absl::StatusCode::kUnavailable,
                                       AllOf(HasSubstr(address), HasSubstr("--listen"))));
  EXPECT_THAT(ServerClient(address).ListAgents(), IsOk()) << "the first one goes on";
}

TEST_F(RpcServer, AMethodThatDoesNotExistIsUnimplemented) {
  EXPECT_THAT(CallRaw(channel(), "/rigcal.v1.SessionService/Nothing", ""),
              StatusIs(absl::StatusCode::kUnimplemented, HasSubstr("")));
}

TEST_F(RpcServer, GarbageInsteadOfAMessageIsAnInvalidArgumentOfEveryMethod) {
  for (const char* service :
       {"AgentService", "CalibrationService", "CameraService", "IdentityService", "IngestService",
        "MaintenanceService", "RigService", "SessionService", "StatusService"}) {
    const auto* const methods =
        google::protobuf::DescriptorPool::generated_pool()->FindServiceByName(
            std::string("rigcal.v1.") + service);
    ASSERT_NE(methods, nullptr) << service;
    for (int i = 0; i < methods->method_count(); ++i) {
      const std::string name = "/" + methods->full_name() + "/" + methods->method(i)->name();
      EXPECT_THAT(CallRaw(channel(), name, std::string(100, '\xff')),
                  StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("no message")))
          << name;
    }
  }
  EXPECT_THAT(client().ListAgents(), IsOk());
}

TEST_F(RpcServer, AMessageOverALimitIsRefusedWithThePathOfTheField) {
  v1::UploadBatchRequest upload;
  for (int i = 0; i < 400'000; ++i) upload.mutable_batch()->add_clock_samples();
  EXPECT_THAT(
      CallRaw(channel(), "/rigcal.v1.IngestService/UploadBatch", upload.SerializeAsString()),
      StatusIs(absl::StatusCode::kInvalidArgument,
               HasSubstr("batch.clock_samples: has more than")));
  v1::CreateSessionRequest create = WaveRequest("wave");
  create.set_title(std::string(100'000, 'x'));
  EXPECT_THAT(client().CreateSession(create),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("title: has 100000 bytes")));
}

TEST_F(RpcServer, StopsAtOnceWhenAClientIsIdle) {
  RestartServerOnPort();
  ASSERT_THAT(client().ListAgents(), IsOk());  // the connection is there
  const auto start = std::chrono::steady_clock::now();
  rpc_->Shutdown(std::chrono::seconds(60));
  // Against waiting for the client, which would take all of the minute.
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(20));
}

TEST_F(RpcServer, RefusesAnOpenAddressAndTooLittleMemory) {
  const server::RpcServerParts parts{.store = faulty_.get(),
                                     .ingest = ingest_.get(),
                                     .directory = directory_of_agents_.get(),
                                     .coordinator = coordinator_.get(),
                                     .runner = runner_.get()};
  server::RpcServer open({.endpoint = {.listen_address = "0.0.0.0:1"}}, parts);
  EXPECT_THAT(open.Start(),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("0.0.0.0:1")));
  server::RpcServer nowhere({.endpoint = {.listen_address = "7420"}}, parts);
  EXPECT_THAT(nowhere.Start(),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("HOST:PORT")));
  server::RpcServer no_identity(
      {.endpoint = {.listen_address = "127.0.0.1:0", .identity_folder = "/nonexistent"}}, parts);
  EXPECT_THAT(no_identity.Start(),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("ca.crt")));
  server::RpcServer small({.endpoint = {.listen_address = "", .memory_limit_bytes = 1u << 20}},
                          parts);
  EXPECT_THAT(small.Start(),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("limits.rpc_memory_mb")));
}

}  // namespace
}  // namespace rigcal::testing::rpc_server_test
