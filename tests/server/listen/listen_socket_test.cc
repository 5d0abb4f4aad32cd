// SPDX-License-Identifier: Apache-2.0
#include "server/listen/listen_socket.h"

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fstream>
#include <string>

#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing::listen_socket_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

sockaddr_storage Four(const char* host, uint16_t port) {
  sockaddr_storage address{};
  auto& four = reinterpret_cast<sockaddr_in&>(address);
  four.sin_family = AF_INET;
  four.sin_port = htons(port);
  inet_pton(AF_INET, host, &four.sin_addr);
  return address;
}

sockaddr_storage Six(const char* host, uint16_t port) {
  sockaddr_storage address{};
  auto& six = reinterpret_cast<sockaddr_in6&>(address);
  six.sin6_family = AF_INET6;
  six.sin6_port = htons(port);
  inet_pton(AF_INET6, host, &six.sin6_addr);
  return address;
}

TEST(WithPort, AHostAloneGetsThePort) {
  EXPECT_EQ(server::WithPort("0.0.0.0", 7420), "0.0.0.0:7420");
  EXPECT_EQ(server::WithPort("server.lab", 7420), "server.lab:7420");
  EXPECT_EQ(server::WithPort("[::1]", 7420), "[::1]:7420");
}

TEST(WithPort, AnythingElseStaysAsItIs) {
  for (const char* address : {"127.0.0.1:0", "[::1]:80", "8080", ""}) {
    EXPECT_EQ(server::WithPort(address, 7420), address);
  }
}

TEST(ListenSocket, KnowsLoopback) {
  for (const char* own : {"127.0.0.1:7420", "127.1.2.3:0", "localhost:1", "[::1]:7420"}) {
    EXPECT_TRUE(server::IsLoopbackAddress(own)) << own;
  }
  for (const char* open : {"0.0.0.0:7420", "[::]:7420", "192.168.1.4:1", "example.org:1",
                           "127.0.0.1.example.org:1", "128.0.0.1:1", "", "127.0.0.1"}) {
    EXPECT_FALSE(server::IsLoopbackAddress(open)) << open;
  }
  EXPECT_TRUE(server::IsLoopback(Four("127.0.0.9", 1)));
  EXPECT_TRUE(server::IsLoopback(Six("::1", 1)));
  EXPECT_TRUE(server::IsLoopback(Six("::ffff:127.0.0.1", 1)));
  EXPECT_FALSE(server::IsLoopback(Four("10.0.0.1", 1)));
  EXPECT_FALSE(server::IsLoopback(Six("::ffff:10.0.0.1", 1)));
  EXPECT_FALSE(server::IsLoopback(Six("fe80::1", 1)));
}

TEST(ListenSocket, RefusesWhatIsNoAddress) {
  for (const char* malformed : {"", "7420", "127.0.0.1", ":7420", "127.0.0.1:", "127.0.0.1:x",
                                "127.0.0.1:70000", "127.0.0.1:-1"}) {
    EXPECT_THAT(server::ListenOn(malformed),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("HOST:PORT")));
  }
}

TEST(ListenSocket, TwoServersDoNotShareAPort) {
  ASSERT_OK_AND_ASSIGN(const int first, server::ListenOn("127.0.0.1:0"));
  const std::string address = "127.0.0.1:" + std::to_string(server::PortOf(first));
  EXPECT_THAT(
      server::ListenOn(address),
      StatusIs(absl::StatusCode::kUnavailable, AllOf(HasSubstr(address), HasSubstr("--listen"))));
  close(first);
  ASSERT_OK_AND_ASSIGN(const int second, server::ListenOn(address));
  close(second);
}

TEST(ListenSocket, WritesAddresses) {
  EXPECT_EQ(server::AddressText(Four("10.0.0.5", 41002)), "10.0.0.5:41002");
  EXPECT_EQ(server::AddressText(Six("2001:db8::5", 1)), "[2001:db8::5]:1");
  EXPECT_EQ(server::AddressText(Six("::ffff:10.0.0.5", 1)), "10.0.0.5:1");
  EXPECT_EQ(server::AddressText({}), "");
  EXPECT_EQ(server::AddressGroup(Four("10.0.0.5", 41002)), "10.0.0.5");
  EXPECT_EQ(server::AddressGroup(Six("2001:db8:1:2:3:4:5:6", 1)),
            server::AddressGroup(Six("2001:db8:1:2::9", 2)))
      << "one network is one client";
  EXPECT_NE(server::AddressGroup(Six("2001:db8:1:2::9", 1)),
            server::AddressGroup(Six("2001:db8:1:3::9", 1)));
}

TEST(ListenSocket, AFileIsForItsUserAndReplacesAnOldOne) {
  const TemporaryDirectory directory;
  const auto path = directory.path() / "rigcal.sock";
  for (int i = 0; i < 2; ++i) {
    ASSERT_OK_AND_ASSIGN(const int descriptor, server::ListenOnFile(path));
    struct stat status {};
    ASSERT_EQ(stat(path.c_str(), &status), 0);
    EXPECT_TRUE(S_ISSOCK(status.st_mode));
    EXPECT_EQ(status.st_mode & 0777, 0600u);
    close(descriptor);  // as after kill -9: the file stays
  }
  EXPECT_THAT(server::ListenOnFile(directory.path() / std::string(200, 'x')),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("too long")));
  const auto file = directory.WriteFile("precious", "text");
  EXPECT_THAT(server::ListenOnFile(file), StatusIs(absl::StatusCode::kUnavailable, HasSubstr("")));
  EXPECT_TRUE(std::filesystem::is_regular_file(file)) << "only a socket is replaced";
}

}  // namespace
}  // namespace rigcal::testing::listen_socket_test
