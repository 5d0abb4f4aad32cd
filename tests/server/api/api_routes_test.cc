// SPDX-License-Identifier: Apache-2.0
#include "server/api/api_routes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>
#include <string>

#include "server/access/access_rules.h"

namespace rigcal::testing::api_routes_test {
namespace {

using server::ApiMatch;
using server::ApiRoute;
using server::MatchApiRoute;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

std::string RpcOf(const ApiMatch& match) {
  return match.route == nullptr ? "" : std::string(match.route->rpc);
}

TEST(ApiRoutes, EachRpcHasARouteOrAReasonAndARule) {
  std::set<std::string_view> served;
  for (const ApiRoute& route : server::ApiRoutes()) {
    served.insert(route.rpc);
    EXPECT_NE(server::FindAccessRule(route.rpc), nullptr) << route.path;
  }
  for (const server::RpcWithoutRoute& rpc : server::RpcsWithoutRoute()) {
    EXPECT_FALSE(served.contains(rpc.rpc)) << rpc.rpc << " has a route and a reason for none";
    EXPECT_FALSE(rpc.reason.empty());
    served.insert(rpc.rpc);
  }
  for (const server::AccessRule& rule : server::AccessRules()) {
    EXPECT_TRUE(served.contains(rule.method))
        << rule.method << " has no route: add one to server/api/api_routes.cc, or the reason";
  }
  EXPECT_EQ(served.size(), server::AccessRules().size()) << "a route leads to no RPC";
}

TEST(ApiRoutes, WhatChangesSomethingIsNoGet) {
  for (const ApiRoute& route : server::ApiRoutes()) {
    EXPECT_FALSE(route.method == "GET" && server::FindAccessRule(route.rpc)->audited) << route.path;
  }
}

TEST(ApiRoutes, EachRouteIsFoundByItsOwnPath) {
  for (const ApiRoute& route : server::ApiRoutes()) {
    std::string path(route.path);
    for (const std::string& variable : server::VariablesOf(route.path)) {
      path.replace(path.find("{" + variable + "}"), variable.size() + 2, "s-1");
    }
    const ApiMatch match = MatchApiRoute(route.method, path);
    ASSERT_NE(match.route, nullptr) << path;
    EXPECT_EQ(match.route->path, route.path);
    EXPECT_EQ(match.variables.size(), server::VariablesOf(route.path).size());
  }
}

TEST(ApiRoutes, TakesVariablesOutOfThePath) {
  const ApiMatch start = MatchApiRoute("POST", "/v1/sessions/s-1:start");
  EXPECT_EQ(RpcOf(start), "/rigcal.v1.SessionService/StartSession");
  EXPECT_THAT(start.variables, ElementsAre(server::UrlParameter{"id", "s-1"}));
  const ApiMatch encoded = MatchApiRoute("GET", "/v1/sessions/a%2Fb%20c");
  EXPECT_THAT(encoded.variables, ElementsAre(server::UrlParameter{"id", "a/b c"}));
  EXPECT_EQ(RpcOf(MatchApiRoute("POST", "/v1/sessions/s-1%3Astart")),
            "/rigcal.v1.SessionService/StartSession");
}

TEST(ApiRoutes, AVerbIsNoPartOfAName) {
  EXPECT_EQ(MatchApiRoute("GET", "/v1/sessions/s-1:start").route, nullptr);
  EXPECT_EQ(MatchApiRoute("DELETE", "/v1/sessions/s-1:begin").route, nullptr);
  EXPECT_EQ(MatchApiRoute("POST", "/v1/sessions/:start").route, nullptr);
}

TEST(ApiRoutes, TellsTheMethodsOfAPath) {
  EXPECT_EQ(MatchApiRoute("PUT", "/v1/sessions/s-1").allowed_methods, "GET, DELETE");
  for (const char* none : {"/v1", "/v1/", "/v1/session", "/v1/sessions/", "/v1/sessions/a/b",
                           "/v1/sessions/%zz", "/v1/sessions/a%00b", "//v1/status", ""}) {
    const ApiMatch match = MatchApiRoute("GET", none);
    EXPECT_EQ(match.route, nullptr) << none;
    EXPECT_THAT(match.allowed_methods, IsEmpty()) << none;
  }
}

}  // namespace
}  // namespace rigcal::testing::api_routes_test
