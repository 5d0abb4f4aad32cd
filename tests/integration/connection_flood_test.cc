// SPDX-License-Identifier: Apache-2.0
// More sockets than the server may open descriptors, and the same after them.
#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <csignal>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "rigcal/v1/status_service.grpc.pb.h"
#include "tests/testing/process.h"
#include "tests/testing/raw_socket.h"
#include "tests/testing/server_client.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing::connection_flood_test {
namespace {

constexpr int kSockets = 1100;

class ConnectionFlood : public ::testing::Test {
 protected:
  void SetUp() override {
    rlimit limit{};
    getrlimit(RLIMIT_NOFILE, &limit);
    limit.rlim_cur = limit.rlim_max;
    setrlimit(RLIMIT_NOFILE, &limit);
    if (limit.rlim_max < 2 * kSockets) {
      GTEST_SKIP() << "this process may open " << limit.rlim_max << " descriptors only";
    }
    const auto port_file = directory_.path() / "port";
    server_ = std::make_unique<Process>(Process::Options{
        {"/bin/sh", "-c",
         "ulimit -n 1024 && exec " RIGCAL_BIN_DIR
         "/rigcal-server --listen 127.0.0.1:0 --data-dir " +
             (directory_.path() / "store").string() + " --port-file " + port_file.string()},
        {}});
    ASSERT_TRUE(WaitFor([&] { return std::ifstream(port_file) >> port_ && port_ > 0; }))
        << server_->StandardError();
    address_ = "127.0.0.1:" + std::to_string(port_);
  }

  // A new connection gets an answer within the time that a server has to serve again.
  bool ServesNewClients() const {
    const auto serves = [&] {
      grpc::ChannelArguments arguments;
      arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
      const auto channel =
          grpc::CreateCustomChannel(address_, grpc::InsecureChannelCredentials(), arguments);
      grpc::ClientContext context;
      context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(2));
      v1::GetStatusResponse response;
      return v1::StatusService::NewStub(channel)->GetStatus(&context, {}, &response).ok();
    };
    return WaitFor(serves, std::chrono::seconds(10));
  }

  TemporaryDirectory directory_;
  std::unique_ptr<Process> server_;
  int port_ = 0;
  std::string address_;
};

TEST_F(ConnectionFlood, SilentSocketsKeepNobodyOut) {
  ServerClient early(address_);
  ASSERT_THAT(early.ListAgents(), IsOk());
  {
    std::vector<RawSocket> sockets;
    for (int i = 0; i < kSockets; ++i) sockets.emplace_back(port_);
    EXPECT_TRUE(ServesNewClients()) << server_->StandardError();
    EXPECT_THAT(early.ListAgents(), IsOk());
  }
  EXPECT_TRUE(ServesNewClients()) << server_->StandardError();
}

TEST_F(ConnectionFlood, SocketsThatSpeakAreLimitedAndTheServerServesAfterwards) {
  ServerClient early(address_);
  ASSERT_THAT(early.ListAgents(), IsOk());
  {
    std::vector<RawSocket> sockets;
    for (int i = 0; i < kSockets; ++i) {
      sockets.emplace_back(port_, "127.0.0." + std::to_string(2 + i % 100));
      sockets.back().Send("PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n");
    }
    EXPECT_THAT(early.ListAgents(), IsOk()) << "who is in stays in";
    EXPECT_TRUE(ServesNewClients()) << "those that say no more are closed after 5 s";
    EXPECT_TRUE(sockets.back().AwaitEnd());
  }
  EXPECT_TRUE(ServesNewClients()) << server_->StandardError();
  server_->Signal(SIGTERM);
  EXPECT_EQ(server_->Wait(), 0);
}

}  // namespace
}  // namespace rigcal::testing::connection_flood_test
