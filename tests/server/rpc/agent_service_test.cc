// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <string>
#include <vector>

#include "common/wire/grpc_status.h"
#include "tests/server/rpc/rpc_fixture.h"
#include "tests/testing/process.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing::agent_service_test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

class AgentService : public RpcFixture {
 protected:
  // Ids of all pages, or the message of the error.
  std::vector<std::string> Ids(const std::string& filter, const std::string& order_by,
                               uint32_t page_size = 2) {
    std::vector<std::string> ids;
    v1::ListAgentsRequest request;
    request.set_filter(filter);
    request.set_order_by(order_by);
    request.set_page_size(page_size);
    v1::ListAgentsResponse response;
    do {
      grpc::ClientContext context;
      context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(60));
      request.set_page_token(response.next_page_token());
      response.Clear();
      const auto stub = v1::AgentService::NewStub(channel());
      const grpc::Status status = stub->ListAgents(&context, request, &response);
      if (!status.ok()) return {status.error_message()};
      EXPECT_LE(response.agents_size(), static_cast<int>(page_size));
      for (const v1::Agent& agent : response.agents()) ids.push_back(agent.agent_id());
    } while (!response.next_page_token().empty());
    return ids;
  }
};

TEST_F(AgentService, ListsAgentsThatAreConnectedAndThatWere) {
  TestAgent first(channel(), MakeHello("first", {"left"}, 3, 4));
  first.ReadHello();
  TestAgent second(channel(), MakeHello("second", {"right"}));
  second.ReadHello();
  ASSERT_THAT(second.Finish(), IsOk());
  ASSERT_TRUE(WaitFor([&] { return directory_of_agents_->ConnectedCount() == 1; }));
  ASSERT_OK_AND_ASSIGN(const auto agents, client().ListAgents());
  ASSERT_EQ(agents.size(), 2u);
  EXPECT_EQ(agents[0].agent_id(), "first");
  EXPECT_TRUE(agents[0].connected());
  EXPECT_EQ(agents[0].incarnation(), 3u);
  EXPECT_EQ(agents[0].connection(), 4u);
  EXPECT_EQ(agents[0].host(), "host-of-first");
  EXPECT_EQ(agents[0].cameras(0).camera(), "left");
  EXPECT_FALSE(agents[0].has_disconnect_time());
  EXPECT_FALSE(agents[1].connected());
  EXPECT_TRUE(agents[1].has_disconnect_time());
}

TEST_F(AgentService, ListsByFilterAndOrderPageByPage) {
  TestAgent b(channel(), MakeHello("b", {"left"}));
  b.ReadHello();
  TestAgent c(channel(), MakeHello("c", {"right"}));
  c.ReadHello();
  TestAgent a(channel(), MakeHello("a", {"top"}));
  a.ReadHello();
  ASSERT_THAT(c.Finish(), IsOk());
  ASSERT_TRUE(WaitFor([&] { return directory_of_agents_->ConnectedCount() == 2; }));
  EXPECT_THAT(Ids("", ""), ElementsAre("a", "b", "c"));
  EXPECT_THAT(Ids("", "agent_id desc"), ElementsAre("c", "b", "a"));
  EXPECT_THAT(Ids("", "connect_time"), ElementsAre("b", "c", "a"));
  EXPECT_THAT(Ids("", "connect_time desc", 1), ElementsAre("a", "c", "b"));
  EXPECT_THAT(Ids("connected=true AND rig=rig", ""), ElementsAre("a", "b"));
  EXPECT_THAT(Ids("connected=false", ""), ElementsAre("c"));
  EXPECT_THAT(Ids("host=\"host-of-b\"", ""), ElementsAre("b"));
  EXPECT_THAT(Ids("agent_id=a AND host=host-of-b", ""), ElementsAre());
  EXPECT_THAT(Ids("connected=maybe", ""), ElementsAre(HasSubstr("true or false")));
}

}  // namespace
}  // namespace rigcal::testing::agent_service_test
