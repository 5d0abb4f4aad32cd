// SPDX-License-Identifier: Apache-2.0
// The HTTP port of a real server under clients that mean no good, while a page polls the live state
// of a session that captures.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <csignal>
#include <fstream>
#include <iterator>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <vector>

#include "tests/testing/http_connection.h"
#include "tests/testing/process.h"
#include "tests/testing/process_figures.h"
#include "tests/testing/raw_socket.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing::http_abuse_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;

// A page that polls with one connection; whatever others do, it is answered.
class Page {
 public:
  explicit Page(int port) : thread_([this, port] { Poll(port); }) {}
  ~Page() { Stop(); }

  // Answers so far.
  int answers() const { return answers_; }
  // Some more answers come from here on.
  bool GoesOn() const {
    const int before = answers_;
    return WaitFor([&] { return answers_ >= before + 3; }, std::chrono::seconds(20));
  }
  // What went wrong; empty: nothing.
  std::string Stop() {
    stopping_ = true;
    if (thread_.joinable()) thread_.join();
    return problem_;
  }

 private:
  void Poll(int port) {
    HttpConnection connection(port);
    std::string etag;
    while (!stopping_) {
      const auto reply =
          connection.Get("/v1/live", etag.empty() ? "" : "If-None-Match: " + etag + "\r\n");
      if (!reply.ok() || (reply->status != 200 && reply->status != 304)) {
        problem_ = reply.ok() ? reply->head + reply->body : reply.status().ToString();
        return;
      }
      if (reply->status == 304 && !reply->body.empty()) problem_ = "304 with a body";
      etag = reply->Header("ETag");
      ++answers_;
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
  }

  std::atomic<int> answers_ = 0;
  std::atomic<bool> stopping_ = false;
  std::string problem_;
  std::thread thread_;
};

class HttpAbuse : public ::testing::Test {
 protected:
  void SetUp() override { StartServer(directory_.path() / "data"); }

  // With TLS for those who sign in, and without for this machine, on one port.
  void StartServer(const std::filesystem::path& data_dir) {
    server_.reset();
    const auto config = directory_.WriteFile("server.toml", "[https]\nlisten = \"127.0.0.1:0\"\n");
    const std::filesystem::path port_file = directory_.path() / "http_port";
    server_ = std::make_unique<ServerProcess>(
        data_dir, 0, std::map<std::string, std::string>{},
        std::vector<std::string>{"--config", config.string(), "--http-port-file",
                                 port_file.string()});
    std::ifstream(port_file) >> port_;
    ASSERT_GT(port_, 0) << server_->process().StandardError();
  }
  void StartWave() {
    agent_ = std::make_unique<Process>(Process::Options{
        {"rigcal-agent", "--server", server_->address(), "--state-dir",
         (directory_.path() / "agent").string(), "--source", "sim:camera=0;cameras=2;duration=600",
         "--source", "sim:camera=1;cameras=2;duration=600"},
        {}});
    ASSERT_TRUE(WaitFor([&] {
      return RunCommand({"rigcal", "session", "create", "--target", "wand:0,0.13,0.39", "--id",
                         "wave", "--start", "--server", server_->address()})
                     .exit_code == 0 ||
             RunCommand({"rigcal", "session", "start", "wave", "--server", server_->address()})
                     .exit_code == 0;
    }));
  }
  HttpReply Send(const std::string& method, const std::string& path, const std::string& headers,
                 const std::string& body = "") const {
    const auto reply = HttpConnection(port_).Call(method, path, headers, body);
    EXPECT_TRUE(reply.ok()) << reply.status();
    return reply.value_or(HttpReply{});
  }
  // Over TLS; the answer with its head.
  std::string Curl(const std::vector<std::string>& arguments, const std::string& path) const {
    std::vector<std::string> all = {"curl", "-sk", "-i"};
    all.insert(all.end(), arguments.begin(), arguments.end());
    all.push_back("https://127.0.0.1:" + std::to_string(port_) + path);
    std::string command = "exec";
    for (const std::string& argument : all) command += " '" + argument + "'";
    return RunCommand({"/bin/sh", "-c", command}).output;
  }
  std::string JoinString() const {
    const CommandResult made = RunCommand(
        {"rigcal", "token", "create", "--role", "viewer", "--server", server_->address()});
    EXPECT_EQ(made.exit_code, 0) << made.error;
    return made.output.substr(0, made.output.find('\n'));
  }
  // The answer to POST /v1/login.
  std::string LogIn(const std::string& join) const {
    return Curl({"-H", "X-Rigcal: 1", "-d", "{\"token\": \"" + join + "\"}"}, "/v1/login");
  }
  static std::string CookieOf(const std::string& answer) {
    const size_t begin = answer.find("Set-Cookie: ");
    if (begin == std::string::npos) return "";
    return answer.substr(begin + 12, answer.find(';', begin) - begin - 12);
  }
  std::string WithCookie(const std::string& cookie) const {
    return Curl({"-H", "Cookie: " + cookie}, "/v1/status");
  }

  const TemporaryDirectory directory_;
  std::unique_ptr<ServerProcess> server_;
  std::unique_ptr<Process> agent_;
  int port_ = 0;
};

TEST_F(HttpAbuse, ForeignPagesGetNothing) {
  StartWave();
  Page page(port_);
  ASSERT_TRUE(page.GoesOn());
  EXPECT_EQ(Send("GET", "/v1/status", "Host: evil.example\r\n").status, 403);
  EXPECT_EQ(Send("GET", "/", "Host: evil.example\r\n").status, 403);
  EXPECT_EQ(Send("GET", "/v1/live", "Origin: https://evil.example\r\n").status, 403);
  EXPECT_EQ(Send("GET", "/v1/live", "Sec-Fetch-Site: cross-site\r\n").status, 403);
  // A form of another site can be sent without a question; the header cannot.
  const HttpReply stop = Send("POST", "/v1/sessions/wave:stop", "", "{}");
  EXPECT_EQ(stop.status, 403);
  EXPECT_THAT(stop.body, HasSubstr("X-Rigcal"));
  EXPECT_EQ(Send("DELETE", "/v1/sessions/wave", "").status, 403);
  EXPECT_THAT(Send("GET", "/v1/sessions/wave", "").body, HasSubstr("STATE_CAPTURING"));
  EXPECT_TRUE(page.GoesOn());
  EXPECT_EQ(page.Stop(), "");
}

TEST_F(HttpAbuse, OnlyItsOwnTokensAndCookiesCount) {
  if (RunCommand({"/bin/sh", "-c", "command -v curl"}).exit_code != 0) {
    GTEST_SKIP() << "curl is not installed";
  }
  EXPECT_THAT(Curl({}, "/v1/status"), StartsWith("HTTP/1.1 401"));
  const std::string cookie = CookieOf(LogIn(JoinString()));
  ASSERT_NE(cookie, "");
  const std::string unused = JoinString();
  EXPECT_THAT(WithCookie(cookie), StartsWith("HTTP/1.1 200"));
  {
    Page page(port_);
    const std::string wrong = cookie.substr(0, cookie.size() - 4) + "AAAA";
    EXPECT_THAT(WithCookie(wrong), StartsWith("HTTP/1.1 401"));
    EXPECT_TRUE(page.GoesOn());
    EXPECT_EQ(page.Stop(), "");
  }

  // It has expired, which is told as no other fault is.
  server_.reset();
  const std::filesystem::path file = directory_.path() / "data" / "identity" / "web_sessions.json";
  std::ifstream stream(file);
  auto sessions = nlohmann::json::parse(stream);
  ASSERT_EQ(sessions.at("sessions").size(), 1u);
  sessions["sessions"][0]["created"] = "2020-01-01T00:00:00Z";
  sessions["sessions"][0]["expires"] = "2020-01-31T00:00:00Z";
  std::ofstream(file) << sessions.dump();
  StartServer(directory_.path() / "data");
  EXPECT_THAT(WithCookie(cookie), StartsWith("HTTP/1.1 401"));

  StartServer(directory_.path() / "other");
  EXPECT_THAT(WithCookie(cookie), StartsWith("HTTP/1.1 401"));
  EXPECT_THAT(LogIn(unused), AllOf(StartsWith("HTTP/1.1 403"), HasSubstr("another server")));
}

TEST_F(HttpAbuse, LargeBodiesAreNotRead) {
  StartWave();
  Page page(port_);
  ASSERT_TRUE(page.GoesOn());
  const double before_mb = MemoryMb(server_->process().pid());
  std::vector<std::unique_ptr<HttpConnection>> senders;
  for (int i = 0; i < 8; ++i) {
    senders.push_back(std::make_unique<HttpConnection>(port_));
    senders.back()->socket().Send(
        "POST /v1/sessions HTTP/1.1\r\nHost: 127.0.0.1\r\nX-Rigcal: 1\r\n"
        "Content-Length: 104857600\r\n\r\n");
  }
  // They send it all the same; the server closes after a while.
  const std::string piece(1 << 20, 'x');
  for (const auto& sender : senders) {
    for (int i = 0; i < 100; ++i) sender->socket().Send(piece);
  }
  const auto reply = HttpConnection(port_).Call(
      "POST", "/v1/sessions",
      "X-Rigcal: 1\r\nExpect: 100-continue\r\nContent-Length: 104857600\r\n");
  ASSERT_TRUE(reply.ok()) << reply.status();
  EXPECT_EQ(reply->status, 413);
  EXPECT_TRUE(page.GoesOn());
  if (!kMemoryIsSanitized) {
    EXPECT_LT(MemoryMb(server_->process().pid()), before_mb + 40);
  }
  EXPECT_EQ(page.Stop(), "");
}

TEST_F(HttpAbuse, SlowSocketsAreDroppedAndHoldUpNobody) {
  StartWave();
  Page page(port_);
  ASSERT_TRUE(page.GoesOn());
  // From two addresses of this machine, as the limit for one is lower.
  std::vector<RawSocket> slow;
  for (int i = 0; i < 500; ++i) {
    slow.emplace_back(port_, i % 2 == 0 ? "127.0.0.2" : "127.0.0.3");
    ASSERT_TRUE(slow.back().connected()) << i;
    slow.back().Send("GET /v1/live HTTP/1.1\r\nHost: 127");
  }
  EXPECT_TRUE(page.GoesOn());
  // Newcomers too.
  EXPECT_EQ(Send("GET", "/v1/status", "").status, 200);
  // One that sends a byte of its header now and then is not heard for ever.
  const RawSocket drip(port_);
  drip.Send("GET /v1/live HTTP/1.1\r\nX-Slow: ");
  EXPECT_TRUE(WaitFor([&] {
    drip.Send("x");
    return drip.AwaitEnd(std::chrono::milliseconds(100));
  }));
  for (const RawSocket& socket : slow) EXPECT_TRUE(socket.AwaitEnd());
  EXPECT_TRUE(page.GoesOn());
  EXPECT_EQ(page.Stop(), "");
  EXPECT_THAT(Send("GET", "/metrics", "").body,
              HasSubstr("rigcal_connections_open{port=\"http\"} "));
}

}  // namespace
}  // namespace rigcal::testing::http_abuse_test
