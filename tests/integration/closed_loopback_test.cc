// SPDX-License-Identifier: Apache-2.0
// A server that is open to the network is closed to other users and programs of its own PC.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <memory>
#include <string>

#include "tests/testing/http_connection.h"
#include "tests/testing/process.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing::closed_loopback_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

class ClosedLoopback : public ::testing::Test {
 protected:
  // Where `rigcal` of this user looks for a server of its own, and for a certificate.
  std::map<std::string, std::string> Environment() const {
    return {{"XDG_DATA_HOME", directory_.path().string()},
            {"XDG_CONFIG_HOME", (directory_.path() / "config").string()}};
  }
  void Start(const std::string& more) {
    std::ofstream(directory_.path() / "server.toml")
        << "listen = \"0.0.0.0:0\"\ndata_dir = \"rigcal\"\n[https]\nlisten = \"0.0.0.0:0\"\n"
        << more;
    server_ = std::make_unique<Process>(Process::Options{
        {"rigcal-server", "--config", (directory_.path() / "server.toml").string(), "--port-file",
         PortFile("port"), "--http-port-file", PortFile("http_port")},
        {}});
    ASSERT_TRUE(WaitFor([&] { return Port("port") != 0; })) << server_->StandardError();
  }
  std::string PortFile(const std::string& name) const {
    return (directory_.path() / name).string();
  }
  int Port(const std::string& name) const {
    int port = 0;
    std::ifstream(PortFile(name)) >> port;
    return port;
  }
  bool LogSays(const std::string& text) const {
    return server_->StandardError().find(text) != std::string::npos;
  }
  CommandResult ListAgentsOverThePort() const {
    return RunCommand(
        {"rigcal", "agent", "list", "--server", "127.0.0.1:" + std::to_string(Port("port"))},
        Environment());
  }

  TemporaryDirectory directory_;
  std::unique_ptr<Process> server_;
};

TEST_F(ClosedLoopback, OnlyTheServersUserNeedsNoCertificate) {
  Start("");
  EXPECT_TRUE(WaitFor([&] { return LogSays("[tls] loopback = false"); }));
  EXPECT_TRUE(LogSays("needs no certificate")) << server_->StandardError();
  const CommandResult port = ListAgentsOverThePort();
  EXPECT_EQ(port.exit_code, 6) << port.error;
  EXPECT_THAT(port.error, AllOf(HasSubstr("without a certificate"), HasSubstr("rigcal login")));
  const CommandResult file = RunCommand({"rigcal", "agent", "list"}, Environment());
  EXPECT_EQ(file.exit_code, 0) << file.error;
  // The dashboard's port sends those without TLS to HTTPS, where they must sign in.
  ASSERT_OK_AND_ASSIGN(const HttpReply reply,
                       HttpConnection(Port("http_port")).Get("/v1/status", "Host: 127.0.0.1\r\n"));
  EXPECT_EQ(reply.status, 308);
}

TEST_F(ClosedLoopback, OpensByOneLineAndTheLogWarns) {
  Start("[tls]\nloopback = false\n");
  EXPECT_TRUE(WaitFor([&] { return LogSays("every user and program of this PC"); }));
  EXPECT_EQ(ListAgentsOverThePort().exit_code, 0) << ListAgentsOverThePort().error;
}

}  // namespace
}  // namespace rigcal::testing::closed_loopback_test
