// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/api_calls.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <fstream>
#include <future>
#include <iterator>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>

#include "server/access/access_rules.h"
#include "server/rpc/api_messages.h"
#include "tests/server/rpc/rpc_fixture.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing::api_calls_test {
namespace {

using server::ApiAnswer;
using server::Peer;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using Json = nlohmann::json;

class ApiCalls : public RpcFixture {
 protected:
  void SetUp() override {
    audit_ = std::make_unique<server::AuditLog>(folder_.path() / "audit.jsonl");
    RpcFixture::SetUp();
    gateway_ = rpc_->MakeApiGateway();
  }
  void TearDown() override {
    gateway_.reset();
    RpcFixture::TearDown();
  }

  // "/v1/sessions?page_size=1"
  ApiAnswer Call(const std::string& method, const std::string& address,
                 const std::string& body = "", const Peer& peer = {},
                 const std::string& known_etag = "") {
    const size_t query = std::min(address.find('?'), address.size());
    server::ApiMatch match = server::MatchApiRoute(method, address.substr(0, query));
    if (match.route == nullptr) return {.status = absl::NotFoundError("no route " + address)};
    const auto parameters =
        server::ParseUrlQuery(address.substr(std::min(query + 1, address.size())));
    EXPECT_THAT(parameters, IsOk());
    // Shared: the callback's thread may still be inside set_value when get has returned.
    const auto work = std::make_shared<std::promise<server::ApiGateway::Work>>();
    gateway_->Call({.route = match.route,
                    .variables = match.variables,
                    .parameters = *parameters,
                    .body = body,
                    .known_etag = known_etag,
                    .peer = peer,
                    .address = "10.0.0.9"},
                   [work](server::ApiGateway::Work made) { work->set_value(std::move(made)); });
    return work->get_future().get()();
  }
  Json Good(const ApiAnswer& answer) {
    EXPECT_THAT(answer.status, IsOk());
    return answer.status.ok() ? Json::parse(answer.body->text) : Json();
  }
  static Peer PeerOf(Role role) {
    return {.has_certificate = true, .role = role, .name = "kim", .uri = "rigcal://users/kim"};
  }

  TemporaryDirectory folder_;
  std::unique_ptr<server::ApiGateway> gateway_;
};

TEST_F(ApiCalls, ASessionFromItsCreationToItsEnd) {
  const std::string request = *server::JsonOf(WaveRequest("wave"));
  Json session = Good(Call("POST", "/v1/sessions", request))["session"];
  EXPECT_EQ(session["id"], "wave");
  EXPECT_EQ(session["state"], "STATE_CREATED");
  EXPECT_EQ(Good(Call("GET", "/v1/sessions/wave"))["session"], session);
  EXPECT_EQ(Good(Call("GET", "/v1/sessions?filter=rig%3Drig&page_size=5"))["sessions"].size(), 1u);
  const ApiAnswer start = Call("POST", "/v1/sessions/wave:start", "{}");
  EXPECT_THAT(start.status, StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("camera")));
  EXPECT_EQ(Good(Call("DELETE", "/v1/sessions/wave")), Json::object());
  EXPECT_THAT(Call("GET", "/v1/sessions/wave").status,
              StatusIs(absl::StatusCode::kNotFound, ::testing::_));
}

TEST_F(ApiCalls, HasTheNamesOfTheProtoFilesAndLeavesOutDefaults) {
  const Json status = Good(Call("GET", "/v1/status"));
  EXPECT_TRUE(status.contains("software_version"));
  EXPECT_EQ(status["store"]["kind"], "sqlite");
  EXPECT_TRUE(status["store"]["size_bytes"].is_string());
  EXPECT_FALSE(status.contains("session_count"));
}

TEST_F(ApiCalls, SaysWhatIsWrongWithARequest) {
  const auto expect_fault = [&](const ApiAnswer& answer, const std::string& what) {
    EXPECT_THAT(answer.status, StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr(what)));
  };
  expect_fault(Call("GET", "/v1/sessions?page=3"), "filter, order_by, page_size, page_token");
  expect_fault(Call("GET", "/v1/sessions?page_size=many"), "page_size: cannot be 'many'");
  expect_fault(Call("GET", "/v1/sessions/wave?audit=perhaps"), "audit: must be true or false");
  expect_fault(Call("GET", "/v1/sessions/wave?id=other"), "id: is 'wave' in the address");
  expect_fault(Call("GET", "/v1/sessions", "{}"), "has no body");
  expect_fault(Call("POST", "/v1/sessions?id=a", "{}"), "body, not the address");
  expect_fault(Call("POST", "/v1/sessions/wave:stop", "{\"id\": \"other\"}"), "id: is 'wave'");
  expect_fault(Call("POST", "/v1/sessions", "[]"), "JSON object");
  expect_fault(Call("POST", "/v1/sessions", "{\"id\":"), "CreateSessionRequest");
  expect_fault(Call("POST", "/v1/sessions", "{\"camera\": 1}"), "camera");
  expect_fault(Call("POST", "/v1/sessions", "{\"id\": \"\xff\"}"), "CreateSessionRequest");
  expect_fault(Call("POST", "/v1/sessions", std::string(100'000, '[')), "JSON object");
  expect_fault(Call("POST", "/v1/sessions", "{\"target\":" + std::string(10'000, '{')),
               "64 levels deep");
  // The limits of requests are those of gRPC.
  expect_fault(Call("POST", "/v1/sessions", Json{{"title", std::string(5000, 'x')}}.dump()),
               "title");
}

TEST_F(ApiCalls, SaysNothingAgainOfALiveStateThatTheClientHas) {
  StartWave({"left"});
  live_->Update();
  const auto get = [&](const std::string& query, const std::string& etag) {
    return Call("GET", "/v1/live" + query, "", {}, etag);
  };
  const ApiAnswer first = get("", "");
  EXPECT_THAT(first.body->text, HasSubstr("\"full\":true"));
  ASSERT_NE(first.etag, "");
  // Whether it asks for changes or for everything.
  for (const std::string& query :
       std::vector<std::string>{"", "?since_revision=" + first.etag, "?rig=rig"}) {
    const ApiAnswer again = get(query, first.etag);
    EXPECT_TRUE(again.unchanged) << query;
    EXPECT_EQ(again.etag, first.etag) << query;
  }
  EXPECT_EQ(get("", "").body, first.body) << "made once";
  EXPECT_FALSE(get("?rig=other", first.etag).unchanged);
  EXPECT_THAT(get("?rig=a%20b", first.etag).status,
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("rig")));
  EXPECT_THAT(get("?page=1", first.etag).status,
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("page")));

  ASSERT_THAT(client().Upload(MakeBatch({"wave", "left", 1}, 1, 20)), IsOk());
  ingest_->WaitIdle();
  live_->Update();
  const ApiAnswer changed = get("", first.etag);
  EXPECT_FALSE(changed.unchanged);
  EXPECT_THAT(changed.body->text, HasSubstr("\"full\":true"));
  const ApiAnswer delta = get("?since_revision=" + first.etag, first.etag);
  EXPECT_FALSE(delta.unchanged);
  EXPECT_EQ(delta.etag, changed.etag);
  EXPECT_LT(delta.body->text.size(), changed.body->text.size());
}

TEST_F(ApiCalls, MayEndWhileCallsAreOpen) {
  const server::ApiMatch match = server::MatchApiRoute("GET", "/v1/status");
  ASSERT_NE(match.route, nullptr);
  for (int round = 0; round < 20; ++round) {
    const auto answered = std::make_shared<std::atomic<int>>(0);
    for (int call = 0; call < 8; ++call) {
      // What is made is thrown away, as by a server that ends.
      server::ApiRequest request;
      request.route = match.route;
      gateway_->Call(std::move(request),
                     [answered](const server::ApiGateway::Work&) { ++*answered; });
    }
    gateway_.reset();
    EXPECT_EQ(*answered, 8);
    RestartServer();
    gateway_ = rpc_->MakeApiGateway();
  }
}

TEST_F(ApiCalls, ARoleMayWhatItMayByGrpc) {
  EXPECT_THAT(Call("GET", "/v1/sessions", "", PeerOf(Role::kViewer)).status, IsOk());
  EXPECT_THAT(Call("POST", "/v1/sessions", "{}", PeerOf(Role::kViewer)).status,
              StatusIs(absl::StatusCode::kPermissionDenied,
                       AllOf(HasSubstr("kim"), HasSubstr("viewer"), HasSubstr("CreateSession"))));
  EXPECT_THAT(Call("GET", "/v1/tokens", "", PeerOf(Role::kOperator)).status,
              StatusIs(absl::StatusCode::kPermissionDenied, ::testing::_));
  EXPECT_THAT(Call("GET", "/v1/status", "", PeerOf(Role::kAgent)).status,
              StatusIs(absl::StatusCode::kPermissionDenied, ::testing::_));
}

TEST_F(ApiCalls, EachRouteIsForTheRolesOfItsRule) {
  for (const server::ApiRoute& route : server::ApiRoutes()) {
    std::string path(route.path);
    for (const std::string& variable : server::VariablesOf(route.path)) {
      path.replace(path.find("{" + variable + "}"), variable.size() + 2, "none");
    }
    for (const Role role : kRoles) {
      const ApiAnswer answer = Call(std::string(route.method), path, "", PeerOf(role));
      const bool allowed = server::FindAccessRule(route.rpc)->roles.contains(role);
      EXPECT_EQ(absl::IsPermissionDenied(answer.status), !allowed)
          << path << " " << RoleName(role) << ": " << answer.status;
      // Until every service of the table is there, some say that they are not.
      EXPECT_FALSE(absl::IsInternal(answer.status)) << answer.status;
    }
  }
}

TEST_F(ApiCalls, TheAuditLogNamesWhoCalls) {
  Call("POST", "/v1/sessions", *server::JsonOf(WaveRequest("wave")), PeerOf(Role::kOperator));
  Call("DELETE", "/v1/sessions/wave", "", PeerOf(Role::kViewer));
  std::ifstream file(folder_.path() / "audit.jsonl");
  const std::string text((std::istreambuf_iterator<char>(file)), {});
  EXPECT_THAT(text, AllOf(HasSubstr("CreateSession"), HasSubstr("user 'kim'"),
                          HasSubstr("10.0.0.9"), HasSubstr("call_refused")));
  EXPECT_THAT(text, Not(HasSubstr("a client on this machine")));
}

TEST_F(ApiCalls, NobodyElseCanNameACaller) {
  grpc::ClientContext context;
  context.AddMetadata("rigcal-key", "");
  context.AddMetadata("rigcal-role", "admin");
  context.AddMetadata("rigcal-name-bin", "mallory");
  v1::CreateSessionRequest request = WaveRequest("wave");
  v1::CreateSessionResponse response;
  v1::SessionService::NewStub(channel())->CreateSession(&context, request, &response);
  std::ifstream file(folder_.path() / "audit.jsonl");
  const std::string text((std::istreambuf_iterator<char>(file)), {});
  EXPECT_THAT(text, AllOf(HasSubstr("CreateSession"), Not(HasSubstr("mallory"))));
}

TEST_F(ApiCalls, APreviewIsAnImageWithItsDescription) {
  TestAgent agent(channel(), MakeHello("pc", {"left"}));
  agent.ReadHello();
  auto preview = std::async(
      std::launch::async, [&] { return Call("GET", "/v1/cameras/left/preview.jpg?max_wait=20s"); });
  const v1::PreviewRequest asked =
      agent.ReadUntil(v1::ConnectResponse::kPreviewRequest).preview_request();
  v1::ConnectRequest message;
  message.mutable_preview()->set_request_id(asked.request_id());
  message.mutable_preview()->set_status(v1::PREVIEW_STATUS_OK);
  message.mutable_preview()->set_jpeg("jpeg");
  message.mutable_preview()->mutable_info()->set_camera("left");
  message.mutable_preview()->mutable_info()->set_outcome(v1::DETECTION_OUTCOME_WAND);
  agent.Send(message);
  const ApiAnswer answer = preview.get();
  ASSERT_THAT(answer.status, IsOk());
  EXPECT_EQ(answer.body->text, "jpeg");
  EXPECT_EQ(Json::parse(answer.info)["agent_id"], "pc");
  EXPECT_FALSE(Json::parse(answer.info).contains("jpeg"));
}

}  // namespace
}  // namespace rigcal::testing::api_calls_test
