// SPDX-License-Identifier: Apache-2.0
#include "server/access/access_rules.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>
#include <string>

#include "tests/testing/status_matchers.h"

namespace rigcal::testing::access_rules_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr char kStop[] = "/rigcal.v1.SessionService/StopSession";
constexpr char kConnect[] = "/rigcal.v1.IngestService/Connect";

server::Peer PeerOf(Role role) {
  return {.has_certificate = true, .role = role, .name = "kim", .uri = "", .serial = "3fa2"};
}

TEST(AccessRules, EachMethodHasOneRuleWithSomebodyInIt) {
  std::set<std::string_view> seen;
  for (const server::AccessRule& rule : server::AccessRules()) {
    EXPECT_TRUE(seen.insert(rule.method).second) << rule.method;
    EXPECT_FALSE(rule.roles.empty()) << rule.method;
  }
}

TEST(AccessRules, AnAgentWritesAndDoesNothingElse) {
  for (const server::AccessRule& rule : server::AccessRules()) {
    const bool ingest = rule.method.starts_with("/rigcal.v1.IngestService/");
    const bool health = rule.method.starts_with("/grpc.health.v1.Health/");
    EXPECT_EQ(rule.roles.contains(Role::kAgent), ingest || health) << rule.method;
  }
}

TEST(AccessRules, AViewerChangesNothing) {
  for (const server::AccessRule& rule : server::AccessRules()) {
    EXPECT_FALSE(rule.audited && rule.roles.contains(Role::kViewer)) << rule.method;
  }
}

TEST(AccessRules, ARefusalNamesWhoWhichRoleAndWhat) {
  EXPECT_THAT(server::CheckAccess(PeerOf(Role::kViewer), kStop),
              StatusIs(absl::StatusCode::kPermissionDenied,
                       AllOf(HasSubstr("user 'kim'"), HasSubstr("3fa2"), HasSubstr("role viewer"),
                             HasSubstr("(StopSession)"), HasSubstr("needs operator or admin"),
                             HasSubstr("rigcal token create --role operator"))));
  EXPECT_THAT(server::CheckAccess(PeerOf(Role::kAdmin), kConnect),
              StatusIs(absl::StatusCode::kPermissionDenied,
                       AllOf(HasSubstr("needs agent"), HasSubstr("rigcal-agent join"))));
  EXPECT_THAT(server::CheckAccess(PeerOf(Role::kOperator), kStop), IsOk());
  EXPECT_THAT(server::CheckAccess(PeerOf(Role::kAgent), kConnect), IsOk());
}

TEST(AccessRules, WhatHasNoRuleIsForNobodyWithACertificate) {
  for (const Role role : kRoles) {
    EXPECT_THAT(server::CheckAccess(PeerOf(role), "/rigcal.v1.SessionService/Nothing\n"),
                StatusIs(absl::StatusCode::kPermissionDenied,
                         AllOf(HasSubstr("no rule"), ::testing::Not(HasSubstr("\n")))));
  }
  EXPECT_THAT(server::CheckAccess(PeerOf(Role::kAdmin), ""),
              StatusIs(absl::StatusCode::kPermissionDenied, HasSubstr("no rule")));
}

TEST(AccessRules, ThisMachineMayDoEverything) {
  for (const server::AccessRule& rule : server::AccessRules()) {
    EXPECT_THAT(server::CheckAccess({}, rule.method), IsOk()) << rule.method;
  }
}

}  // namespace
}  // namespace rigcal::testing::access_rules_test
