// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/refusing_server.h"

#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <string>

#include "client/net/server_connection.h"
#include "tests/server/rpc/rpc_fixture.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing::refusing_server_test {
namespace {

using ::testing::HasSubstr;

class RefusingServer : public RpcFixture {
 protected:
  void SetUp() override {
    rpc_options_.endpoint.listen_address = "127.0.0.1:0";
    RpcFixture::SetUp();
    active_ = "127.0.0.1:" + std::to_string(port_);
    const auto port = refusing_.Start();
    ASSERT_THAT(port, IsOk());
    waiting_ = "127.0.0.1:" + std::to_string(*port);
  }
  absl::StatusOr<v1::GetStatusResponse> StatusFrom(const std::string& servers) {
    client::ServerConnection server(servers, {});
    return server.Call(&v1::StatusService::Stub::GetStatus, v1::GetStatusRequest());
  }

  server::AuditLog audit_{""};
  server::RefusingServer refusing_{
      {.listen_address = "127.0.0.1:0"}, &audit_, {.message = "none is", .active_server = ""}};
  std::string active_, waiting_;
};

TEST_F(RefusingServer, SaysWhyAndNobodyElseIsAsked) {
  EXPECT_THAT(StatusFrom(waiting_),
              StatusIs(absl::StatusCode::kUnavailable,
                       HasSubstr(": this server is not the active one: none is")));
}

TEST_F(RefusingServer, ClientsGoWhereItSendsThem) {
  refusing_.SetRefusal({.message = "it waits", .active_server = active_});
  EXPECT_THAT(StatusFrom(waiting_), IsOk());
}

TEST_F(RefusingServer, ClientsOfSeveralServersFindTheActiveOne) {
  EXPECT_THAT(StatusFrom("127.0.0.1:1," + waiting_ + "," + active_), IsOk());
  EXPECT_THAT(StatusFrom("127.0.0.1:1," + waiting_),
              StatusIs(absl::StatusCode::kUnavailable, HasSubstr("none is")));
}

TEST_F(RefusingServer, TwoThatNameEachOtherEndInAnError) {
  refusing_.SetRefusal({.message = "it waits", .active_server = waiting_});
  EXPECT_THAT(StatusFrom(waiting_), StatusIs(absl::StatusCode::kUnavailable, HasSubstr("active")));
}

TEST_F(RefusingServer, SaysThatItIsAliveAndDoesNotServe) {
  client::ServerConnection server(waiting_, {});
  const auto health = server.CheckHealth();
  ASSERT_THAT(health, IsOk());
  EXPECT_EQ(*health, "NOT_SERVING");
}

}  // namespace
}  // namespace rigcal::testing::refusing_server_test
