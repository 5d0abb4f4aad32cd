// SPDX-License-Identifier: Apache-2.0
#include "server/http/web_server.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <memory>
#include <regex>
#include <string>
#include <vector>

#include "server/access/access_rules.h"
#include "server/api/api_routes.h"
#include "server/api/gzip.h"
#include "tests/server/http/echo_gateway.h"
#include "tests/server/http/join_fixture.h"
#include "tests/testing/process.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing::web_server_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

std::string Request(const std::string& first_line, const std::string& headers = "",
                    const std::string& body = "") {
  std::string request = first_line + " HTTP/1.1\r\nConnection: close\r\n" + headers;
  if (headers.find("Host:") == std::string::npos) request += "Host: 127.0.0.1\r\n";
  if (!body.empty()) request += "Content-Length: " + std::to_string(body.size()) + "\r\n";
  return request + "\r\n" + body;
}

std::string BodyOf(const std::string& answer) {
  const size_t end = answer.find("\r\n\r\n");
  return end == std::string::npos ? "" : answer.substr(end + 4);
}

std::string HeaderOf(const std::string& answer, const std::string& name) {
  std::smatch match;
  std::regex_search(answer, match, std::regex("\r\n" + name + ": ([^\r]*)\r\n"));
  return match.empty() ? "" : std::string(match[1]);
}

class WebServer : public ::testing::Test {
 protected:
  WebServer() {
    options_.data_dir = data_.path();
    options_.grpc_listen = "127.0.0.1:0";
  }
  // With TLS, and without for this machine.
  void StartJoinable() {
    options_.https_listen = "127.0.0.1:0";
    Start();
  }
  void Start() {
    server_.reset();
    auto opened = server::WebServer::Open(options_);
    ASSERT_THAT(opened, IsOk());
    server_ = *std::move(opened);
    ASSERT_THAT(
        server_->Start(7420, {.gateway = &gateway_,
                              .api_description = "{}",
                              .metrics = [] { return std::string("rigcal_sessions 3\n"); }}),
        IsOk());
  }
  std::string Plain(const std::string& request) const {
    const RawSocket socket(server_->port());
    socket.Send(request);
    return socket.ReadToEnd(30);
  }
  std::string Tls(const std::string& request) const {
    return SendOverTls(server_->port(), request);
  }
  std::string JoinString(Role role) const {
    return server_->authority()->CreateToken(role, absl::Hours(1), "")->join_string;
  }
  static std::string LoginRequest(const std::string& join) {
    return Request("POST /v1/login", "X-Rigcal: 1\r\n", "{\"token\": \"" + join + "\"}");
  }
  // The Cookie header of a browser that has signed in.
  std::string SignIn(Role role) const {
    const std::string cookie = HeaderOf(Tls(LoginRequest(JoinString(role))), "Set-Cookie");
    EXPECT_FALSE(cookie.empty());
    return "Cookie: a=b; " + cookie.substr(0, cookie.find(';')) + "\r\n";
  }

  TemporaryDirectory data_;
  EchoGateway gateway_;
  server::WebServerOptions options_;
  std::unique_ptr<server::WebServer> server_;
};

TEST_F(WebServer, ThisMachineNeedsNoCertificateAndNoSignIn) {
  Start();
  EXPECT_EQ(server_->authority(), nullptr);
  EXPECT_THAT(server_->LocalUrl(), StartsWith("http://127.0.0.1:"));
  EXPECT_FALSE(std::filesystem::exists(data_.path() / "identity"));
  const std::string answer = Plain(Request("GET /v1/sessions?page_size=3"));
  EXPECT_THAT(answer, StartsWith("HTTP/1.1 200"));
  EXPECT_THAT(BodyOf(answer), AllOf(HasSubstr("SessionService/ListSessions"),
                                    HasSubstr("\"parameters\":{\"page_size\":\"3\"}")));
  EXPECT_THAT(Plain(Request("GET /v1/login")), HasSubstr("\"this_machine\":true"));
  EXPECT_THAT(Plain(Request("GET /metrics")), HasSubstr("rigcal_sessions 3"));
  EXPECT_THAT(Plain(Request("GET /v1/openapi.json")), HasSubstr("\r\n\r\n{}"));
  EXPECT_THAT(Plain(LoginRequest("rk1.x")), StartsWith("HTTP/1.1 409"));
  EXPECT_THAT(Plain(Request("GET /v1/ca")), StartsWith("HTTP/1.1 404"));
}

TEST_F(WebServer, OneThatWaitsSaysWhoAnswersAndMakesNoKeys) {
  options_.https_listen = "127.0.0.1:0";
  options_.waiting = [] {
    return server::WaitingNotice{.message = "<b> waits & says so",
                                 .active_page = "https://10.0.0.5:7421/"};
  };
  Start();
  EXPECT_EQ(server_->authority(), nullptr);
  const std::string page = Plain(Request("GET /"));
  EXPECT_THAT(page, StartsWith("HTTP/1.1 503"));
  EXPECT_THAT(BodyOf(page), AllOf(HasSubstr("&lt;b&gt; waits &amp; says so"),
                                  HasSubstr("href=\"https://10.0.0.5:7421/\"")));
  EXPECT_THAT(Plain(Request("GET /healthz")), StartsWith("HTTP/1.1 200"));
  EXPECT_THAT(Plain(Request("GET /readyz")), StartsWith("HTTP/1.1 503"));
  const std::string answer = Plain(Request("GET /v1/sessions"));
  EXPECT_THAT(answer, AllOf(StartsWith("HTTP/1.1 503"), HasSubstr("\"code\":\"UNAVAILABLE\"")));
  EXPECT_THAT(Plain(Request("POST /v1/enrol", "X-Rigcal: 1\r\n", "{}")),
              StartsWith("HTTP/1.1 503"));
}

TEST_F(WebServer, TakesAnotherPortWhereItsOwnIsInUse) {
  options_.grpc_listen = "127.0.0.1:7420";
  Start();
  const int first = server_->port();
  auto second = server::WebServer::Open(options_);
  ASSERT_THAT(second, IsOk());
  ASSERT_THAT((*second)->Start(7420, {.gateway = &gateway_, .api_description = "", .metrics = {}}),
              IsOk());
  EXPECT_NE((*second)->port(), first);
  EXPECT_GT((*second)->port(), 0);
  // What was asked for is not changed in silence.
  options_.https_listen = "127.0.0.1:" + std::to_string(first);
  auto third = server::WebServer::Open(options_);
  ASSERT_THAT(third, IsOk());
  EXPECT_THAT((*third)->Start(7420, {.gateway = &gateway_, .api_description = "", .metrics = {}}),
              StatusIs(absl::StatusCode::kUnavailable, ::testing::_));
}

TEST_F(WebServer, RefusesPagesOfOtherSites) {
  Start();
  // DNS rebinding: a name of somebody else that leads here.
  EXPECT_THAT(Plain(Request("GET /v1/status", "Host: evil.example\r\n")),
              AllOf(StartsWith("HTTP/1.1 403"), HasSubstr("evil.example")));
  EXPECT_THAT(Plain(Request("GET /", "Host: evil.example\r\n")), StartsWith("HTTP/1.1 403"));
  EXPECT_THAT(Plain("GET /v1/status HTTP/1.0\r\n\r\n"), StartsWith("HTTP/1.1 403"));
  for (const char* origin :
       {"http://evil.example", "null", "https://127.0.0.1", "http://127.0.0.1:81"}) {
    EXPECT_THAT(Plain(Request("GET /v1/status", std::string("Origin: ") + origin + "\r\n")),
                StartsWith("HTTP/1.1 403"))
        << origin;
  }
  EXPECT_THAT(Plain(Request("GET /v1/status", "Sec-Fetch-Site: cross-site\r\n")),
              StartsWith("HTTP/1.1 403"));
  EXPECT_THAT(Plain(Request("POST /v1/sessions", "", "{}")),
              AllOf(StartsWith("HTTP/1.1 403"), HasSubstr("X-Rigcal")));
  EXPECT_THAT(Plain(Request("DELETE /v1/sessions/s")), StartsWith("HTTP/1.1 403"));
  const std::string preflight =
      Plain(Request("OPTIONS /v1/sessions",
                    "Origin: http://evil.example\r\nAccess-Control-Request-Method: POST\r\n"));
  EXPECT_THAT(preflight, StartsWith("HTTP/1.1 403"));
  EXPECT_THAT(preflight, Not(HasSubstr("Access-Control-Allow")));
  EXPECT_EQ(gateway_.calls, 0);
  for (const char* host : {"127.0.0.1", "localhost:7421", "[::1]:7421", "LOCALHOST"}) {
    EXPECT_THAT(Plain(Request("GET /v1/status", std::string("Host: ") + host +
                                                    "\r\nOrigin: http://" + host + "\r\n")),
                StartsWith("HTTP/1.1 200"))
        << host;
  }
}

TEST_F(WebServer, AnswersUnderItsConfiguredNames) {
  options_.hosts = {"Rig.lab"};
  Start();
  EXPECT_THAT(Plain(Request("GET /v1/status", "Host: rig.lab:7421\r\n")),
              StartsWith("HTTP/1.1 200"));
  EXPECT_THAT(Plain(Request("GET /v1/status", "Host: rig.lab.evil\r\n")),
              StartsWith("HTTP/1.1 403"));
}

TEST_F(WebServer, OthersSignInWithAJoinString) {
  StartJoinable();
  EXPECT_THAT(Tls(Request("GET /v1/status")),
              AllOf(StartsWith("HTTP/1.1 401"), HasSubstr("UNAUTHENTICATED")));
  EXPECT_THAT(Tls(Request("GET /metrics")), StartsWith("HTTP/1.1 401"));
  EXPECT_THAT(Tls(Request("GET /login")), StartsWith("HTTP/1.1 200"));
  const std::string join = JoinString(Role::kViewer);
  EXPECT_THAT(Tls(Request("POST /v1/login", "", "{\"token\": \"" + join + "\"}")),
              StartsWith("HTTP/1.1 403"))
      << "a page of another site could send this";
  const std::string answer = Tls(LoginRequest(join));
  EXPECT_THAT(answer, StartsWith("HTTP/1.1 200"));
  const std::string cookie = HeaderOf(answer, "Set-Cookie");
  EXPECT_THAT(cookie, AllOf(StartsWith("__Host-rigcal-"), HasSubstr("HttpOnly"),
                            HasSubstr("SameSite=Strict"), HasSubstr("Secure"), HasSubstr("Path=/"),
                            HasSubstr("Max-Age=2592000")));
  EXPECT_THAT(BodyOf(answer),
              AllOf(HasSubstr("\"role\":\"viewer\""), Not(HasSubstr(cookie.substr(30, 20)))));
  EXPECT_THAT(Tls(LoginRequest(join)),
              AllOf(StartsWith("HTTP/1.1 403"), HasSubstr("already used")));
}

TEST_F(WebServer, ACookieGivesTheRoleOfItsToken) {
  StartJoinable();
  const std::string viewer = SignIn(Role::kViewer);
  const std::string worker = SignIn(Role::kOperator);
  EXPECT_THAT(Tls(Request("GET /v1/status", viewer)), StartsWith("HTTP/1.1 200"));
  EXPECT_THAT(Tls(Request("GET /metrics", viewer)), HasSubstr("rigcal_sessions 3"));
  EXPECT_THAT(Tls(Request("POST /v1/sessions", viewer + "X-Rigcal: 1\r\n", "{}")),
              AllOf(StartsWith("HTTP/1.1 403"), HasSubstr("role viewer")));
  EXPECT_THAT(Tls(Request("POST /v1/sessions", worker + "X-Rigcal: 1\r\n", "{}")),
              StartsWith("HTTP/1.1 200"));
  EXPECT_THAT(Tls(Request("GET /v1/tokens", worker)), StartsWith("HTTP/1.1 403"));
  const std::string secret = worker.substr(worker.rfind('=') + 1);
  EXPECT_THAT(Tls(Request("GET /v1/status", "Authorization: Bearer " + secret)),
              StartsWith("HTTP/1.1 200"));
}

TEST_F(WebServer, EachRouteIsForThoseWhoMayCallItsRpc) {
  StartJoinable();
  const std::map<Role, std::string> cookies = {{Role::kViewer, SignIn(Role::kViewer)},
                                               {Role::kOperator, SignIn(Role::kOperator)}};
  for (const server::ApiRoute& route : server::ApiRoutes()) {
    const std::string line =
        std::string(route.method) + " " +
        std::regex_replace(std::string(route.path), std::regex("\\{\\w+\\}"), "x");
    const std::string body = route.HasBody() ? "{}" : "";
    EXPECT_THAT(Tls(Request(line, "X-Rigcal: 1\r\n", body)), StartsWith("HTTP/1.1 401")) << line;
    const server::AccessRule* const rule = server::FindAccessRule(route.rpc);
    ASSERT_NE(rule, nullptr) << route.rpc;
    for (const auto& [role, cookie] : cookies) {
      const std::string answer = Tls(Request(line, cookie + "X-Rigcal: 1\r\n", body));
      EXPECT_THAT(answer, StartsWith(rule->roles.contains(role) ? "HTTP/1.1 200" : "HTTP/1.1 403"))
          << RoleName(role) << " " << line;
    }
  }
}

TEST_F(WebServer, ACookieEndsWithItsTokenAndStaysOverARestart) {
  StartJoinable();
  const std::string cookie = SignIn(Role::kViewer);
  Start();
  EXPECT_THAT(Tls(Request("GET /v1/status", cookie)), StartsWith("HTTP/1.1 200"));
  ASSERT_THAT(server_->authority()->RevokeToken(server_->authority()->ListTokens()[0].id), IsOk());
  EXPECT_THAT(Tls(Request("GET /v1/status", cookie)), StartsWith("HTTP/1.1 401"));
  const std::string other = SignIn(Role::kViewer);
  EXPECT_THAT(Tls(Request("POST /v1/logout", other + "X-Rigcal: 1\r\n", "{}")),
              HasSubstr("Max-Age=0"));
  EXPECT_THAT(Tls(Request("GET /v1/status", other)), StartsWith("HTTP/1.1 401"));
}

TEST_F(WebServer, TakesNoCookieOfAnotherServer) {
  StartJoinable();
  const std::string cookie = SignIn(Role::kOperator);
  const std::string join = JoinString(Role::kOperator);
  const TemporaryDirectory other;
  options_.data_dir = other.path();
  Start();
  EXPECT_THAT(Tls(Request("GET /v1/status", cookie)), StartsWith("HTTP/1.1 401"));
  EXPECT_THAT(Tls(LoginRequest(join)),
              AllOf(StartsWith("HTTP/1.1 403"), HasSubstr("another server")));
  server_.reset();
}

TEST_F(WebServer, SaysNothingAgainThatTheClientHas) {
  gateway_.padding = std::string(5000, ' ');
  Start();
  const std::string first = Plain(Request("GET /v1/status"));
  const std::string etag = HeaderOf(first, "ETag");
  EXPECT_THAT(etag, StartsWith("\""));
  for (const std::string& condition : {etag, "W/" + etag, "\"x\", " + etag, std::string("*")}) {
    // The echo holds what the client has, except where it is more than one.
    if (condition == etag || condition.front() == 'W') continue;
    const std::string answer =
        Plain(Request("GET /v1/status", "If-None-Match: " + condition + "\r\n"));
    EXPECT_THAT(answer, StartsWith("HTTP/1.1 304")) << condition;
    EXPECT_EQ(BodyOf(answer), "");
  }
  gateway_.etag = "r-17";
  EXPECT_EQ(HeaderOf(Plain(Request("GET /v1/live")), "ETag"), "\"r-17\"");
  EXPECT_THAT(Plain(Request("GET /v1/live", "If-None-Match: \"r-17\"\r\n")),
              StartsWith("HTTP/1.1 304"));
  EXPECT_THAT(BodyOf(Plain(Request("GET /v1/live", "If-None-Match: \"r-16\"\r\n"))),
              HasSubstr("\"known_etag\":\"r-16\""));
}

TEST_F(WebServer, CompressesLongBodiesForWhoTakesIt) {
  gateway_.padding = std::string(5000, ' ');
  Start();
  const std::string plain = Plain(Request("GET /v1/status"));
  EXPECT_EQ(HeaderOf(plain, "Content-Encoding"), "");
  const std::string zipped = Plain(Request("GET /v1/status", "Accept-Encoding: br, gzip\r\n"));
  EXPECT_EQ(HeaderOf(zipped, "Content-Encoding"), "gzip");
  EXPECT_LT(BodyOf(zipped).size(), 500u);
  EXPECT_EQ(*server::Gunzipped(BodyOf(zipped), 1 << 20), BodyOf(plain));
  EXPECT_EQ(HeaderOf(Plain(Request("GET /v1/status", "Accept-Encoding: gzip;q=0\r\n")),
                     "Content-Encoding"),
            "");
  EXPECT_EQ(
      HeaderOf(Plain(Request("GET /healthz", "Accept-Encoding: gzip\r\n")), "Content-Encoding"), "")
      << "it is short";
}

TEST_F(WebServer, SetsTheHeadersThatKeepAPageSafe) {
  Start();
  for (const char* path : {"/", "/v1/status", "/v1/nothing"}) {
    const std::string answer = Plain(Request(std::string("GET ") + path));
    EXPECT_THAT(HeaderOf(answer, "Content-Security-Policy"),
                AllOf(HasSubstr("default-src 'none'"), HasSubstr("script-src 'self'"),
                      HasSubstr("frame-ancestors 'none'"), Not(HasSubstr("unsafe")),
                      Not(HasSubstr("http"))));
    EXPECT_EQ(HeaderOf(answer, "X-Content-Type-Options"), "nosniff");
    EXPECT_EQ(HeaderOf(answer, "Referrer-Policy"), "no-referrer");
    EXPECT_THAT(answer, Not(HasSubstr("Access-Control")));
  }
}

TEST_F(WebServer, RefusesLargeBodiesOfWhomItDoesNotKnow) {
  StartJoinable();
  const std::string start =
      "POST /v1/sessions HTTP/1.1\r\nHost: 127.0.0.1\r\nX-Rigcal: 1\r\nContent-Length: ";
  // Nothing of it is read.
  EXPECT_THAT(Tls(start + "1000000\r\n\r\n"), StartsWith("HTTP/1.1 401"));
  EXPECT_THAT(Plain(start + "104857600\r\n\r\n" + std::string(1 << 20, 'x')),
              StartsWith("HTTP/1.1 413"));
  EXPECT_THAT(Plain(Request("POST /v1/sessions", "X-Rigcal: 1\r\n", std::string(1 << 20, ' '))),
              StartsWith("HTTP/1.1 200"));
}

TEST_F(WebServer, LongCallsHoldUpNobodyAndAreLimited) {
  Start();
  gateway_.keep = true;
  std::vector<std::unique_ptr<RawSocket>> waiting;
  for (int i = 0; i < 70; ++i) {
    waiting.push_back(std::make_unique<RawSocket>(server_->port()));
    waiting.back()->Send(Request("GET /v1/cameras/left/preview.jpg?turn=3"));
  }
  ASSERT_TRUE(WaitFor([&] { return gateway_.calls >= 64; }));
  EXPECT_THAT(Plain(Request("GET /healthz")), StartsWith("HTTP/1.1 200"));
  EXPECT_THAT(Plain(Request("GET /v1/status")),
              AllOf(StartsWith("HTTP/1.1 503"), HasSubstr("RESOURCE_EXHAUSTED")));
  gateway_.LetGo();
  int answered = 0;
  for (const auto& socket : waiting) {
    if (socket->ReadToEnd(30).starts_with("HTTP/1.1 200")) ++answered;
  }
  EXPECT_EQ(answered, 64);
  EXPECT_EQ(gateway_.calls, 64);
}

TEST_F(WebServer, EndsWhileCallsAreUnderWay) {
  Start();
  gateway_.keep = true;
  const RawSocket socket(server_->port());
  socket.Send(Request("GET /v1/status"));
  ASSERT_TRUE(WaitFor([&] { return gateway_.calls >= 1; }));
  server_->Shutdown();
  server_.reset();
  gateway_.LetGo();
}

TEST_F(WebServer, FiveHundredSlowSocketsDisturbNobody) {
  Start();
  std::vector<std::unique_ptr<RawSocket>> slow;
  for (int i = 0; i < 500; ++i) {
    slow.push_back(std::make_unique<RawSocket>(server_->port()));
    slow.back()->Send("GET /v1/status HTTP/1.1\r\nHost: 127");
    if (i % 50 != 0) continue;
    EXPECT_THAT(Plain(Request("GET /v1/status")), StartsWith("HTTP/1.1 200"));
  }
  EXPECT_THAT(Plain(Request("GET /v1/status")), StartsWith("HTTP/1.1 200"));
}

}  // namespace
}  // namespace rigcal::testing::web_server_test
