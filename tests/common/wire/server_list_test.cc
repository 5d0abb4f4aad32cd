// SPDX-License-Identifier: Apache-2.0
#include "common/wire/server_list.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/testing/status_matchers.h"

namespace rigcal::wire {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::HasSubstr;

TEST(ValidateServerAddress, WantsHostAndPort) {
  for (const char* good : {"127.0.0.1:7420", "rig-pc:1", "[::1]:65535", "a.b.example:80"}) {
    EXPECT_THAT(ValidateServerAddress(good), IsOk()) << good;
  }
  for (const char* bad : {"", "host", "host:", ":7420", "host:0", "host:65536", "host:x",
                          "::1:7420", "http://host:80", "host:80/x", "[]:1", "a b:1", "host:-1"}) {
    EXPECT_THAT(ValidateServerAddress(bad),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("HOST:PORT")))
        << bad;
  }
}

ServerList Listed(std::string_view text) { return *ServerList::Parse(text); }

TEST(ServerList, TakesSeveralAndRefusesWhatIsNone) {
  EXPECT_EQ(Listed("a:1, b:2").text(), "a:1,b:2");
  EXPECT_THAT(ServerList::Parse("a:1,"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("''")));
  EXPECT_THAT(ServerList::Parse("a:1,b"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("'b'")));
  EXPECT_THAT(ServerList::Parse("a:1,b:1,a:1"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("twice")));
}

TEST(ServerList, PausesWhenEachWasTried) {
  ServerList servers = Listed("a:1,b:1,c:1");
  EXPECT_TRUE(servers.MoveOn());
  EXPECT_EQ(servers.current(), "b:1");
  EXPECT_TRUE(servers.MoveOn());
  EXPECT_EQ(servers.current(), "c:1");
  EXPECT_FALSE(servers.MoveOn());
  EXPECT_EQ(servers.current(), "a:1");
  EXPECT_TRUE(servers.MoveOn());
  servers.Settle();
  EXPECT_TRUE(servers.MoveOn());
  EXPECT_TRUE(servers.MoveOn()) << "the round begins where one answered";
  EXPECT_FALSE(servers.MoveOn());
}

TEST(ServerList, OfOnePausesAtOnce) { EXPECT_FALSE(Listed("a:1").MoveOn()); }

TEST(ServerList, GoesWhereAWaitingServerSays) {
  ServerList servers = Listed("a:1,b:1,c:1");
  EXPECT_TRUE(servers.MoveOn("c:1"));
  EXPECT_EQ(servers.current(), "c:1");
  ServerList alone = Listed("a:1");
  EXPECT_TRUE(alone.MoveOn("z:9"));
  EXPECT_EQ(alone.current(), "z:9") << "also where it is not in the list";
  EXPECT_FALSE(alone.MoveOn());
  EXPECT_EQ(alone.current(), "a:1");
  EXPECT_FALSE(Listed("a:1").MoveOn("no address"));
}

TEST(ServerList, LearnsOthers) {
  ServerList servers = Listed("a:1");
  EXPECT_FALSE(servers.Learn({"a:1", "", "nonsense"}));
  EXPECT_TRUE(servers.Learn({"b:1", "a:1"}));
  EXPECT_EQ(servers.text(), "a:1,b:1");
  EXPECT_TRUE(servers.MoveOn());
  EXPECT_EQ(servers.current(), "b:1");
}

TEST(ServerList, TwoThatNameEachOtherKeepNobodyBusy) {
  ServerList servers = Listed("a:1,b:1");
  int moves = 0;
  while (servers.MoveOn(servers.current() == "a:1" ? "b:1" : "a:1")) ASSERT_LT(++moves, 10);
  EXPECT_EQ(moves, 2);
}

}  // namespace
}  // namespace rigcal::wire
