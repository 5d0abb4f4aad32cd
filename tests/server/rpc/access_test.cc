// SPDX-License-Identifier: Apache-2.0
// Every RPC that the server has, health and reflection included, against the one table of rules.
#include <gmock/gmock.h>
#include <google/protobuf/descriptor.h>
#include <gtest/gtest.h>

#include <regex>
#include <set>
#include <string>

#include "server/access/access_rules.h"
#include "tests/server/rpc/tls_fixture.h"
#include "tests/testing/reflection_client.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing::access_test {
namespace {

using server::AccessRule;
using ::testing::AllOf;
using ::testing::HasSubstr;

class Access : public TlsFixture {
 protected:
  // "/package.Service/Method" of everything that the server's own reflection lists.
  std::set<std::string> Methods() {
    std::set<std::string> methods;
    const std::string list = Reflect(UserChannel("viewer"), "list_services: ''");
    const std::regex name("name: \"([^\"]+)\"");
    for (std::sregex_iterator match(list.begin(), list.end(), name), end; match != end; ++match) {
      const auto* service =
          google::protobuf::DescriptorPool::generated_pool()->FindServiceByName((*match)[1]);
      EXPECT_NE(service, nullptr) << (*match)[1];
      for (int i = 0; service != nullptr && i < service->method_count(); ++i) {
        methods.insert("/" + service->full_name() + "/" + service->method(i)->name());
      }
    }
    return methods;
  }
};

TEST_F(Access, EachMethodHasARuleAndEachRuleAMethod) {
  const std::set<std::string> methods = Methods();
  EXPECT_GT(methods.size(), 20u);
  for (const std::string& method : methods) {
    EXPECT_NE(server::FindAccessRule(method), nullptr)
        << method << " has no rule: add one to server/access/access_rules.cc";
  }
  for (const AccessRule& rule : server::AccessRules()) {
    EXPECT_TRUE(methods.contains(std::string(rule.method))) << rule.method << " does not exist";
  }
}

TEST_F(Access, EachRoleCallsWhatItMayAndNothingElse) {
  for (const Role role : kRoles) {
    const auto channel =
        role == Role::kAgent ? AgentChannel("pc1") : UserChannel(std::string(RoleName(role)));
    for (const AccessRule& rule : server::AccessRules()) {
      // It is for everybody, and would not end.
      if (rule.method == "/grpc.health.v1.Health/Watch") continue;
      const absl::Status status = CallRaw(channel, std::string(rule.method), "").status();
      if (rule.roles.contains(role)) {
        EXPECT_FALSE(absl::IsPermissionDenied(status) || absl::IsUnauthenticated(status) ||
                     absl::IsUnavailable(status))
            << RoleName(role) << " " << rule.method << ": " << status;
        continue;
      }
      EXPECT_THAT(
          status,
          StatusIs(absl::StatusCode::kPermissionDenied,
                   AllOf(HasSubstr(std::string(RoleName(role))),
                         HasSubstr(std::string(rule.method.substr(rule.method.rfind('/') + 1))))))
          << RoleName(role);
    }
    EXPECT_THAT(CallRaw(channel, "/rigcal.v1.SessionService/Nothing", ""),
                StatusIs(absl::StatusCode::kPermissionDenied, HasSubstr("no rule")));
  }
  EXPECT_THAT(Audit(), AllOf(HasSubstr("call_refused"), HasSubstr("agent 'pc1'")));
}

TEST_F(Access, ChangesAreWrittenDownWithWhoAndWhat) {
  const auto channel = UserChannel("operator");
  v1::CreateSessionRequest request = WaveRequest("wave");
  ASSERT_THAT(ServerClient(channel).CreateSession(request), IsOk());
  EXPECT_FALSE(ServerClient(channel).StartSession("nobody").ok());
  EXPECT_THAT(ServerClient(channel).GetSession("wave"), IsOk());
  const std::string audit = Audit();
  EXPECT_THAT(audit, AllOf(HasSubstr("\"change\""), HasSubstr("user 'kim'"),
                           HasSubstr("127.0.0.1:"), HasSubstr("SessionService/CreateSession"),
                           HasSubstr("wave"), HasSubstr("\"OK\""), HasSubstr("NOT_FOUND")));
  EXPECT_EQ(audit.find("GetSession"), std::string::npos) << "reading is no change";
}

}  // namespace
}  // namespace rigcal::testing::access_test
