// SPDX-License-Identifier: Apache-2.0
// The proxy of the fault tests does what they count on.
#include "tests/testing/tcp_fault_proxy.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <chrono>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "tests/testing/process.h"
#include "tests/testing/raw_socket.h"

namespace rigcal::testing::tcp_fault_proxy_test {
namespace {

using std::chrono::milliseconds;
using Direction = TcpFaultProxy::Direction;

// Sends back what it gets, on 127.0.0.1.
class EchoServer {
 public:
  EchoServer() : listener_(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof(address);
    EXPECT_EQ(bind(listener_, reinterpret_cast<sockaddr*>(&address), size), 0);
    EXPECT_EQ(listen(listener_, 16), 0);
    EXPECT_EQ(getsockname(listener_, reinterpret_cast<sockaddr*>(&address), &size), 0);
    port_ = ntohs(address.sin_port);
    thread_ = std::thread([this] { Run(); });
  }
  ~EchoServer() {
    shutdown(listener_, SHUT_RDWR);
    thread_.join();
    close(listener_);
  }
  int port() const { return port_; }

 private:
  void Run() {
    std::vector<std::jthread> threads;
    for (int peer = -1; (peer = accept(listener_, nullptr, nullptr)) >= 0;) {
      threads.emplace_back([peer] {
        std::array<char, 4096> buffer{};
        ssize_t got = 0;
        while ((got = recv(peer, buffer.data(), buffer.size(), 0)) > 0) {
          if (send(peer, buffer.data(), static_cast<size_t>(got), MSG_NOSIGNAL) < 0) break;
        }
        close(peer);
      });
    }
  }

  int listener_;
  int port_ = 0;
  std::thread thread_;
};

class TcpFaultProxyTest : public ::testing::Test {
 protected:
  // What comes back of `bytes`.
  static std::string Echo(const RawSocket& socket, const std::string& bytes) {
    std::jthread sender([&] { socket.Send(bytes); });
    std::string echo;
    while (echo.size() < bytes.size()) {
      const std::string more = socket.Receive();
      if (more.empty()) break;
      echo += more;
    }
    return echo;
  }
  template <typename Action>
  static milliseconds TimeOf(Action action) {
    const auto start = std::chrono::steady_clock::now();
    action();
    return std::chrono::duration_cast<milliseconds>(std::chrono::steady_clock::now() - start);
  }

  // The proxy goes before the server, which waits for its connections.
  EchoServer server_;
  TcpFaultProxy proxy_{server_.port()};
};

TEST_F(TcpFaultProxyTest, PassesEveryByteInOrder) {
  const RawSocket socket(proxy_.port());
  std::string bytes(3'000'000, '\0');
  for (size_t i = 0; i < bytes.size(); ++i) bytes[i] = static_cast<char>(i * 2654435761u >> 13);
  EXPECT_TRUE(Echo(socket, bytes) == bytes);
  EXPECT_EQ(proxy_.byte_count(Direction::kToServer), bytes.size());
  EXPECT_TRUE(WaitFor([&] { return proxy_.byte_count(Direction::kToClient) == bytes.size(); }));
  EXPECT_EQ(proxy_.attempt_count(), 1u);
}

TEST_F(TcpFaultProxyTest, DelaysEachDirection) {
  const RawSocket socket(proxy_.port());
  proxy_.Set({.latency = milliseconds(60)});
  std::string echo;
  EXPECT_GE(TimeOf([&] { echo = Echo(socket, "there and back"); }), milliseconds(120));
  EXPECT_EQ(echo, "there and back");
}

TEST_F(TcpFaultProxyTest, LimitsTheRate) {
  const RawSocket socket(proxy_.port());
  proxy_.Set(Direction::kToServer, {.bytes_per_s = 200'000});
  const std::string bytes(60'000, 'x');
  std::string echo;
  EXPECT_GE(TimeOf([&] { echo = Echo(socket, bytes); }), milliseconds(295));
  EXPECT_EQ(echo, bytes);
}

TEST_F(TcpFaultProxyTest, RepeatsWhatIsLost) {
  const RawSocket socket(proxy_.port());
  proxy_.Set(Direction::kToClient, {.loss = 1, .repetition = milliseconds(80)});
  std::string echo;
  EXPECT_GE(TimeOf([&] { echo = Echo(socket, "late"); }), milliseconds(80));
  EXPECT_EQ(echo, "late");
}

TEST_F(TcpFaultProxyTest, HoldsBackOneDirection) {
  const RawSocket socket(proxy_.port());
  EXPECT_EQ(Echo(socket, "a"), "a");
  proxy_.Set(Direction::kToClient, {.is_black_hole = true});
  socket.Send("bc");
  EXPECT_TRUE(WaitFor([&] { return proxy_.byte_count(Direction::kToServer) == 3; }));
  EXPECT_EQ(socket.Receive(milliseconds(100)), "");
  proxy_.Restore();
  EXPECT_EQ(socket.Receive(), "bc");

  proxy_.Set(Direction::kToServer, {.is_black_hole = true});
  socket.Send("d");
  EXPECT_EQ(socket.Receive(milliseconds(100)), "");
  EXPECT_EQ(proxy_.byte_count(Direction::kToServer), 3u);
  proxy_.Restore();
  EXPECT_EQ(socket.Receive(), "d");
}

TEST_F(TcpFaultProxyTest, HoldsBackTheEndOfAConnection) {
  auto server = std::make_unique<EchoServer>();
  TcpFaultProxy proxy(server->port());
  RawSocket socket(proxy.port());
  EXPECT_EQ(Echo(socket, "a"), "a");
  proxy.Set(Direction::kToServer, {.is_black_hole = true});
  socket.Close();
  std::atomic<bool> ended = false;
  std::jthread destroyer([&] {
    server.reset();  // waits for the end of its connection
    ended = true;
  });
  std::this_thread::sleep_for(milliseconds(100));
  EXPECT_FALSE(ended);
  proxy.Restore();
  EXPECT_TRUE(WaitFor([&] { return ended.load(); }));
}

TEST_F(TcpFaultProxyTest, ResetsWhatIsOpenAndWhatIsNew) {
  const RawSocket open(proxy_.port());
  EXPECT_EQ(Echo(open, "a"), "a");
  proxy_.Cut();
  EXPECT_TRUE(open.AwaitEnd());
  const RawSocket refused(proxy_.port());
  EXPECT_TRUE(refused.AwaitEnd());
  proxy_.Restore();
  const RawSocket again(proxy_.port());
  EXPECT_EQ(Echo(again, "b"), "b");
  EXPECT_EQ(proxy_.attempt_count(), 3u);
}

TEST_F(TcpFaultProxyTest, EndsAConnectionWithoutAServer) {
  int port = 0;
  {
    const EchoServer gone;
    port = gone.port();
  }
  TcpFaultProxy proxy(port);
  const RawSocket socket(proxy.port());
  EXPECT_TRUE(socket.AwaitEnd());
}

}  // namespace
}  // namespace rigcal::testing::tcp_fault_proxy_test
