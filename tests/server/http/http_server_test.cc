// SPDX-License-Identifier: Apache-2.0
#include "server/http/http_server.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <memory>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "common/enrolment/https_call.h"
#include "common/file/durable_file.h"
#include "server/identity/server_identity.h"
#include "tests/server/http/join_fixture.h"
#include "tests/testing/process.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing::http_server_test {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

class HttpServer : public JoinFixture {
 protected:
  absl::StatusOr<HttpsAnswer> Get(const std::string& path) {
    return CallHttps(
        {.address = address(), .method = "GET", .path = path, .ca_pem = authority().ca_pem()});
  }
  static std::string Plain(const std::string& first_line, const std::string& headers = "",
                           const std::string& body = "") {
    return first_line + " HTTP/1.1\r\nHost: a\r\nConnection: close\r\n" + headers + "\r\n" + body;
  }
  void ExpectHealthy() {
    const auto answer = Get("/healthz");
    ASSERT_THAT(answer, IsOk());
    EXPECT_EQ(answer->status, 200u);
  }
};

TEST_F(HttpServer, AnswersWhereItHasRoutes) {
  StartServer();
  ASSERT_OK_AND_ASSIGN(const HttpsAnswer health, Get("/healthz?verbose=1"));
  EXPECT_EQ(health.body, "ok\n");
  ASSERT_TRUE(health.server_time.has_value());
  EXPECT_LT(absl::AbsDuration(absl::Now() - *health.server_time), absl::Minutes(1));
  ASSERT_OK_AND_ASSIGN(const HttpsAnswer ca, Get("/v1/ca"));
  EXPECT_EQ(ca.body, authority().ca_pem());
  ASSERT_OK_AND_ASSIGN(const HttpsAnswer nothing, Get("/v1/nothing"));
  EXPECT_EQ(nothing.status, 404u);
  ASSERT_OK_AND_ASSIGN(const HttpsAnswer other_method, Get("/v1/enrol"));
  EXPECT_EQ(other_method.status, 405u);
}

TEST_F(HttpServer, TellsWhenItIsNotReady) {
  StartServer();
  ASSERT_OK_AND_ASSIGN(const HttpsAnswer ready, Get("/readyz"));
  EXPECT_EQ(ready.status, 200u);
  ready_ = absl::UnavailableError("the disk is full");
  ASSERT_OK_AND_ASSIGN(const HttpsAnswer full, Get("/readyz"));
  EXPECT_EQ(full.status, 503u);
  EXPECT_EQ(full.body, "the disk is full\n");
  ExpectHealthy();
}

TEST_F(HttpServer, RefusesTooMuch) {
  StartServer();
  EXPECT_THAT(SendOverTls(port(), Plain("GET /healthz", "X: " + std::string(20'000, 'x') + "\r\n")),
              StartsWith("HTTP/1.1 431"));
  EXPECT_THAT(SendOverTls(port(), Plain("POST /v1/enrol", "Content-Length: 100000\r\n",
                                        std::string(100'000, 'x'))),
              StartsWith("HTTP/1.1 413"));
  // Announced, and never sent.
  EXPECT_THAT(SendOverTls(port(), Plain("POST /v1/enrol", "Content-Length: 99999999999999\r\n")),
              StartsWith("HTTP/1.1 413"));
  std::string chunks;
  for (int i = 0; i < 100; ++i) chunks += "1000\r\n" + std::string(0x1000, 'x') + "\r\n";
  EXPECT_THAT(SendOverTls(port(), Plain("POST /v1/enrol", "Transfer-Encoding: chunked\r\n",
                                        chunks + "0\r\n\r\n")),
              StartsWith("HTTP/1.1 413"));
  ExpectHealthy();
}

TEST_F(HttpServer, RefusesAFieldThatComesTwiceAndMustNot) {
  StartServer();
  for (const char* twice :
       {"Host: localhost\r\nHost: evil.example\r\n", "Host: localhost\r\nhost: localhost\r\n",
        "Host: localhost\r\nOrigin: https://a\r\nOrigin: https://b\r\n",
        "Host: localhost\r\nCookie: a=1\r\nCookie: a=2\r\n"}) {
    EXPECT_THAT(SendOverTls(port(), absl::StrCat("GET /healthz HTTP/1.1\r\n", twice,
                                                 "Connection: close\r\n\r\n")),
                StartsWith("HTTP/1.1 400"))
        << twice;
  }
  ExpectHealthy();
}

TEST_F(HttpServer, SurvivesGarbage) {
  StartServer();
  for (const char* bad : {"GET\r\n\r\n", "GET / HTTP/9.9\r\n\r\n", "\r\n\r\n\r\n", "{}\r\n\r\n",
                          "GET / HTTP/1.1\r\nContent-Length: -1\r\n\r\n",
                          "GET / HTTP/1.1\r\nTransfer-Encoding: x\r\nA\r\n\r\n"}) {
    EXPECT_THAT(SendOverTls(port(), bad), StartsWith("HTTP/1.1 4")) << bad;
  }
  std::mt19937 random(7);
  for (int i = 0; i < 50; ++i) {
    std::string bytes(1 + random() % 3000, '\0');
    for (char& byte : bytes) byte = static_cast<char>(random());
    // Random bytes may look like the beginning of a request: it ends.
    SendOverTls(port(), bytes + "\r\n\r\n");
    RawSocket(port()).Send(bytes);
  }
  ExpectHealthy();
}

TEST_F(HttpServer, AnswersBadBodiesWithWhatIsWrong) {
  StartServer();
  for (const std::string& body :
       {std::string(), std::string("[]"), std::string("{\"secret\": 3, \"csr\": \"\"}"),
        std::string("{\"secret\": \"*\", \"csr\": \"\"}"), std::string(30'000, '[')}) {
    const auto answer = CallHttps({.address = address(),
                                   .method = "POST",
                                   .path = "/v1/enrol",
                                   .body = body,
                                   .ca_pem = authority().ca_pem()});
    ASSERT_THAT(answer, IsOk());
    EXPECT_EQ(answer->status, 400u);
    EXPECT_THAT(answer->body, HasSubstr("INVALID_ARGUMENT"));
    EXPECT_THAT(answer->body, HasSubstr("secret"));
  }
}

TEST_F(HttpServer, ServesThisMachineWithoutTlsOnTheSamePort) {
  StartServer();
  const RawSocket plain(port());
  plain.Send(Plain("GET /healthz"));
  const std::string answer = plain.ReadToEnd(20);
  EXPECT_THAT(answer, StartsWith("HTTP/1.1 200"));
  EXPECT_THAT(answer, HasSubstr("\r\n\r\nok\n"));
  ExpectHealthy();
}

TEST_F(HttpServer, SendsOthersWithoutTlsToHttps) {
  http_options_.plain_loopback = false;  // this machine is as any other
  StartServer();
  const RawSocket read(port());
  read.Send(Plain("GET /v1/ca?x=1"));
  const std::string answer = read.ReadToEnd(20);
  EXPECT_THAT(answer, StartsWith("HTTP/1.1 308"));
  EXPECT_THAT(answer, HasSubstr("Location: https://a/v1/ca?x=1\r\n"));
  EXPECT_THAT(answer, ::testing::Not(HasSubstr("CERTIFICATE")));
  const RawSocket write(port());
  write.Send(Plain("POST /v1/enrol", "Content-Length: 2\r\n", "{}"));
  EXPECT_THAT(write.ReadToEnd(20), StartsWith("HTTP/1.1 403"));
  ExpectHealthy();
}

TEST_F(HttpServer, KeepsConnectionsAndTellsWhoExpectsToGoOn) {
  StartServer();
  const std::string get = "GET /healthz HTTP/1.1\r\nHost: a\r\n\r\n";
  const RawSocket socket(port());
  socket.Send(get + get + "HEAD /healthz HTTP/1.1\r\nHost: a\r\n\r\n" +
              Plain("POST /v1/enrol", "Content-Length: 2\r\nExpect: 100-continue\r\n", "{}"));
  const std::string answer = socket.ReadToEnd(20);
  const auto count = [&answer](const std::string& text) {
    int found = 0;
    for (size_t at = answer.find(text); at != std::string::npos; at = answer.find(text, at + 1)) {
      ++found;
    }
    return found;
  };
  EXPECT_EQ(count("HTTP/1.1 200 OK"), 3);
  EXPECT_EQ(count("\r\n\r\nok\n"), 2) << "HEAD has no body";
  EXPECT_EQ(count("HTTP/1.1 100 Continue"), 1);
  EXPECT_EQ(count("HTTP/1.1 400"), 1);
}

TEST_F(HttpServer, MakesRoomAmongThoseWhoHaveAskedNothing) {
  http_options_.max_connections_per_address = 8;
  StartServer();
  const RawSocket asks(port());
  asks.Send("GET /healthz HTTP/1.1\r\nHost: a\r\n\r\n");
  // Its first answer is on the way once another connection has got one.
  ExpectHealthy();
  ExpectHealthy();
  std::vector<std::unique_ptr<RawSocket>> slow;
  for (int i = 0; i < 100; ++i) {
    slow.push_back(std::make_unique<RawSocket>(port()));
    slow.back()->Send("G");
  }
  bool closed = false;
  slow[0]->ReadToEnd(30, &closed);
  EXPECT_TRUE(closed);
  asks.Send(Plain("GET /healthz"));
  EXPECT_THAT(asks.ReadToEnd(20), HasSubstr("ok\n")) << "it was dropped for them";
}

TEST_F(HttpServer, IsNotHeldUpBySlowSockets) {
  http_options_.max_connections = 64;
  StartServer();
  std::vector<std::unique_ptr<RawSocket>> slow;
  for (int i = 0; i < 200; ++i) {
    slow.push_back(std::make_unique<RawSocket>(port()));
    ASSERT_TRUE(slow.back()->connected());
    slow.back()->Send("\x16\x03\x01");  // the beginning of a handshake
    if (i % 20 == 0) ExpectHealthy();
  }
  ExpectHealthy();
  // The first ones made room for those that came later.
  bool closed = false;
  slow[0]->ReadToEnd(30, &closed);
  EXPECT_TRUE(closed);
}

TEST_F(HttpServer, ClosesWhatStaysSilent) {
  http_options_.request_timeout = std::chrono::milliseconds(200);
  StartServer();
  const RawSocket silent(port());
  bool closed = false;
  silent.ReadToEnd(30, &closed);
  EXPECT_TRUE(closed);
  ExpectHealthy();
}

TEST_F(HttpServer, TakesARenewedCertificateWhileItRuns) {
  http_options_.refresh_interval = std::chrono::milliseconds(20);
  std::atomic<int> runs = 0;
  http_options_.refresh = [&] { ++runs; };
  StartServer();
  const std::string other_host = "localhost:" + std::to_string(port());
  const std::string old = *ReadSmallFile(folder() / "server.crt");
  ASSERT_THAT(server::EnsureServerIdentity(folder().parent_path(), {"renamed"}), IsOk());
  ASSERT_NE(*ReadSmallFile(folder() / "server.crt"), old);
  const int before = runs;
  ASSERT_TRUE(WaitFor([&] { return runs >= before + 2; }));
  ExpectHealthy();
}

TEST_F(HttpServer, SaysWhyItCannotStart) {
  StartServer();
  server::HttpServerOptions options = http_options_;
  options.listen_address = address();
  EXPECT_THAT(server::HttpServer(options, {}).Start(),
              StatusIs(absl::StatusCode::kUnavailable, HasSubstr(address())));
  options.listen_address = "127.0.0.1:0";
  options.key_file = folder() / "ca.key";
  EXPECT_THAT(server::HttpServer(options, {}).Start(),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("ca.key")));
  options.listen_address = "nowhere";
  EXPECT_FALSE(server::HttpServer(options, {}).Start().ok());
}

}  // namespace
}  // namespace rigcal::testing::http_server_test
