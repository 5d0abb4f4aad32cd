// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/streams_without_hello.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "tests/server/rpc/rpc_fixture.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing::streams_without_hello_test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

TEST(StreamsWithoutHelloList, CutsTheOldest) {
  server::StreamsWithoutHello streams(2);
  std::vector<int> cut;
  std::vector<uint64_t> tickets;
  for (int i = 0; i < 4; ++i) tickets.push_back(streams.Add([&cut, i] { cut.push_back(i); }));
  EXPECT_THAT(cut, ElementsAre(0, 1));
  streams.Remove(tickets[2]);
  streams.Remove(tickets[0]);
  EXPECT_EQ(streams.size(), 1u);
  streams.Add([&cut] { cut.push_back(4); });
  EXPECT_THAT(cut, ElementsAre(0, 1));
  streams.Add([&cut] { cut.push_back(5); });
  EXPECT_THAT(cut, ElementsAre(0, 1, 3));
}

class StreamsWithoutHello : public RpcFixture {};

TEST_F(StreamsWithoutHello, DoNotTakeThePlacesOfAgents) {
  rpc_options_.agents.max_streams = 2;
  rpc_options_.agents.max_streams_without_hello = 5;
  rpc_options_.agents.hello_timeout = std::chrono::hours(1);
  RestartServer();
  std::vector<std::unique_ptr<TestAgent>> silent;
  const auto flood = [&] {
    for (int i = 0; i < 20; ++i) silent.push_back(std::make_unique<TestAgent>(channel()));
  };
  flood();
  TestAgent first(channel(), MakeHello("pc1", {"left"}));
  first.ReadHello();
  flood();
  TestAgent second(channel(), MakeHello("pc2", {"right"}));
  second.ReadHello();
  EXPECT_THAT(silent.front()->AwaitEnd(),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("hello")));
  v1::ConnectRequest ping;
  ping.mutable_time_ping()->set_host_monotonic_ns(1);
  first.Send(ping);
  first.ReadUntil(v1::ConnectResponse::kTimePong);
}

}  // namespace
}  // namespace rigcal::testing::streams_without_hello_test
