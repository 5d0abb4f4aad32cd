// SPDX-License-Identifier: Apache-2.0
// Three servers of one database take turns: the one that answers is killed, or stands still, during
// a capture, several times, and the capture completes with every observation stored once and the
// result of an undisturbed one.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <csignal>
#include <cstdio>
#include <string>

#include "tests/integration/running_wave.h"

namespace rigcal::testing::several_servers_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr int kKills = 3;

class SeveralServers : public RunningWave {
 protected:
  SeveralServers()
      : RunningWave(PostgresCluster::Installed() ? "postgresql" : "sqlite", 400,
                    PostgresCluster::Installed() ? 2 : 0) {}
  void SetUp() override {
    if (cluster_ == nullptr) {
      GTEST_SKIP() << "no PostgreSQL server in /usr/lib/postgresql: install the package postgresql";
    }
  }
  std::unique_ptr<ServerProcess>& ServerAt(const std::string& address) {
    for (auto& spare : spares_) {
      if (spare->address() == address) return spare;
    }
    return server_;
  }
  std::string FolderOf(const ServerProcess* server) const {
    for (size_t i = 0; i < spares_.size(); ++i) {
      if (spares_[i].get() == server) return absl::StrCat("store", i + 1);
    }
    return "store";
  }
  void ExpectMoreRows(uint64_t before) {
    const auto start = std::chrono::steady_clock::now();
    std::string active;
    ASSERT_TRUE(WaitFor([&] {
      active = Active();
      return StoredCount(active) > before;
    })) << agents_[0]->StandardError();
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
    std::printf("rows arrive again after %.2f s\n", took.count());
  }
};

TEST_F(SeveralServers, AnyOfThemMayBeKilled) {
  Begin();
  for (int kill = 0; kill < kKills; ++kill) {
    const std::string active = Active();
    const uint64_t before = StoredCount(active);
    ASSERT_TRUE(WaitFor([&] { return StoredCount(active) > before; }));
    std::unique_ptr<ServerProcess>& server = ServerAt(active);
    const std::string folder = FolderOf(server.get());
    const int port = server->port();
    const uint64_t stored = StoredCount(active);
    server->process().Signal(SIGKILL);
    server->process().Wait();
    ExpectMoreRows(stored);
    ASSERT_NE(Active(), active);
    server = StartServer(port, folder);
  }
  ExpectNothingLostAndTheSameResult();
}

TEST_F(SeveralServers, OneThatStandsStillIsReplacedAndWritesNothingMore) {
  Begin();
  const std::string first = Active();
  const uint64_t before = StoredCount(first);
  ASSERT_TRUE(WaitFor([&] { return StoredCount(first) > before; }));
  ServerProcess& still = *ServerAt(first);
  still.process().Signal(SIGSTOP);
  ASSERT_TRUE(WaitFor([&] {
    for (const auto& spare : spares_) {
      if (ServerClient(spare->address()).ListAgents().ok()) return true;
    }
    return false;
  })) << spares_[0]->process().StandardError();
  still.process().Signal(SIGCONT);
  ASSERT_TRUE(WaitFor([&] {
    return still.process().StandardError().find("waits for its turn again") != std::string::npos;
  })) << still.process().StandardError();
  EXPECT_TRUE(still.process().Running());
  ASSERT_TRUE(WaitFor([&] {
    const CommandResult listed =
        RunCommand({"rigcal", "server", "list", "--server", still.address()});
    return listed.exit_code == 0 && listed.output.find(still.address()) != std::string::npos;
  })) << "it sends clients to the one that answers";
  ExpectNothingLostAndTheSameResult();
}

TEST_F(SeveralServers, CommandsAskTheActiveOneAndAreToldWhoWaits) {
  std::string servers = server_->address();
  for (const auto& spare : spares_) servers = spare->address() + "," + servers;
  ASSERT_TRUE(WaitFor([&] {
    const CommandResult listed = RunCommand({"rigcal", "server", "list", "--server", servers});
    return listed.exit_code == 0 &&
           std::ranges::count(listed.output, '\n') == 1 + 1 + static_cast<int>(spares_.size());
  })) << RunCommand({"rigcal", "server", "list", "--server", servers}).output;
  const CommandResult listed = RunCommand({"rigcal", "server", "list", "--server", servers});
  EXPECT_THAT(listed.output, AllOf(HasSubstr("active  " + server_->address()),
                                   HasSubstr("waits   " + spares_[0]->address())));
  const CommandResult doctor = RunCommand({"rigcal", "doctor", "--server", servers});
  EXPECT_THAT(doctor.output, HasSubstr(server_->address()));
  // One of another certificate authority, or with another database, is not let in by mistake.
  const CommandResult copy = RunCommand({"rigcal-server", "store", "copy", store_arguments_.at(1),
                                         (directory_.path() / "copy").string()});
  EXPECT_NE(copy.exit_code, 0);
  EXPECT_THAT(copy.error, HasSubstr("in use by another rigcal-server"));
}

}  // namespace
}  // namespace rigcal::testing::several_servers_test
