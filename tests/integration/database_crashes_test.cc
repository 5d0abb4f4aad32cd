// SPDX-License-Identifier: Apache-2.0
// A server whose database is in PostgreSQL: that crashes during a capture, several times, and the
// capture completes with every observation stored once and the result of an undisturbed one.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <string>

#include "tests/integration/running_wave.h"

namespace rigcal::testing::database_crashes_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

// RIGCAL_CRASHES: how often it crashes, every second time by kill -9.
class DatabaseCrashes : public RunningWave {
 protected:
  DatabaseCrashes() : RunningWave(PostgresCluster::Installed() ? "postgresql" : "sqlite", 400) {}
  void SetUp() override {
    if (cluster_ == nullptr) {
      GTEST_SKIP() << "no PostgreSQL server in /usr/lib/postgresql: install the package postgresql";
    }
  }
};

TEST_F(DatabaseCrashes, LosesNothingAndGivesTheSameResult) {
  Begin();
  double longest_s = 0;
  for (int crash = 0; crash < Asked("RIGCAL_CRASHES", 3); ++crash) {
    const uint64_t before = StoredCount(server_->address());
    ASSERT_TRUE(WaitFor([&] { return StoredCount(server_->address()) > before; }))
        << server_->process().StandardError();
    if (crash % 2 == 1) {
      cluster_->Kill();
    } else {
      cluster_->StopAtOnce();
    }
    cluster_->Start();
    const auto start = std::chrono::steady_clock::now();
    const uint64_t stored = StoredCount(server_->address());
    ASSERT_TRUE(WaitFor([&] { return StoredCount(server_->address()) > stored; }))
        << server_->process().StandardError();
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
    longest_s = std::max(longest_s, took.count());
  }
  std::printf("rows arrive again %.2f s after PostgreSQL answers, at most\n", longest_s);
  EXPECT_TRUE(server_->process().Running());
  ExpectNothingLostAndTheSameResult();
}

TEST_F(DatabaseCrashes, CommandsOfItsCareSayWhoDoesIt) {
  const std::string& url = store_arguments_.at(1);
  const auto care = [&](std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "rigcal-server");
    arguments.insert(arguments.end(), {"--store", url});
    return RunCommand(arguments);
  };
  const CommandResult check = care({"check"});
  EXPECT_EQ(check.exit_code, 0) << check.error;
  EXPECT_THAT(check.output, HasSubstr("no faults"));
  EXPECT_THAT(care({"backup", "file"}).error, AllOf(HasSubstr("pg_dump"), HasSubstr("pgbackrest")));
  EXPECT_THAT(care({"restore", "file"}).error, HasSubstr("pg_restore"));
  EXPECT_THAT(care({"compact"}).error, HasSubstr("vacuumdb"));
  // The server runs on it.
  const CommandResult copy =
      RunCommand({"rigcal-server", "store", "copy", url, (directory_.path() / "copy").string()});
  EXPECT_NE(copy.exit_code, 0);
  EXPECT_THAT(copy.error, HasSubstr("in use by another rigcal-server"));
  const CommandResult unreachable =
      RunCommand({"rigcal-server", "--data-dir", (directory_.path() / "other").string(), "--store",
                  "postgresql://rigcal:secret@127.0.0.1:1/rigcal"});
  EXPECT_NE(unreachable.exit_code, 0);
  EXPECT_THAT(unreachable.error,
              AllOf(HasSubstr("rigcal@127.0.0.1:1/rigcal"), Not(HasSubstr("secret"))));
}

class DatabaseReplicated : public RunningWave {
 protected:
  DatabaseReplicated()
      : RunningWave(PostgresCluster::Installed() ? "replicated" : "sqlite", 400,
                    {.spare_count = PostgresCluster::Installed() ? 1 : 0}) {}
  void SetUp() override {
    if (cluster_ == nullptr) {
      GTEST_SKIP() << "no PostgreSQL server in /usr/lib/postgresql: install the package postgresql";
    }
  }
};

TEST_F(DatabaseReplicated, ASynchronousStandbyIsPromotedAndNothingIsLost) {
  Begin();
  const uint64_t before = StoredCount(Active());
  ASSERT_TRUE(WaitFor([&] { return StoredCount(Active()) > before; }))
      << server_->process().StandardError();
  ASSERT_EQ(cluster_->Sql("postgres", "SELECT sync_state FROM pg_stat_replication"), "sync");
  cluster_->StopAtOnce();
  standby_->Promote();
  ASSERT_TRUE(WaitFor([&] { return StoredCount(Active()) > before + 100; }))
      << server_->process().StandardError();
  ExpectNothingLostAndTheSameResult();
}

}  // namespace
}  // namespace rigcal::testing::database_crashes_test
