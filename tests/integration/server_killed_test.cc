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
#include "common/simulation/world/simulated_world.h"
#include "common/wire/camera_wire.h"
#include "tests/testing/process.h"
#include "tests/testing/recorded_data.h"
#include "tests/testing/server_client.h"
#include "tests/testing/simulated_rows.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing::server_killed_test {
namespace {

namespace fs = std::filesystem;

v1::CreateSessionRequest WandSession() {
  Target target;
  target.marker_positions_m = {0, 0.13, 0.39};
  v1::CreateSessionRequest request;
  request.set_id("wave");
  *request.mutable_target() = wire::ToProto(target);
  return request;
}

uint64_t StoredCount(const std::string& address) {
  const auto session = ServerClient(address).GetSession("wave");
  return session.ok() ? session->observation_count() : 0;
}

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

// Agents that capture for as long as it takes, and a server that is killed at random instants.
class KilledAtRandom : public ::testing::Test {
 protected:
  static constexpr int kCameras = 3;

  KilledAtRandom() {
    options_.camera_count = kCameras;
    options_.duration_s = 200 + 40 * KillCount();  // far more than is captured
    for (int i = 0; i < kCameras; ++i) {
      agents_.push_back(std::make_unique<Process>(Process::Options{
          {"rigcal-agent", "--server", server_->address(), "--state-dir",
           (directory_.path() / ("agent" + std::to_string(i))).string(), "--source",
           absl::StrCat("sim:camera=", i, ";cameras=", kCameras, ";duration=", options_.duration_s,
                        ";speed=8")},
          {}}));
    }
  }

  void KillServer() {
    server_->process().Signal(SIGKILL);
    server_->process().Wait();
    const int port = server_->port();
    server_.reset();
    const auto start = std::chrono::steady_clock::now();
    server_ = std::make_unique<ServerProcess>(directory_.path() / "store", port);
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
    longest_restart_s_ = std::max(longest_restart_s_, took.count());
  }

  // The same rows, delivered to a server that nobody kills.
  std::string UndisturbedCalibration(const std::vector<ObservationBatch>& batches,
                                     const v1::Session& session) {
    const ServerProcess server(directory_.path() / "undisturbed");
    ServerClient client(server.address());
    v1::CreateSessionRequest request = WandSession();
    for (const v1::SessionCamera& camera : session.cameras()) {
      *request.add_cameras() = camera.description();
    }
    EXPECT_THAT(client.CreateSession(request), IsOk());
    EXPECT_THAT(client.StartSession("wave"), IsOk());
    for (const ObservationBatch& batch : batches) EXPECT_THAT(client.Upload(batch), IsOk());
    for (const v1::SessionCamera& camera : session.cameras()) {
      EXPECT_THAT(client.UploadEnd("wave", camera.description().camera(),
                                   camera.streams(0).stream_epoch(), camera.streams(0).last_seq()),
                  IsOk());
    }
    EXPECT_THAT(client.WaitUntilFinished("wave"), IsOk());
    const auto calibration = client.Calibrate("wave");
    EXPECT_THAT(calibration, IsOk());
    return calibration.ok() ? ComparableBytes(*calibration) : "";
  }

  const Target target_ = [] {
    Target target;
    target.marker_positions_m = {0, 0.13, 0.39};
    return target;
  }();
  const TemporaryDirectory directory_;
  std::unique_ptr<ServerProcess> server_ =
      std::make_unique<ServerProcess>(directory_.path() / "store");
  SimulationOptions options_;
  std::vector<std::unique_ptr<Process>> agents_;
  double longest_restart_s_ = 0;
};

TEST_F(KilledAtRandom, LosesNothingAndGivesTheSameResult) {
  ASSERT_TRUE(WaitFor([&] {
    const auto listed = ServerClient(server_->address()).ListAgents();
    return listed.ok() && listed->size() == kCameras;
  })) << agents_[0]->StandardError();
  ASSERT_THAT(ServerClient(server_->address()).CreateSession(WandSession()), IsOk());
  ASSERT_THAT(ServerClient(server_->address()).StartSession("wave"), IsOk());
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
  const uint64_t enough = 3 * 400;
  ASSERT_TRUE(WaitFor([&] { return StoredCount(server_->address()) >= enough; }))
      << agents_[0]->StandardError();
  ServerClient client(server_->address());
  ASSERT_THAT(client.StopSession("wave", 60), IsOk());
  const auto finished = client.WaitUntilFinished("wave");
  ASSERT_THAT(finished, IsOk()) << agents_[0]->StandardError();
  EXPECT_EQ(finished->missing_cameras_size(), 0);
  EXPECT_EQ(finished->late_count(), 0u);
  const auto batches = client.ReadObservations("wave");
  ASSERT_THAT(batches, IsOk());
  const auto world = SimulatedWorld::Create(options_, target_);
  ASSERT_THAT(world, IsOk());
  ExpectSimulatedRows(*world, *batches, *finished);
  const auto calibration = client.Calibrate("wave");
  ASSERT_THAT(calibration, IsOk());
  EXPECT_EQ(calibration->state(), v1::Calibration::STATE_SUCCEEDED) << calibration->error();
  EXPECT_TRUE(ComparableBytes(*calibration) == UndisturbedCalibration(*batches, *finished))
      << "another calibration came out";
  std::printf("%d kills, %lu rows, longest restart %.2f s\n", KillCount(),
              static_cast<unsigned long>(finished->observation_count()), longest_restart_s_);
}

}  // namespace
}  // namespace rigcal::testing::server_killed_test
