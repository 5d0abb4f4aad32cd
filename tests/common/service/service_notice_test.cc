// SPDX-License-Identifier: Apache-2.0
#include "common/service/service_notice.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <string>
#include <thread>

#include "tests/testing/temporary_directory.h"

namespace rigcal::service_notice_test {
namespace {

constexpr char kNothing[] = "(nothing)";

// Stands in for systemd: the datagram socket that services are told of.
class FakeServiceManager {
 public:
  FakeServiceManager() {
    const std::string file = (directory_.path() / "notify").string();
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    EXPECT_LT(file.size(), sizeof(address.sun_path));
    std::memcpy(address.sun_path, file.c_str(), file.size() + 1);
    socket_ = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    EXPECT_EQ(bind(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)), 0);
    setenv("NOTIFY_SOCKET", file.c_str(), 1);
  }
  ~FakeServiceManager() {
    for (const char* name : {"NOTIFY_SOCKET", "WATCHDOG_USEC", "WATCHDOG_PID"}) unsetenv(name);
    close(socket_);
  }

  void ExpectSignsOfLife(const std::string& every_us, pid_t from) {
    setenv("WATCHDOG_USEC", every_us.c_str(), 1);
    setenv("WATCHDOG_PID", std::to_string(from).c_str(), 1);
  }
  // The next message; a generous limit against hanging.
  std::string Receive() { return ReceiveWith(timeval{.tv_sec = 60, .tv_usec = 0}); }
  // A message that is there already: they are sent before the call returns.
  std::string ReceiveNow() { return ReceiveWith(timeval{.tv_sec = 0, .tv_usec = 1}); }

 private:
  std::string ReceiveWith(timeval limit) {
    setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof(limit));
    std::array<char, 512> text{};
    const ssize_t size = recv(socket_, text.data(), text.size(), 0);
    return size < 0 ? kNothing : std::string(text.data(), static_cast<size_t>(size));
  }

  testing::TemporaryDirectory directory_;
  int socket_ = -1;
};

// SIGUSR1, blocked in this thread and those that it starts.
sigset_t BlockedSignal() {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGUSR1);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  return signals;
}

TEST(ServiceNotice, SaysThatItIsReadyAndThatItStops) {
  FakeServiceManager manager;
  TellReady("listens on 127.0.0.1:7420");
  EXPECT_EQ(manager.ReceiveNow(), "READY=1\nSTATUS=listens on 127.0.0.1:7420");
  TellStopping();
  EXPECT_EQ(manager.ReceiveNow(), "STOPPING=1");
}

TEST(ServiceNotice, AStatusIsOneLineAndNoOtherMessage) {
  FakeServiceManager manager;
  TellReady("data in x\nSTOPPING=1");
  EXPECT_EQ(manager.ReceiveNow(), "READY=1\nSTATUS=data in x");
}

TEST(ServiceNotice, WithoutAServiceManagerNobodyIsTold) {
  FakeServiceManager manager;
  unsetenv("NOTIFY_SOCKET");
  TellReady("ready");
  TellStopping();
  EXPECT_EQ(manager.ReceiveNow(), kNothing);
}

TEST(ServiceNotice, AServiceManagerThatIsGoneDoesNotMatter) {
  setenv("NOTIFY_SOCKET", "/nowhere/notify", 1);
  TellReady("ready");
  setenv("NOTIFY_SOCKET", "no path", 1);
  TellReady("ready");
  unsetenv("NOTIFY_SOCKET");
}

TEST(ServiceNotice, SignsOfLifeComeUntilTheSignal) {
  const sigset_t signals = BlockedSignal();
  FakeServiceManager manager;
  manager.ExpectSignsOfLife("20000", getpid());
  std::atomic<int> proofs = 0;
  int seen = 0;
  std::thread supervisor([&] {
    while (seen < 3 && manager.Receive() == "WATCHDOG=1") ++seen;
    kill(getpid(), SIGUSR1);
  });
  EXPECT_EQ(WaitForSignal(signals, [&] { ++proofs; }), SIGUSR1);
  supervisor.join();
  EXPECT_EQ(seen, 3);
  EXPECT_GE(proofs, 3);
}

TEST(ServiceNotice, APartThatHangsStopsTheSignsOfLife) {
  const sigset_t signals = BlockedSignal();
  FakeServiceManager manager;
  manager.ExpectSignsOfLife("1000", getpid());
  std::atomic<bool> is_asked = false;
  std::atomic<bool> hangs = true;
  std::thread program([&] {
    WaitForSignal(signals, [&] {
      is_asked = true;
      is_asked.notify_all();
      hangs.wait(true);
    });
  });
  is_asked.wait(false);
  EXPECT_EQ(manager.ReceiveNow(), kNothing);
  hangs = false;
  hangs.notify_all();
  EXPECT_EQ(manager.Receive(), "WATCHDOG=1");
  kill(getpid(), SIGUSR1);
  program.join();
}

TEST(ServiceNotice, WithoutAWatchdogNobodyAsksForSignsOfLife) {
  const sigset_t signals = BlockedSignal();
  FakeServiceManager manager;
  kill(getpid(), SIGUSR1);
  EXPECT_EQ(WaitForSignal(signals, [] { ADD_FAILURE() << "asked for a sign of life"; }), SIGUSR1);
  EXPECT_EQ(manager.ReceiveNow(), kNothing);
}

TEST(ServiceNotice, AWatchdogOfAnotherProcessIsNotOurs) {
  const sigset_t signals = BlockedSignal();
  FakeServiceManager manager;
  manager.ExpectSignsOfLife("20000", getppid());
  kill(getpid(), SIGUSR1);
  EXPECT_EQ(WaitForSignal(signals, [] { ADD_FAILURE() << "asked for a sign of life"; }), SIGUSR1);
  EXPECT_EQ(manager.ReceiveNow(), kNothing);
}

}  // namespace
}  // namespace rigcal::service_notice_test
