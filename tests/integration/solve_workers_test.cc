// SPDX-License-Identifier: Apache-2.0
// Solves by rigcal-workers, from the database of a server that does not solve: whatever is killed,
// stopped or started again meanwhile, each calibration ends once, with the bits of an undisturbed
// one.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "tests/integration/published_calibrations.h"
#include "tests/integration/running_wave.h"
#include "tests/testing/postgres_cluster.h"
#include "tests/testing/process.h"
#include "tests/testing/server_client.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing::solve_workers_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

// Longer than a lease and what follows it.
constexpr std::chrono::seconds kLimit{100};

class SolveWorkers : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!PostgresCluster::Installed()) {
      GTEST_SKIP() << "no PostgreSQL server in /usr/lib/postgresql: install the package postgresql";
    }
    cluster_ = std::make_unique<PostgresCluster>(PostgresCluster::Options{});
    url_ = cluster_->Url(cluster_->CreateDatabase());
    StartServer(0);
    Process::Options options{{"rigcal-agent", "--server", server_->address(), "--state-dir",
                              (directory_.path() / "agent").string()},
                             {}};
    for (int i = 0; i < 4; ++i) {
      options.arguments.insert(
          options.arguments.end(),
          {"--source", absl::StrCat("sim:camera=", i, ";cameras=4;duration=60;speed=30")});
    }
    agent_ = std::make_unique<Process>(std::move(options));
    ASSERT_TRUE(WaitFor([&] {
      const auto listed = ServerClient(server_->address()).ListAgents();
      return listed.ok() && listed->size() == 1;
    })) << agent_->StandardError();
    const CommandResult created =
        Rigcal({"session", "create", "--target", "wand:0,0.13,0.39", "--id", "wave", "--start"});
    ASSERT_EQ(created.exit_code, 0) << created.error;
    ASSERT_THAT(ServerClient(server_->address()).WaitUntilFinished("wave"), IsOk());
  }
  void TearDown() override {
    if (HasFailure()) {
      for (const auto& worker : workers_) ADD_FAILURE() << worker->StandardError();
      ADD_FAILURE() << server_->process().StandardError();
    }
  }

  void StartServer(int port) {
    server_ = std::make_unique<ServerProcess>(
        directory_.path() / "store", port, std::map<std::string, std::string>{},
        std::vector<std::string>{"--store", url_, "--no-solve"});
  }
  void StartWorker() {
    workers_.push_back(std::make_unique<Process>(Process::Options{
        {"rigcal-worker", "--store", url_, "--scratch-dir", directory_.path().string()}, {}}));
  }
  CommandResult Rigcal(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "rigcal");
    arguments.insert(arguments.end(), {"--server", server_->address()});
    return RunCommand(arguments);
  }
  nlohmann::json Get(const std::string& id) {
    const CommandResult got = Rigcal({"calibration", "get", id, "-o", "json"});
    auto json = nlohmann::json::parse(got.output, nullptr, false);
    return json.is_object() ? json : nlohmann::json::object();
  }
  std::string State(const std::string& id) { return Get(id).value("state", ""); }
  std::string SolvedBy(const std::string& id) {
    const nlohmann::json json = Get(id);
    return json.contains("progress") ? json["progress"].value("solved_by", "") : "";
  }
  // What two calibrations of the same rows have in common.
  std::string Comparable(const std::string& id) {
    nlohmann::json json = Get(id);
    for (const char* own : {"id", "version", "run", "progress"}) json.erase(own);
    EXPECT_EQ(json.value("state", ""), "STATE_SUCCEEDED") << json.value("error", "");
    return json.dump();
  }
  void ExpectSucceeds(const std::string& id) {
    EXPECT_TRUE(WaitFor([&] { return State(id) == "STATE_SUCCEEDED"; }, kLimit)) << Get(id).dump();
  }
  void Create(const std::string& id) {
    const CommandResult created = Rigcal({"calibrate", "wave"});
    ASSERT_EQ(created.exit_code, 0) << created.error;
    ASSERT_THAT(created.output + created.error, HasSubstr(id));
  }
  // Stops the solve that one of the workers has begun; which one.
  Process* HoldSolve() {
    Process* holder = nullptr;
    EXPECT_TRUE(WaitFor([&] {
      for (const auto& worker : workers_) {
        const auto solves =
            ProcessesWith(absl::StrCat("--parent=", worker->pid()) + std::string(1, '\0'));
        if (solves.empty()) continue;
        solve_ = solves.front();
        holder = kill(solve_, SIGSTOP) == 0 ? worker.get() : nullptr;
        return holder != nullptr;
      }
      return false;
    })) << "nobody solves";
    return holder;
  }
  void ReleaseSolve() { EXPECT_EQ(kill(solve_, SIGCONT), 0); }

  TemporaryDirectory directory_;
  std::unique_ptr<PostgresCluster> cluster_;
  std::string url_;
  std::unique_ptr<ServerProcess> server_;
  std::unique_ptr<Process> agent_;
  std::vector<std::unique_ptr<Process>> workers_;
  pid_t solve_ = 0;  // the process that HoldSolve has stopped
};

TEST_F(SolveWorkers, OneIsKilledOrStopsAndTheOtherEndsWhatItHad) {
  StartWorker();
  StartWorker();
  Create("c-000001");
  ExpectSucceeds("c-000001");
  const std::string undisturbed = Comparable("c-000001");

  Create("c-000002");
  Process* holder = HoldSolve();
  ASSERT_NE(holder, nullptr);
  EXPECT_TRUE(WaitFor([&] {
    return SolvedBy("c-000002").find(absl::StrCat("(process ", holder->pid(), ")")) !=
           std::string::npos;
  }));
  EXPECT_TRUE(WaitFor([&] {
    return Rigcal({"worker", "list"}).output.find("c-000002") != std::string::npos;
  })) << Rigcal({"worker", "list"}).output;
  EXPECT_NE(Rigcal({"session", "delete", "wave", "--yes"}).exit_code, 0) << "it is being read";
  holder->Signal(SIGKILL);
  ExpectSucceeds("c-000002");
  EXPECT_EQ(Comparable("c-000002"), undisturbed);

  StartWorker();
  Create("c-000003");
  holder = HoldSolve();
  ASSERT_NE(holder, nullptr);
  holder->Signal(SIGSTOP);
  ExpectSucceeds("c-000003");
  const nlohmann::json published = Get("c-000003");
  ReleaseSolve();
  holder->Signal(SIGCONT);
  EXPECT_TRUE(WaitFor([&] {
    return holder->StandardError().find("nothing of this solve is stored") != std::string::npos;
  })) << holder->StandardError();
  EXPECT_EQ(Get("c-000003"), published) << "it was published once more";
  EXPECT_EQ(Comparable("c-000003"), undisturbed);
  EXPECT_EQ(Rigcal({"session", "delete", "wave", "--yes"}).exit_code, 0) << "nobody reads it";
}

TEST_F(SolveWorkers, ACancelReachesTheWorkerAndAStopGivesBack) {
  StartWorker();
  Create("c-000001");
  ASSERT_NE(HoldSolve(), nullptr);
  EXPECT_EQ(Rigcal({"calibration", "cancel", "c-000001"}).exit_code, 0);
  ASSERT_TRUE(WaitFor([&] { return State("c-000001") == "STATE_CANCELLED"; }, kLimit));
  EXPECT_EQ(Get("c-000001").value("error", ""), "cancelled");

  Create("c-000002");
  ASSERT_NE(HoldSolve(), nullptr);
  const auto start = std::chrono::steady_clock::now();
  workers_[0]->Signal(SIGTERM);
  EXPECT_EQ(workers_[0]->Wait(), 0) << workers_[0]->StandardError();
  EXPECT_THAT(workers_[0]->StandardError(), HasSubstr("c-000002: given back"));
  EXPECT_TRUE(WaitFor([&] { return State("c-000002") == "STATE_QUEUED"; }))
      << std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count() << " s";
  // It waits, and says why.
  EXPECT_TRUE(WaitFor([&] {
    return Rigcal({"calibration", "get", "c-000002", "-o", "json"})
               .output.find("no rigcal-worker runs") != std::string::npos;
  }));
  StartWorker();
  ExpectSucceeds("c-000002");
}

// RIGCAL_DATABASE_AWAY_SECONDS: how long the database is away at least; a lease is 10 s.
TEST_F(SolveWorkers, ServerAndDatabaseStartAgainDuringASolve) {
  const PublishedCalibrations published(cluster_.get(), url_.substr(url_.rfind('/') + 1));
  StartWorker();
  Create("c-000001");
  ExpectSucceeds("c-000001");
  const std::string undisturbed = Comparable("c-000001");

  Create("c-000002");
  ASSERT_NE(HoldSolve(), nullptr);
  server_->process().Signal(SIGKILL);
  server_->process().Wait();
  StartServer(0);
  EXPECT_TRUE(WaitFor([&] {
    return SolvedBy("c-000002").find(absl::StrCat("(process ", workers_[0]->pid(), ")")) !=
           std::string::npos;
  })) << Get("c-000002").dump();
  EXPECT_NE(Rigcal({"session", "delete", "wave", "--yes"}).exit_code, 0) << "it is being read";
  ReleaseSolve();
  ExpectSucceeds("c-000002");
  EXPECT_EQ(Comparable("c-000002"), undisturbed);

  // Two workers, as the lease ends meanwhile and the other one may claim it.
  StartWorker();
  Create("c-000003");
  ASSERT_NE(HoldSolve(), nullptr);
  cluster_->StopAtOnce();
  ReleaseSolve();
  // The end of the solve waits for the database.
  EXPECT_TRUE(WaitFor(
      [&] {
        return std::ranges::any_of(workers_, [](const auto& worker) {
          return worker->StandardError().find("its end waits for the store") != std::string::npos;
        });
      },
      kLimit))
      << workers_[0]->StandardError();
  const auto back = std::chrono::steady_clock::now() +
                    std::chrono::seconds(Asked("RIGCAL_DATABASE_AWAY_SECONDS", 12));
  WaitFor([&] { return std::chrono::steady_clock::now() > back; }, kLimit);
  cluster_->Start();
  ExpectSucceeds("c-000003");
  EXPECT_EQ(Comparable("c-000003"), undisturbed);
  EXPECT_TRUE(workers_[0]->Running());
  EXPECT_TRUE(workers_[1]->Running());
  published.ExpectEachOnce();
}

// A lease that has ended early, or ends late, as after a jump of the database's clock.
TEST_F(SolveWorkers, AClockOfTheDatabaseThatJumpsPublishesNothingTwice) {
  const std::string database = url_.substr(url_.rfind('/') + 1);
  const PublishedCalibrations published(cluster_.get(), database);
  StartWorker();
  StartWorker();
  Create("c-000001");
  ExpectSucceeds("c-000001");
  const std::string undisturbed = Comparable("c-000001");
  int number = 1;
  for (const char* jump : {"- 3600000", "+ 3600000"}) {
    SCOPED_TRACE(jump);
    const std::string id = absl::StrCat("c-00000", ++number);
    Create(id);
    Process* const holder = HoldSolve();
    ASSERT_NE(holder, nullptr);
    const pid_t held = solve_;
    // It gives no sign of life that would set the lease right.
    holder->Signal(SIGSTOP);
    cluster_->Sql(database, absl::StrCat("UPDATE calibration_job SET lease_end_ms = lease_end_ms ",
                                         jump, " WHERE state = 2"));
    // The other one ends it before the lease would have.
    ExpectSucceeds(id);
    const nlohmann::json first = Get(id);
    ASSERT_EQ(kill(held, SIGCONT), 0);
    holder->Signal(SIGCONT);
    EXPECT_TRUE(WaitFor([&] {
      return holder->StandardError().find(absl::StrCat(id, " was claimed by another process")) !=
             std::string::npos;
    })) << holder->StandardError();
    EXPECT_EQ(Get(id), first);
    EXPECT_EQ(Comparable(id), undisturbed);
    EXPECT_TRUE(WaitFor([&] {
      return ProcessesWith(absl::StrCat("--parent=", holder->pid()) + std::string(1, '\0')).empty();
    })) << "the solve that was refused goes on";
  }
  published.ExpectEachOnce();
}

TEST_F(SolveWorkers, RefusesWhatItCannotShare) {
  const CommandResult sqlite =
      RunCommand({"rigcal-worker", "--store", (directory_.path() / "store").string()});
  EXPECT_EQ(sqlite.exit_code, 1);
  EXPECT_THAT(sqlite.error, AllOf(HasSubstr("SQLite"), HasSubstr("a file of one PC")));
  const CommandResult alone =
      RunCommand({"rigcal-server", "--data-dir", (directory_.path() / "alone").string(),
                  "--no-solve", "--listen", "127.0.0.1:0"});
  EXPECT_EQ(alone.exit_code, 1);
  EXPECT_THAT(alone.error, HasSubstr("nobody else can"));
  const std::string database = cluster_->CreateDatabase();
  const CommandResult empty = RunCommand({"rigcal-worker", "--store", cluster_->Url(database)});
  EXPECT_EQ(empty.exit_code, 1);
  EXPECT_THAT(empty.error, HasSubstr("is empty"));
  cluster_->Sql(url_.substr(url_.rfind('/') + 1), "UPDATE rigcal_schema SET version=version+1");
  const CommandResult newer = RunCommand({"rigcal-worker", "--store", url_});
  EXPECT_EQ(newer.exit_code, 1);
  EXPECT_THAT(newer.error, AllOf(HasSubstr("schema version"), HasSubstr("one release")));
}

}  // namespace
}  // namespace rigcal::testing::solve_workers_test
