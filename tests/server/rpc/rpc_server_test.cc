// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/rpc_server.h"

#include <gmock/gmock.h>
#include <grpc/health/v1/health.pb.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <chrono>
#include <memory>
#include <string>

#include "common/wire/grpc_status.h"
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
  for (const char* service : {"IngestService", "AgentService", "CameraService", "SessionService",
                              "CalibrationService", "StatusService"}) {
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
  rpc_options_.listen_address = "127.0.0.1:0";
  RestartServer();
  ASSERT_GT(port_, 0);
  const std::string address = "127.0.0.1:" + std::to_string(port_);
  EXPECT_THAT(ServerClient(address).ListAgents(), IsOk());

  server::RpcServerOptions options = rpc_options_;
  options.listen_address = address;
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

TEST_F(RpcServer, GarbageInsteadOfAMessageIsRefused) {
  for (const char* method :
       {"/rigcal.v1.IngestService/UploadBatch", "/rigcal.v1.SessionService/CreateSession",
        "/rigcal.v1.CalibrationService/CreateCalibration"}) {
    EXPECT_FALSE(CallRaw(channel(), method, std::string(100, '\xff')).ok()) << method;
  }
  EXPECT_THAT(CallRaw(channel(), "/rigcal.v1.IngestService/Connect", std::string(100, '\xff')),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("hello")));
  EXPECT_THAT(client().ListAgents(), IsOk());
}

TEST(CheckLoopback, TakesLoopbackOnly) {
  for (const char* good : {"127.0.0.1:7420", "127.1.2.3:0", "localhost:1", "[::1]:7420"}) {
    EXPECT_THAT(server::CheckLoopback(good), IsOk()) << good;
  }
  for (const char* open : {"0.0.0.0:7420", "[::]:7420", "192.168.1.4:1", "example.org:1",
                           "127.0.0.1.example.org:1", "128.0.0.1:1"}) {
    EXPECT_THAT(server::CheckLoopback(open),
                StatusIs(absl::StatusCode::kFailedPrecondition,
                         AllOf(HasSubstr(open), HasSubstr("certificates"))));
  }
  for (const char* malformed : {"", "7420", "127.0.0.1", ":7420", "127.0.0.1:"}) {
    EXPECT_THAT(server::CheckLoopback(malformed),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("HOST:PORT")));
  }
}

TEST_F(RpcServer, RefusesAnOpenAddressAndTooLittleMemory) {
  const server::RpcServerParts parts{.store = faulty_.get(),
                                     .ingest = ingest_.get(),
                                     .directory = directory_of_agents_.get(),
                                     .coordinator = coordinator_.get(),
                                     .runner = runner_.get()};
  server::RpcServer open({.listen_address = "0.0.0.0:1"}, parts);
  EXPECT_THAT(open.Start(),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("0.0.0.0:1")));
  server::RpcServer small({.listen_address = "", .memory_limit_bytes = 1u << 20}, parts);
  EXPECT_THAT(small.Start(),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("limits.rpc_memory_mb")));
}

}  // namespace
}  // namespace rigcal::testing::rpc_server_test
