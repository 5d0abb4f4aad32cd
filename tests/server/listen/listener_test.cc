// SPDX-License-Identifier: Apache-2.0
#include "server/listen/listener.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstring>
#include <fstream>
#include <iterator>
#include <memory>
#include <string>
#include <vector>

#include "server/listen/descriptor_limit.h"
#include "tests/testing/process.h"
#include "tests/testing/raw_socket.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing::listener_test {
namespace {

using server::Listener;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::SizeIs;

const std::string kTls("\x16\x03\x01", 3);
const std::string kHttp2 = "PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n";

class ListenerTest : public ::testing::Test {
 protected:
  void Open(server::ListenerOptions options = {}) {
    if (options.socket_file.empty()) options.address = "127.0.0.1:0";
    listener_ = std::make_unique<Listener>(options, &audit_);
    ASSERT_OK_AND_ASSIGN(port_, listener_->Bind());
  }
  // Answers with the kind of the connection, and keeps it open.
  void Start() {
    listener_->Start([this](Listener::Kind kind, int descriptor) {
      const char answer = kind == Listener::Kind::kTls ? 't' : 'p';
      const std::lock_guard lock(mutex_);
      taken_.push_back(descriptor);  // before the client knows
      send(descriptor, &answer, 1, MSG_NOSIGNAL);
    });
  }
  // As gRPC does at the end of a connection.
  void EndTaken() {
    const std::lock_guard lock(mutex_);
    for (const int descriptor : taken_) {
      shutdown(descriptor, SHUT_RDWR);
      close(descriptor);
    }
    taken_.clear();
  }
  void TearDown() override {
    listener_.reset();
    EndTaken();
  }
  uint32_t OpenCount() const { return listener_->connections().Stats().open; }
  std::string Audit() const {
    std::ifstream stream(directory_.path() / "audit.jsonl");
    return {std::istreambuf_iterator<char>(stream), {}};
  }

  TemporaryDirectory directory_;
  server::AuditLog audit_{directory_.path() / "audit.jsonl"};
  std::unique_ptr<Listener> listener_;
  int port_ = 0;
  std::mutex mutex_;
  std::vector<int> taken_;
};

TEST_F(ListenerTest, TheFirstByteSaysWhatAConnectionIs) {
  Open({.tls = true});
  Start();
  RawSocket plain(port_);
  plain.Send(kHttp2);
  EXPECT_EQ(plain.Receive(), "p");
  RawSocket tls(port_);
  tls.Send(kTls);
  EXPECT_EQ(tls.Receive(), "t");
  EXPECT_EQ(OpenCount(), 2u);
  EXPECT_EQ(listener_->connections().Stats().accepted, 2u);
}

TEST_F(ListenerTest, WhatIsNotForThisPortIsClosedWithALine) {
  Open({.tls = true, .plain_loopback = false});
  Start();
  RawSocket plain(port_);
  plain.Send(kHttp2);
  EXPECT_TRUE(plain.AwaitEnd());
  RawSocket http(port_);
  http.Send("GET / HTTP/1.1\r\n\r\n");
  EXPECT_TRUE(http.AwaitEnd());
  EXPECT_TRUE(WaitFor([&] { return listener_->connections().Stats().refused == 2; }));
  EXPECT_THAT(Audit(), AllOf(HasSubstr("connection_refused"), HasSubstr("127.0.0.1:"),
                             HasSubstr("it is not TLS")));
  EXPECT_THAT(taken_, IsEmpty());
}

TEST_F(ListenerTest, TlsOnAPortWithoutCertificatesIsClosed) {
  Open();
  Start();
  RawSocket tls(port_);
  tls.Send(kTls);
  EXPECT_TRUE(tls.AwaitEnd());
  EXPECT_TRUE(WaitFor([&] { return Audit().find("no certificates") != std::string::npos; }));
  EXPECT_EQ(OpenCount(), 0u);
}

TEST_F(ListenerTest, ASilentConnectionIsClosedInTime) {
  Open({.first_byte_timeout = std::chrono::milliseconds(50)});
  Start();
  const RawSocket silent(port_);
  EXPECT_TRUE(silent.AwaitEnd());
  EXPECT_TRUE(WaitFor([&] { return OpenCount() == 0; }));
  EXPECT_THAT(Audit(), HasSubstr("nothing in time"));
}

TEST_F(ListenerTest, OfTooManySilentOnesTheOldestGoes) {
  Open({.max_silent = 3});
  Start();
  std::vector<RawSocket> silent;
  for (int i = 0; i < 4; ++i) silent.emplace_back(port_);
  EXPECT_TRUE(silent[0].AwaitEnd());
  RawSocket good(port_);
  good.Send(kHttp2);
  EXPECT_EQ(good.Receive(), "p");
  EXPECT_TRUE(silent[1].AwaitEnd());
  silent[3].Send(kHttp2);
  EXPECT_EQ(silent[3].Receive(), "p");
}

TEST_F(ListenerTest, AnAddressHasALimitAndOthersStillGetIn) {
  Open({.limits = {.total = 100, .per_address = 2}});
  Start();
  std::vector<RawSocket> good;
  for (int i = 0; i < 2; ++i) {
    good.emplace_back(port_, "127.0.0.2");
    good.back().Send(kHttp2);
    EXPECT_EQ(good.back().Receive(), "p");
  }
  ::testing::internal::CaptureStdout();
  for (int i = 0; i < 3; ++i) {
    const RawSocket refused(port_, "127.0.0.2");
    refused.Send(kHttp2);
    EXPECT_TRUE(refused.AwaitEnd());
  }
  const std::string log = ::testing::internal::GetCapturedStdout();
  EXPECT_THAT(log, AllOf(HasSubstr("127.0.0.2"), HasSubstr("max_connections_per_address")));
  EXPECT_EQ(log.find("max_connections_per_address"), log.rfind("max_connections_per_address"))
      << "once: " << log;
  RawSocket other(port_, "127.0.0.3");
  other.Send(kHttp2);
  EXPECT_EQ(other.Receive(), "p");
  // Once one has gone, there is a place again.
  EndTaken();
  EXPECT_TRUE(WaitFor([&] { return OpenCount() == 0; }));
  RawSocket next(port_, "127.0.0.2");
  next.Send(kHttp2);
  EXPECT_EQ(next.Receive(), "p");
}

TEST_F(ListenerTest, InAllThereIsALimitAndSilentOnesMakeRoom) {
  Open({.limits = {.total = 3, .per_address = 3}});
  Start();
  const RawSocket silent(port_);
  std::vector<RawSocket> good;
  for (int i = 0; i < 3; ++i) {
    good.emplace_back(port_);
    good.back().Send(kHttp2);
    EXPECT_EQ(good.back().Receive(), "p") << i;
  }
  EXPECT_TRUE(silent.AwaitEnd());
  const RawSocket refused(port_);
  EXPECT_TRUE(refused.AwaitEnd());
  EXPECT_EQ(OpenCount(), 3u);
}

TEST_F(ListenerTest, ClientsThatGoAreNotCountedAnyMore) {
  Open();
  Start();
  for (int i = 0; i < 20; ++i) {
    RawSocket one(port_);
    if (i % 2 == 0) {
      one.Send(kHttp2);
      EXPECT_EQ(one.Receive(), "p");
    }
  }
  EXPECT_TRUE(WaitFor([&] { return OpenCount() == 0; }));
}

TEST_F(ListenerTest, CutsTheConnectionsOfAPeer) {
  Open({.tls = true});
  Start();
  RawSocket first(port_, "127.0.0.2");
  RawSocket second(port_, "127.0.0.3");
  for (RawSocket* one : {&first, &second}) {
    one->Send(kTls);
    EXPECT_EQ(one->Receive(), "t");
  }
  // Which port it has is not known here: both names are tried on all.
  const auto denied = [](const server::Peer& peer) { return peer.name == "pc1"; };
  EXPECT_THAT(listener_->connections().CutIf(denied), IsEmpty());
  sockaddr_in own{};
  socklen_t size = sizeof(own);
  {
    const std::lock_guard lock(mutex_);
    ASSERT_THAT(taken_, SizeIs(2));
    getpeername(taken_[0], reinterpret_cast<sockaddr*>(&own), &size);
  }
  const std::string address = "127.0.0.2:" + std::to_string(ntohs(own.sin_port));
  listener_->connections().SetPeer(address, {.has_certificate = true, .name = "pc1"});
  EXPECT_THAT(listener_->connections().CutIf(denied), SizeIs(1));
  EXPECT_TRUE(first.AwaitEnd());
  EXPECT_FALSE(second.AwaitEnd(std::chrono::milliseconds(50)));
  EXPECT_THAT(listener_->connections().CutIf(denied), IsEmpty()) << "once";
}

TEST_F(ListenerTest, ProbesSeeWhetherAnybodyAccepts) {
  Open({.probe_interval = std::chrono::hours(1), .probe_timeout = std::chrono::milliseconds(100)});
  EXPECT_FALSE(listener_->Probe()) << "the port is open, and nobody accepts";
  Start();
  EXPECT_TRUE(listener_->Probe());
  EXPECT_THAT(Audit(), Not(HasSubstr("connection_refused"))) << "probes are no clients";
}

TEST_F(ListenerTest, TheSocketFileIsPlainAndGoesWithTheServer) {
  const auto path = directory_.path() / "s";
  Open({.socket_file = path, .plain_loopback = false});
  Start();
  const int client = socket(AF_UNIX, SOCK_STREAM, 0);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::strcpy(address.sun_path, path.c_str());
  ASSERT_EQ(connect(client, reinterpret_cast<sockaddr*>(&address), sizeof(address)), 0);
  char answer = 0;
  EXPECT_EQ(recv(client, &answer, 1, 0), 1);
  EXPECT_EQ(answer, 'p');
  EXPECT_EQ(OpenCount(), 1u);
  listener_->Stop();
  EXPECT_FALSE(std::filesystem::exists(path));
  close(client);
}

// A listener in a process with few descriptors, which serves until `until` is closed.
[[noreturn]] void ServeWithFewDescriptors(int port_pipe, int until) {
  rlimit limit{.rlim_cur = 40, .rlim_max = 40};
  setrlimit(RLIMIT_NOFILE, &limit);
  server::AuditLog audit("");
  Listener listener({.address = "127.0.0.1:0", .limits = {.total = 1000, .per_address = 1000}},
                    &audit);
  const auto port = listener.Bind();
  if (!port.ok() || write(port_pipe, &*port, sizeof(*port)) != sizeof(*port)) _exit(1);
  std::mutex mutex;
  std::vector<int> taken;
  listener.Start([&](Listener::Kind, int descriptor) {
    send(descriptor, "k", 1, MSG_NOSIGNAL);
    const std::lock_guard lock(mutex);
    taken.push_back(descriptor);
  });
  fcntl(until, F_SETFL, O_NONBLOCK);
  char byte = 0;
  while (read(until, &byte, 1) != 0) {
    SleepBriefly();
    // As gRPC does when the other side has gone.
    const std::lock_guard lock(mutex);
    std::erase_if(taken, [](int descriptor) {
      char bytes[64];
      const ssize_t got = recv(descriptor, bytes, sizeof(bytes), MSG_DONTWAIT);
      return got == 0 && shutdown(descriptor, SHUT_RDWR) <= 0 && close(descriptor) == 0;
    });
  }
  _exit(0);
}

TEST(ListenerWithFewDescriptors, ServesAgainWhenTheyHaveRunOut) {
  int port_pipe[2];
  int until[2];
  ASSERT_EQ(pipe2(port_pipe, O_CLOEXEC), 0);
  ASSERT_EQ(pipe2(until, O_CLOEXEC), 0);
  const pid_t child = fork();
  if (child == 0) {
    close(until[1]);
    ServeWithFewDescriptors(port_pipe[1], until[0]);
  }
  int port = 0;
  ASSERT_EQ(read(port_pipe[0], &port, sizeof(port)), static_cast<ssize_t>(sizeof(port)));
  {
    // Silent ones make room for those that speak.
    std::vector<RawSocket> silent;
    for (int i = 0; i < 100; ++i) silent.emplace_back(port);
    EXPECT_TRUE(WaitFor([&] {
      const RawSocket good(port);
      good.Send(kHttp2);
      return good.Receive(std::chrono::seconds(1)) == "k";
    }));
  }
  {
    // Those that speak take all there are.
    std::vector<RawSocket> speaking;
    for (int i = 0; i < 100; ++i) {
      speaking.emplace_back(port);
      speaking.back().Send(kHttp2);
    }
    size_t served = 0;
    for (const RawSocket& socket : speaking) {
      if (socket.Receive() == "k") {
        ++served;
      } else {
        EXPECT_TRUE(socket.AwaitEnd()) << "it is told, and does not wait for ever";
      }
    }
    EXPECT_GT(served, 0u);
    EXPECT_LT(served, 20u);  // each takes two of the 40 descriptors
  }
  EXPECT_TRUE(WaitFor(
      [&] {
        const RawSocket good(port);
        good.Send(kHttp2);
        return good.Receive(std::chrono::seconds(1)) == "k";
      },
      std::chrono::seconds(10)));
  close(until[1]);
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_EQ(status, 0);
  for (const int end : {port_pipe[0], port_pipe[1], until[0]}) close(end);
}

}  // namespace
}  // namespace rigcal::testing::listener_test
