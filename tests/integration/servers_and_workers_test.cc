// SPDX-License-Identifier: Apache-2.0
// Three servers and two workers of one database, any of which is killed while a session is captured
// and the one before is solved: every observation is stored once, and each calibration is
// published once, with the bits of an undisturbed one.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <csignal>
#include <cstdio>
#include <functional>
#include <memory>
#include <mutex>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include "tests/integration/published_calibrations.h"
#include "tests/integration/running_wave.h"

namespace rigcal::testing::servers_and_workers_test {
namespace {

constexpr int kSpares = 2;
constexpr size_t kServers = kSpares + 1;
constexpr size_t kWorkers = 2;
// A lease and what follows it, several times, on a PC that does much else.
constexpr std::chrono::seconds kLimit{200};

// Longer and larger by RIGCAL_KILL_SECONDS (a kill every 5 s for so long), RIGCAL_AGENTS,
// RIGCAL_SPEED (times 50 Hz) and RIGCAL_ROWS (of a camera in a session).
class ServersAndWorkers : public RunningWave {
 protected:
  ServersAndWorkers()
      : RunningWave(PostgresCluster::Installed() ? "postgresql" : "sqlite", 400,
                    {.spare_count = PostgresCluster::Installed() ? kSpares : 0,
                     .cameras = Asked("RIGCAL_AGENTS", 4),
                     .speed = Asked("RIGCAL_SPEED", 4),
                     .server_arguments = PostgresCluster::Installed()
                                             ? std::vector<std::string>{"--no-solve"}
                                             : std::vector<std::string>()}) {}

  const int rows_per_camera_ = Asked("RIGCAL_ROWS", 400);  // of a session

  void SetUp() override {
    if (cluster_ == nullptr) {
      GTEST_SKIP() << "no PostgreSQL server in /usr/lib/postgresql: install the package postgresql";
    }
    addresses_.push_back(server_->address());
    pids_.push_back(server_->process().pid());
    for (const auto& spare : spares_) {
      addresses_.push_back(spare->address());
      pids_.push_back(spare->process().pid());
    }
    published_ = std::make_unique<PublishedCalibrations>(cluster_.get(), "test_1");
    workers_.resize(kWorkers);
    pids_.resize(kServers + kWorkers);
    for (size_t i = 0; i < kWorkers; ++i) StartWorker(i);
  }
  void TearDown() override { StopKilling(); }

  void StartWorker(size_t i) {
    workers_[i] = std::make_unique<Process>(
        Process::Options{{"rigcal-worker", "--store", store_arguments_.at(1), "--scratch-dir",
                          directory_.path().string()},
                         {}});
    const std::lock_guard lock(mutex_);
    pids_[kServers + i] = workers_[i]->pid();
  }

  // What was killed starts again. In the thread of the test, as programs end with the thread that
  // started them.
  void StartKilledOnes() {
    for (size_t i = 0; i < kServers; ++i) {
      std::unique_ptr<ServerProcess>& server = i == 0 ? server_ : spares_[i - 1];
      if (server->process().Running()) continue;
      const int port = server->port();
      server = StartServer(port, i == 0 ? "store" : absl::StrCat("store", i));
      const std::lock_guard lock(mutex_);
      pids_[i] = server->process().pid();
    }
    for (size_t i = 0; i < kWorkers; ++i) {
      if (!workers_[i]->Running()) StartWorker(i);
    }
  }

  // Asks some times a second, as a person or a page does.
  template <typename Condition>
  bool Until(Condition condition) {
    return WaitFor(
        [&] {
          StartKilledOnes();
          if (condition()) return true;
          std::this_thread::sleep_for(std::chrono::milliseconds(100));
          return false;
        },
        kLimit);
  }

  // Any server that answers, until one says yes.
  bool OfAny(const std::function<bool(ServerClient&)>& ask) {
    return Until([&] {
      return std::ranges::any_of(addresses_, [&](const std::string& address) {
        ServerClient client(address);
        return ask(client);
      });
    });
  }

  // Counts of the session as a server that answers has them; 0: none does.
  uint64_t RowsOf(const std::string& session) const {
    for (const std::string& address : addresses_) {
      const auto got = ServerClient(address).GetSession(session);
      if (got.ok()) return got->observation_count();
    }
    return 0;
  }

  void StartKilling(std::chrono::seconds duration) {
    killer_ = std::thread([this, duration] { KillAgainAndAgain(duration); });
  }
  void StopKilling() {
    {
      const std::lock_guard lock(mutex_);
      stopping_ = true;
      changed_.notify_all();
    }
    if (killer_.joinable()) killer_.join();
  }

  void KillAgainAndAgain(std::chrono::seconds duration) {
    std::mt19937 random(7);
    const auto end = std::chrono::steady_clock::now() + duration;
    auto next = std::chrono::steady_clock::now();
    while ((next += std::chrono::seconds(5)) <= end) {
      std::string session;
      pid_t victim = 0;
      const size_t index = random() % (kServers + kWorkers);
      {
        std::unique_lock lock(mutex_);
        if (changed_.wait_until(lock, next, [this] { return stopping_; })) return;
        session = capturing_;
        victim = pids_[index];
      }
      const bool is_server = index < kServers;
      const bool is_active =
          is_server && !session.empty() && ServerClient(addresses_[index]).GetSession(session).ok();
      const bool solves =
          !is_server &&
          !ProcessesWith(absl::StrCat("--parent=", victim) + std::string(1, '\0')).empty();
      kill(victim, SIGKILL);
      ++(is_active   ? active_kills_
         : is_server ? waiting_kills_
         : solves    ? solve_kills_
                     : idle_kills_);
      if (is_active) MeasureGap(session);
    }
    finished_ = true;
  }

  // From a kill until rows arrive at another server; nothing where the capture ends before.
  void MeasureGap(const std::string& session) {
    const auto start = std::chrono::steady_clock::now();
    uint64_t first = 0;
    const bool arrived = WaitFor([&] {
      const uint64_t rows = RowsOf(session);
      if (first == 0) first = rows;
      if (first != 0 && rows > first) return true;
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
      const std::lock_guard lock(mutex_);
      return capturing_ != session || stopping_;
    });
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
    const std::lock_guard lock(mutex_);
    if (capturing_ == session || !arrived) gaps_s_.push_back(took.count());
  }

  void SetCapturing(const std::string& session) {
    const std::lock_guard lock(mutex_);
    capturing_ = session;
  }

  // Creates a session, captures it, and queues its calibration. Commands that meet a takeover are
  // given again, as a person does.
  void CaptureAndQueue(const std::string& id) {
    ASSERT_TRUE(OfAny([&](ServerClient& client) {
      const absl::Status created = client.CreateSession(WandSession(id)).status();
      return created.ok() || absl::IsAlreadyExists(created);
    }));
    absl::Status started;
    ASSERT_TRUE(OfAny([&](ServerClient& client) {
      started = client.StartSession(id).status();
      const auto session = client.GetSession(id);
      return session.ok() && session->state() != v1::Session::STATE_CREATED;
    })) << started;
    SetCapturing(id);
    const uint64_t enough =
        static_cast<uint64_t>(rows_per_camera_) * static_cast<uint64_t>(camera_count_);
    ASSERT_TRUE(Until([&] { return RowsOf(id) >= enough; })) << agents_[0]->StandardError();
    SetCapturing("");
    absl::Status stopped;
    ASSERT_TRUE(OfAny([&](ServerClient& client) {
      stopped = client.StopSession(id, 60).status();
      const auto session = client.GetSession(id);
      return session.ok() && session->state() != v1::Session::STATE_CAPTURING;
    })) << stopped;
    ASSERT_TRUE(OfAny([&](ServerClient& client) {
      const auto session = client.GetSession(id);
      return session.ok() && session->state() == v1::Session::STATE_FINISHED;
    })) << agents_[0]->StandardError();
    Queue(id);
  }

  // Whose answer is lost may have been queued.
  void Queue(const std::string& session) {
    absl::Status queued;
    ASSERT_TRUE(OfAny([&](ServerClient& client) {
      const auto before = client.ListCalibrations(session);
      if (!before.ok()) return false;
      const bool waits_or_worked = std::ranges::any_of(*before, [](const v1::Calibration& one) {
        return one.state() != v1::Calibration::STATE_FAILED;
      });
      if (waits_or_worked) return true;
      queued = client.CreateCalibration(session).status();
      return queued.ok();
    })) << queued;
  }

  // The session's calibration that has succeeded. One whose solver was killed three times has
  // failed, as documented, and is made again.
  std::string Succeeded(const std::string& session) {
    std::string id;
    EXPECT_TRUE(Until([&] {
      std::vector<v1::Calibration> made;
      for (const std::string& address : addresses_) {
        auto listed = ServerClient(address).ListCalibrations(session);
        if (listed.ok()) made = *std::move(listed);
      }
      if (made.empty()) return false;
      if (made.back().state() == v1::Calibration::STATE_FAILED) {
        EXPECT_NE(made.back().error().find("ended 3 times while it did"), std::string::npos)
            << made.back().error();
        ++given_up_;
        Queue(session);
      }
      id = made.back().id();
      return made.back().state() == v1::Calibration::STATE_SUCCEEDED;
    })) << session
        << " is not solved; " << workers_[0]->StandardError();
    return id;
  }

  void ExpectStoredOnceAndTheSameBits(const std::string& session, const std::string& calibration) {
    SCOPED_TRACE(session);
    ServerClient client(Active());
    const auto finished = client.GetSession(session);
    ASSERT_THAT(finished, IsOk());
    EXPECT_EQ(finished->missing_cameras_size(), 0);
    EXPECT_EQ(finished->late_count(), 0u);
    EXPECT_EQ(finished->cameras_size(), camera_count_);
    const auto batches = client.ReadObservations(session);
    ASSERT_THAT(batches, IsOk());
    const auto world = SimulatedWorld::Create(options_, target_);
    ASSERT_THAT(world, IsOk());
    ExpectSimulatedRows(*world, *batches, *finished);
    uint64_t rows = 0;
    for (const ObservationBatch& batch : *batches) rows += batch.rows();
    EXPECT_EQ(rows, finished->observation_count());
    rows_ += rows;
    const auto solved = client.GetCalibration(calibration);
    ASSERT_THAT(solved, IsOk());
    EXPECT_TRUE(ComparableBytes(*solved) == UndisturbedCalibration(*batches, *finished))
        << "another calibration came out";
  }

  std::unique_ptr<PublishedCalibrations> published_;
  std::vector<std::string> addresses_;  // of servers
  std::vector<std::unique_ptr<Process>> workers_;
  std::thread killer_;
  std::atomic<bool> finished_ = false;  // with killing
  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<pid_t> pids_;  // of servers, then of workers
  std::string capturing_;    // the session; empty: none is
  std::vector<double> gaps_s_;
  bool stopping_ = false;
  std::atomic<int> active_kills_ = 0;
  std::atomic<int> waiting_kills_ = 0;
  std::atomic<int> solve_kills_ = 0;
  std::atomic<int> idle_kills_ = 0;
  int given_up_ = 0;
  uint64_t rows_ = 0;
};

TEST_F(ServersAndWorkers, AnyOfThemIsKilledDuringWavesAndSolves) {
  ASSERT_TRUE(WaitFor([&] {
    const auto listed = ServerClient(server_->address()).ListAgents();
    return listed.ok() && listed->size() == static_cast<size_t>(camera_count_);
  })) << agents_[0]->StandardError();
  StartKilling(std::chrono::seconds(Asked("RIGCAL_KILL_SECONDS", 25)));
  std::vector<std::string> sessions;
  while (!finished_) {
    sessions.push_back(absl::StrCat("wave-", sessions.size() + 1));
    ASSERT_NO_FATAL_FAILURE(CaptureAndQueue(sessions.back()));
  }
  StopKilling();
  std::vector<std::string> calibrations;
  for (const std::string& session : sessions) calibrations.push_back(Succeeded(session));
  published_->ExpectEachOnce();
  for (size_t i = 0; i < sessions.size(); ++i) {
    ASSERT_NO_FATAL_FAILURE(ExpectStoredOnceAndTheSameBits(sessions[i], calibrations[i]));
  }
  std::printf(
      "%zu sessions of %d cameras, %llu rows; killed: %d times the server that answered during a "
      "capture, %d times another server, %d workers that solved, %d that did not; %d calibrations "
      "made again after three kills\n",
      sessions.size(), camera_count_, static_cast<unsigned long long>(rows_), active_kills_.load(),
      waiting_kills_.load(), solve_kills_.load(), idle_kills_.load(), given_up_);
  if (gaps_s_.empty()) return;
  std::ranges::sort(gaps_s_);
  std::printf("rows arrive again after %.2f s in the median, %.2f s in 95 %%, %.2f s at most\n",
              gaps_s_[gaps_s_.size() / 2], gaps_s_[gaps_s_.size() * 95 / 100], gaps_s_.back());
  EXPECT_LT(gaps_s_.back(), 30) << "a generous limit against hanging";
}

}  // namespace
}  // namespace rigcal::testing::servers_and_workers_test
