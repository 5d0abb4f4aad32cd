// SPDX-License-Identifier: Apache-2.0
// A server killed during a capture is restarted on the same data, and the capture completes with
// every observation stored once.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "common/wire/camera_wire.h"
#include "tests/testing/process.h"
#include "tests/testing/recorded_data.h"
#include "tests/testing/server_client.h"
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
    ASSERT_LT(StoredCount(address), expected)
        << "the capture was over before the server was killed";
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
                      ";speed=10");
  }
  RunWithKills(sources, 2482, {600, 1500});
}

TEST(ServerKilled, SimulatedRigCompletesWithEveryRowStoredOnce) {
  std::vector<std::string> sources;
  for (int i = 0; i < 3; ++i) {
    sources.push_back("sim:camera=" + std::to_string(i) + ";cameras=3;duration=24;rate=25;speed=8");
  }
  RunWithKills(sources, 3 * 600, {300});
}

}  // namespace
}  // namespace rigcal::testing::server_killed_test
