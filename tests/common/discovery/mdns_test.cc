// SPDX-License-Identifier: Apache-2.0
// The real discovery, where an avahi-daemon runs.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <string>

#include "common/discovery/discovery.h"
#include "tests/testing/process.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing::mdns_test {
namespace {

using ::testing::HasSubstr;

constexpr std::chrono::milliseconds kPatience{5000};

TEST(Mdns, FindsAServerAsLongAsItAnnouncesItself) {
  const auto discovery = MakeDiscovery();
  const auto reachable = discovery->Find(kPatience);
  if (!reachable.ok()) {
    EXPECT_THAT(reachable, StatusIs(absl::StatusCode::kUnavailable, HasSubstr("mDNS")));
    GTEST_SKIP() << reachable.status().message();
  }
  const std::string name = "rigcal test " + std::to_string(getpid());
  const auto is_found = [&] {
    const auto servers = discovery->Find(kPatience);
    EXPECT_THAT(servers, IsOk());
    return std::ranges::any_of(*servers, [&](const FoundServer& server) {
      return server.name == name && server.grpc_port == 7420 && server.https_port == 7421 &&
             !server.hosts.empty();
    });
  };
  {
    ASSERT_OK_AND_ASSIGN(const auto announcement,
                         discovery->Announce({.name = name, .grpc_port = 7420, .https_port = 7421},
                                             [](const std::string& why) { ADD_FAILURE() << why; }));
    EXPECT_TRUE(WaitFor(is_found));
  }
  EXPECT_TRUE(WaitFor([&] { return !is_found(); }));
}

}  // namespace
}  // namespace rigcal::testing::mdns_test
