// SPDX-License-Identifier: Apache-2.0
// Three servers of one database take turns: the one that answers is killed, or stands still, during
// a capture, several times, and the capture completes with every observation stored once and the
// result of an undisturbed one.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "tests/integration/running_wave.h"

namespace rigcal::testing::several_servers_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

// RIGCAL_KILLS, RIGCAL_AGENTS: how often a server is killed, and how many cameras there are.
class SeveralServers : public RunningWave {
 protected:
  SeveralServers()
      : RunningWave(PostgresCluster::Installed() ? "postgresql" : "sqlite", 400,
                    {.spare_count = PostgresCluster::Installed() ? 2 : 0,
                     .cameras = Asked("RIGCAL_AGENTS", 3)}) {}
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
    gaps_s_.push_back(took.count());
  }
  void PrintGaps() {
    if (gaps_s_.empty()) return;
    std::ranges::sort(gaps_s_);
    std::printf(
        "rows arrive again after %.2f s in the median of %zu kills, %.2f s in 95 %%, %.2f s "
        "at most\n",
        gaps_s_[gaps_s_.size() / 2], gaps_s_.size(), gaps_s_[gaps_s_.size() * 95 / 100],
        gaps_s_.back());
  }
  std::vector<double> gaps_s_;
};

TEST_F(SeveralServers, AnyOfThemMayBeKilled) {
  Begin();
  for (int kill = 0; kill < Asked("RIGCAL_KILLS", 3); ++kill) {
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
  PrintGaps();
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

// The rows in which servers say that they live, as after jumps of the database's clock.
TEST_F(SeveralServers, AClockOfTheDatabaseThatJumpsChangesNothing) {
  Begin();
  const std::string first = Active();
  for (const char* jump : {"+ interval '1 hour'", "- interval '1 hour'", "- interval '9 hours'"}) {
    SCOPED_TRACE(jump);
    cluster_->Sql("test_1", absl::StrCat("UPDATE server SET seen = seen ", jump));
    const uint64_t before = StoredCount(first);
    ASSERT_TRUE(WaitFor([&] { return StoredCount(first) > before + 100; }));
  }
  EXPECT_EQ(Active(), first);
  for (const auto& spare : spares_) {
    EXPECT_FALSE(ServerClient(spare->address()).ListAgents().ok()) << "a second one answers";
  }
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
  const std::filesystem::path config = directory_.path() / "retention.toml";
  std::ofstream(config) << "[retention]\nmax_size_mb = 100\n";
  const CommandResult refused =
      RunCommand({"rigcal-server", "--config", config.string(), "--data-dir",
                  (directory_.path() / "other").string(), "--store", store_arguments_.at(1)});
  EXPECT_NE(refused.exit_code, 0);
  EXPECT_THAT(refused.error, HasSubstr("use retention.max_age_days"));
  const CommandResult copy = RunCommand({"rigcal-server", "store", "copy", store_arguments_.at(1),
                                         (directory_.path() / "copy").string()});
  EXPECT_NE(copy.exit_code, 0);
  EXPECT_THAT(copy.error, HasSubstr("in use by another rigcal-server"));
}

}  // namespace
}  // namespace rigcal::testing::several_servers_test
