// SPDX-License-Identifier: Apache-2.0
// A server killed during a capture is restarted on the same data, and the capture completes with
// every observation stored once and the result of an undisturbed one.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <random>
#include <set>
#include <string>
#include <thread>
#include <tuple>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "tests/integration/running_wave.h"
#include "tests/testing/process.h"
#include "tests/testing/recorded_data.h"
#include "tests/testing/server_client.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing::server_killed_test {
namespace {

namespace fs = std::filesystem;

// Each (camera, stream epoch, seq) is stored exactly once.
void ExpectStoredOnce(ServerClient& client, uint32_t expected) {
  const auto batches = client.ReadObservations("wave");
  ASSERT_THAT(batches, IsOk());
  std::set<std::tuple<std::string, uint32_t, uint32_t>> keys;
  uint32_t rows = 0;
  for (const ObservationBatch& batch : *batches) {
    for (uint32_t seq = batch.first_seq; seq < batch.end_seq(); ++seq, ++rows) {
      keys.emplace(batch.stream.camera, batch.stream.stream_epoch, seq);
    }
  }
  EXPECT_EQ(rows, expected);
  EXPECT_EQ(keys.size(), expected);
}

// Agents stream `sources`; the server is killed once `kill_at` observations are stored, several
// times.
void RunWithKills(const std::vector<std::string>& sources, uint32_t expected,
                  const std::vector<uint32_t>& kill_at) {
  const TemporaryDirectory directory;
  auto server = std::make_unique<ServerProcess>(directory.path() / "store");
  const int port = server->port();
  const std::string address = server->address();
  std::vector<std::unique_ptr<Process>> agents;
  for (size_t i = 0; i < sources.size(); ++i) {
    agents.push_back(std::make_unique<Process>(Process::Options{
        {"rigcal-agent", "--server", address, "--state-dir",
         (directory.path() / ("agent" + std::to_string(i))).string(), "--source", sources[i]},
        {}}));
  }
  ASSERT_TRUE(WaitFor([&] {
    const auto listed = ServerClient(address).ListAgents();
    return listed.ok() && listed->size() == sources.size();
  })) << agents[0]->StandardError();
  {
    ServerClient client(address);
    ASSERT_THAT(client.CreateSession(WandSession()), IsOk());
    ASSERT_THAT(client.StartSession("wave"), IsOk());
  }
  for (const uint32_t count : kill_at) {
    ASSERT_TRUE(WaitFor([&] { return StoredCount(address) >= count; }))
        << agents[0]->StandardError();
    // Where the machine is busy, the capture may have ended by now; nothing is lost then either.
    server->process().Signal(SIGKILL);
    server->process().Wait();
    server.reset();
    server = std::make_unique<ServerProcess>(directory.path() / "store", port);
  }
  ServerClient client(address);
  const auto finished = client.WaitUntilFinished("wave");
  ASSERT_THAT(finished, IsOk()) << agents[0]->StandardError();
  EXPECT_EQ(finished->observation_count(), expected);
  EXPECT_EQ(finished->late_count(), 0u);
  EXPECT_EQ(finished->missing_cameras_size(), 0);
  ExpectStoredOnce(client, expected);
  const auto calibration = client.Calibrate("wave");
  ASSERT_THAT(calibration, IsOk());
  EXPECT_EQ(calibration->state(), v1::Calibration::STATE_SUCCEEDED) << calibration->error();
}

TEST(ServerKilled, RealRecordingCompletesWithEveryRowStoredOnce) {
  RIGCAL_REQUIRE_RECORDED_DATA(data);
  std::vector<std::string> sources;
  for (int i = 0; i < 4; ++i) {
    sources.push_back("csv:" + (data / "ewand" / ("frame_" + std::to_string(i) + ".csv")).string() +
                      ";speed=5");
  }
  RunWithKills(sources, 2482, {600, 1500});
}

// RIGCAL_KILLS: how often the server is killed.
int KillCount() {
  const char* asked = std::getenv("RIGCAL_KILLS");
  return asked == nullptr ? 5 : std::max(1, std::atoi(asked));
}

// For each kind of store that this PC has.
std::vector<std::string> StoreKinds() {
  std::vector<std::string> kinds = {"sqlite"};
  if (PostgresCluster::Installed()) kinds.emplace_back("postgresql");
  return kinds;
}

class KilledAtRandom : public RunningWave, public ::testing::WithParamInterface<std::string> {
 protected:
  KilledAtRandom() : RunningWave(GetParam(), 200 + 40 * KillCount()) {}
};

TEST_P(KilledAtRandom, LosesNothingAndGivesTheSameResult) {
  Begin();
  std::mt19937 random(11);
  for (int kill = 0; kill < KillCount(); ++kill) {
    // At any point of starting, connecting, storing; now and then with some progress between.
    if (kill % 4 == 0) {
      const uint64_t before = StoredCount(server_->address());
      ASSERT_TRUE(WaitFor([&] { return StoredCount(server_->address()) > before; }))
          << agents_[0]->StandardError();
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(random() % 600));
    KillServer();
  }
  ExpectNothingLostAndTheSameResult();
  std::printf("%d kills, longest restart %.2f s\n", KillCount(), longest_restart_s_);
}

INSTANTIATE_TEST_SUITE_P(Stores, KilledAtRandom, ::testing::ValuesIn(StoreKinds()),
                         [](const auto& kind) { return kind.param; });

}  // namespace
}  // namespace rigcal::testing::server_killed_test
