// SPDX-License-Identifier: Apache-2.0
#include "client/net/server_connection.h"

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <string>
#include <thread>

#include "tests/client/fake_server.h"
#include "tests/client/sample_messages.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::client::server_connection_test {
namespace {

using ::rigcal::testing::FakeServer;
using ::rigcal::testing::FullSession;
using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::_;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

absl::StatusOr<v1::GetSessionResponse> Get(ServerConnection& server, const std::string& id,
                                           std::chrono::milliseconds timeout = kCallTimeout) {
  v1::GetSessionRequest request;
  request.set_id(id);
  return server.Call(&v1::SessionService::Stub::GetSession, request, timeout);
}

TEST(ServerConnection, PassesTheServersStatusOn) {
  FakeServer fake;
  ServerConnection server(fake.address());
  EXPECT_THAT(Get(server, "nobody"), StatusIs(absl::StatusCode::kNotFound, HasSubstr("nobody")));
  fake.sessions["wave"] = FullSession("wave");
  ASSERT_OK_AND_ASSIGN(const v1::GetSessionResponse response, Get(server, "wave"));
  EXPECT_EQ(response.session().observation_count(), 1238u);
}

TEST(ServerConnection, UnreachableNamesTheAddressAndWhatToDo) {
  ServerConnection server("127.0.0.1:1");
  EXPECT_THAT(Get(server, "x"), StatusIs(absl::StatusCode::kUnavailable,
                                         AllOf(HasSubstr("127.0.0.1:1"), HasSubstr("refused"),
                                               HasSubstr("--server"), HasSubstr("RIGCAL_SERVER"))));
}

TEST(ServerConnection, AServerThatSaysNothingIsUnreachable) {
  // A socket that takes connections and never speaks.
  const int listener = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address = {};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof(address);
  ASSERT_EQ(bind(listener, reinterpret_cast<sockaddr*>(&address), size), 0);
  ASSERT_EQ(listen(listener, 4), 0);
  ASSERT_EQ(getsockname(listener, reinterpret_cast<sockaddr*>(&address), &size), 0);
  ServerConnection server("127.0.0.1:" + std::to_string(ntohs(address.sin_port)));
  EXPECT_THAT(Get(server, "x", std::chrono::milliseconds(200)),
              StatusIs(absl::StatusCode::kUnavailable, HasSubstr("did not answer within 0.2 s")));
  close(listener);
}

// A port whose connections end, before or after the first words of HTTP/2.
class ClosingPort {
 public:
  explicit ClosingPort(bool speaks) : listener_(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in address = {};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof(address);
    EXPECT_EQ(bind(listener_, reinterpret_cast<sockaddr*>(&address), size), 0);
    EXPECT_EQ(listen(listener_, 4), 0);
    EXPECT_EQ(getsockname(listener_, reinterpret_cast<sockaddr*>(&address), &size), 0);
    address_ = "127.0.0.1:" + std::to_string(ntohs(address.sin_port));
    thread_ = std::thread([this, speaks] {
      for (int peer; (peer = accept(listener_, nullptr, nullptr)) >= 0; close(peer)) {
        if (!speaks) continue;
        constexpr char kEmptySettings[] = {0, 0, 0, 4, 0, 0, 0, 0, 0};
        EXPECT_EQ(write(peer, kEmptySettings, sizeof(kEmptySettings)), 9);
        // Until the call has come: more than the preface and settings of the client.
        std::array<char, 4096> bytes{};
        for (std::string seen; seen.find("GetSession") == std::string::npos;) {
          const ssize_t count = read(peer, bytes.data(), bytes.size());
          if (count <= 0) break;
          seen.append(bytes.data(), static_cast<size_t>(count));
        }
      }
    });
  }
  ~ClosingPort() {
    shutdown(listener_, SHUT_RDWR);
    thread_.join();
    close(listener_);
  }
  const std::string& address() const { return address_; }

 private:
  const int listener_;
  std::string address_;
  std::thread thread_;
};

TEST(ServerConnection, ALostConnectionIsNoMissingCertificate) {
  const wire::ClientIdentity none{.folder = {}, .stem = "user"};
  {
    const ClosingPort dies(/*speaks=*/true);
    ServerConnection server(dies.address(), none);
    EXPECT_THAT(Get(server, "x"), StatusIs(absl::StatusCode::kUnavailable,
                                           AllOf(HasSubstr("was lost"), HasSubstr("try again"),
                                                 Not(HasSubstr("certificate")))));
  }
  const ClosingPort wants_one(/*speaks=*/false);
  ServerConnection server(wants_one.address(), none);
  EXPECT_THAT(Get(server, "x"),
              StatusIs(absl::StatusCode::kUnavailable,
                       AllOf(HasSubstr("without a certificate"), HasSubstr("rigcal login"))));
}

TEST(ServerConnection, AnotherProgramsServerIsNamed) {
  FakeServer fake;
  fake.failures["GetSession"] = grpc::Status(grpc::StatusCode::UNIMPLEMENTED, "");
  ServerConnection server(fake.address());
  EXPECT_THAT(Get(server, "x"), StatusIs(absl::StatusCode::kUnimplemented, HasSubstr("version")));
}

TEST(ServerConnection, ARefusalWithoutWordsGetsSome) {
  FakeServer fake;
  fake.failures["GetSession"] = grpc::Status(grpc::StatusCode::INTERNAL, "");
  ServerConnection server(fake.address());
  EXPECT_THAT(Get(server, "x"), StatusIs(absl::StatusCode::kInternal,
                                         AllOf(HasSubstr(fake.address()), HasSubstr("INTERNAL"))));
}

TEST(ServerConnection, IgnoresProxiesOfTheEnvironment) {
  FakeServer fake;
  fake.sessions["wave"] = FullSession("wave");
  setenv("http_proxy", "http://127.0.0.1:1", 1);
  setenv("grpc_proxy", "http://127.0.0.1:1", 1);
  ServerConnection server(fake.address());
  EXPECT_THAT(Get(server, "wave"), IsOk());
  unsetenv("http_proxy");
  unsetenv("grpc_proxy");
}

TEST(ServerConnection, TellsTheHealth) {
  FakeServer fake;
  ServerConnection server(fake.address());
  EXPECT_EQ(*server.CheckHealth(), "SERVING");
  fake.SetServing(false);
  EXPECT_EQ(*server.CheckHealth(), "NOT_SERVING");
  EXPECT_THAT(ServerConnection("127.0.0.1:1").CheckHealth(),
              StatusIs(absl::StatusCode::kUnavailable, _));
}

TEST(Read, EndsEarlyWhenNobodyWantsMore) {
  FakeServer fake;
  for (int i = 0; i < 1000; ++i) fake.observations.emplace_back().set_camera("left");
  ServerConnection server(fake.address());
  int seen = 0;
  EXPECT_THAT(
      server.Read(&v1::SessionService::Stub::ReadObservations, {}, std::chrono::milliseconds(0),
                  [&](const v1::ReadObservationsResponse&) { return ++seen < 3; }),
      IsOk());
  EXPECT_EQ(seen, 3);
}

TEST(Read, GivesTheStatusAfterTheMessages) {
  FakeServer fake;
  fake.observations.resize(2);
  fake.failures["ReadObservations"] = grpc::Status(grpc::StatusCode::DATA_LOSS, "checksum");
  ServerConnection server(fake.address());
  int seen = 0;
  EXPECT_THAT(
      server.Read(&v1::SessionService::Stub::ReadObservations, {}, std::chrono::milliseconds(0),
                  [&](const v1::ReadObservationsResponse&) { return ++seen > 0; }),
      StatusIs(absl::StatusCode::kDataLoss, HasSubstr("checksum")));
  EXPECT_EQ(seen, 2);
}

}  // namespace
}  // namespace rigcal::client::server_connection_test
