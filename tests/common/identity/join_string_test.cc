// SPDX-License-Identifier: Apache-2.0
#include "common/identity/join_string.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "tests/testing/status_matchers.h"

namespace rigcal::testing::join_string_test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

::rigcal::JoinString Sample() {
  return {.role = Role::kOperator,
          .expiry = absl::FromUnixSeconds(1'795'000'000),
          .ca_sha256 = std::string(32, '\xc5'),
          .secret = "0123456789abcdef",
          .name = "anna",
          .grpc_port = 7420,
          .https_port = 7421,
          .hosts = {"192.168.1.5", "fd00::5", "rig-server.lab"}};
}

TEST(JoinString, ReadsWhatItWrites) {
  const std::string text = FormatJoinString(Sample());
  EXPECT_EQ(text.substr(0, 4), "rk1.");
  ASSERT_OK_AND_ASSIGN(const ::rigcal::JoinString parsed, ParseJoinString(text));
  EXPECT_EQ(parsed, Sample());
  ASSERT_OK_AND_ASSIGN(const ::rigcal::JoinString pasted, ParseJoinString("  " + text + "\n"));
  EXPECT_EQ(pasted, Sample());
}

TEST(JoinString, FindsEveryWrongCharacter) {
  const std::string good = FormatJoinString(Sample());
  for (size_t i = 4; i < good.size(); ++i) {
    std::string typo = good;
    typo[i] = typo[i] == 'A' ? 'B' : 'A';
    EXPECT_THAT(ParseJoinString(typo),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("typo")))
        << "character " << i;
  }
}

TEST(JoinString, FindsMissingDoubledAndSwappedCharacters) {
  const std::string good = FormatJoinString(Sample());
  for (size_t i = 4; i + 1 < good.size(); ++i) {
    EXPECT_FALSE(ParseJoinString(good.substr(0, i)).ok()) << "cut at " << i;
    std::string missing = good;
    EXPECT_FALSE(ParseJoinString(missing.erase(i, 1)).ok()) << "missing " << i;
    std::string doubled = good;
    EXPECT_FALSE(ParseJoinString(doubled.insert(i, 1, good[i])).ok()) << "doubled " << i;
    if (good[i] == good[i + 1]) continue;
    std::string swapped = good;
    std::swap(swapped[i], swapped[i + 1]);
    EXPECT_FALSE(ParseJoinString(swapped).ok()) << "swapped " << i;
  }
}

TEST(JoinString, TellsOtherTextsFromTypos) {
  EXPECT_THAT(ParseJoinString(""),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("rigcal token create")));
  EXPECT_THAT(ParseJoinString("192.168.1.5:7420"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("not a join string")));
  EXPECT_THAT(ParseJoinString("rk2.AAAA"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("another version")));
  EXPECT_THAT(ParseJoinString(std::string(100'000, 'r')),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("not a join string")));
}

TEST(JoinString, NeverQuotesTheSecret) {
  std::string typo = FormatJoinString(Sample());
  typo.back() = typo.back() == 'A' ? 'B' : 'A';
  const auto parsed = ParseJoinString(typo);
  EXPECT_THAT(std::string(parsed.status().message()), Not(HasSubstr(typo.substr(10, 20))));
}

// Right check digits do not make a field right.
TEST(JoinString, RefusesFieldsThatNoServerWrites) {
  const auto refused = [](auto change) {
    ::rigcal::JoinString join = Sample();
    change(join);
    const auto parsed = ParseJoinString(FormatJoinString(join));
    return std::string(parsed.status().message()).find("no rigcal server") != std::string::npos;
  };
  EXPECT_TRUE(refused([](auto& join) { join.role = static_cast<Role>(9); }));
  EXPECT_TRUE(refused([](auto& join) { join.name = "no name"; }));
  EXPECT_TRUE(refused([](auto& join) { join.https_port = 0; }));
  EXPECT_TRUE(refused([](auto& join) { join.hosts = {}; }));
  EXPECT_TRUE(refused([](auto& join) { join.hosts = {"a;rm"}; }));
  EXPECT_TRUE(refused([](auto& join) { join.hosts.resize(17, "a"); }));
  EXPECT_TRUE(refused([](auto& join) { join.secret += "x"; }));
}

TEST(HostPorts, WritesIpv6InBrackets) {
  EXPECT_THAT(HostPorts(Sample().hosts, 7421),
              ElementsAre("192.168.1.5:7421", "[fd00::5]:7421", "rig-server.lab:7421"));
  std::string host;
  uint16_t port = 0;
  EXPECT_TRUE(SplitHostPort("[fd00::5]:7421", &host, &port));
  EXPECT_EQ(host, "fd00::5");
  EXPECT_EQ(port, 7421);
  for (const char* bad : {"", ":1", "a", "a:", "a:x", "a:65536", "a:-1"}) {
    EXPECT_FALSE(SplitHostPort(bad, &host, &port)) << bad;
  }
}

}  // namespace
}  // namespace rigcal::testing::join_string_test
