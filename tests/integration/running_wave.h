// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/simulation/world/simulated_world.h"
#include "common/wire/camera_wire.h"
#include "tests/testing/postgres_cluster.h"
#include "tests/testing/process.h"
#include "tests/testing/server_client.h"
#include "tests/testing/simulated_rows.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing {

inline v1::CreateSessionRequest WandSession(const std::string& id = "wave") {
  Target target;
  target.marker_positions_m = {0, 0.13, 0.39};
  v1::CreateSessionRequest request;
  request.set_id(id);
  *request.mutable_target() = wire::ToProto(target);
  return request;
}

// An environment variable that makes a test longer, or larger.
inline int Asked(const char* variable, int usual) {
  const char* asked = std::getenv(variable);
  return asked == nullptr ? usual : std::max(1, std::atoi(asked));
}

inline uint64_t StoredCount(const std::string& address) {
  const auto session = ServerClient(address).GetSession("wave");
  return session.ok() ? session->observation_count() : 0;
}

// Agents that capture for as long as it takes, and a server that is killed at random instants.
class RunningWave : public ::testing::Test {
 protected:
  struct Shape {
    int spare_count = 0;  // servers of the same database that wait for their turn
    int cameras = 3;
    int speed = 8;                                  // times 50 Hz
    std::vector<std::string> agent_arguments = {};  // follow the others
    std::vector<std::string> server_arguments = {};
    std::string database_folder = {};  // where the files of PostgreSQL's database are; empty: any
  };

  // `store`: "sqlite", "postgresql", or "replicated": that with a synchronous standby.
  // `duration_s`: far more than is captured.
  RunningWave(const std::string& store, int duration_s) : RunningWave(store, duration_s, Shape()) {}
  RunningWave(const std::string& store, int duration_s, const Shape& shape)
      : camera_count_(shape.cameras) {
    if (store != "sqlite") {
      cluster_ = std::make_unique<PostgresCluster>(PostgresCluster::Options{});  // fsync is on
      std::string tablespace;
      if (!shape.database_folder.empty()) {
        tablespace = "folder";
        cluster_->CreateTablespace(tablespace, shape.database_folder);
      }
      store_arguments_ = {"--store", cluster_->Url(cluster_->CreateDatabase(tablespace))};
    }
    if (store == "replicated") Replicate();
    store_arguments_.insert(store_arguments_.end(), shape.server_arguments.begin(),
                            shape.server_arguments.end());
    server_ = StartServer(0);
    std::string servers = server_->address();
    for (int i = 0; i < shape.spare_count; ++i) {
      spares_.push_back(StartServer(0, absl::StrCat("store", i + 1)));
      absl::StrAppend(&servers, ",", spares_.back()->address());
    }
    options_.camera_count = shape.cameras;
    options_.duration_s = duration_s;
    for (int i = 0; i < shape.cameras; ++i) {
      std::vector<std::string> arguments = {
          "rigcal-agent",
          "--server",
          servers,
          "--state-dir",
          (directory_.path() / ("agent" + std::to_string(i))).string(),
          "--source",
          absl::StrCat("sim:camera=", i, ";cameras=", shape.cameras,
                       ";duration=", options_.duration_s, ";speed=", shape.speed)};
      arguments.insert(arguments.end(), shape.agent_arguments.begin(), shape.agent_arguments.end());
      agents_.push_back(std::make_unique<Process>(Process::Options{arguments, {}}));
    }
  }

  void Replicate() {
    standby_ = cluster_->MakeStandby();
    standby_->Start();
    // Of the primary alone: the standby has none when it is promoted.
    cluster_->Sql("postgres", "ALTER SYSTEM SET synchronous_standby_names = '*'");
    cluster_->Sql("postgres", "SELECT pg_reload_conf()");
    // postgresql://rigcal@HOST/DATABASE: both hosts.
    const std::string beginning = "postgresql://rigcal@";
    const std::string other = standby_->Url("").substr(beginning.size());
    store_arguments_.at(1).insert(beginning.size(), other.substr(0, other.size() - 1) + ",");
  }

  std::unique_ptr<ServerProcess> StartServer(int port, const std::string& folder = "store") const {
    return std::make_unique<ServerProcess>(directory_.path() / folder, port,
                                           std::map<std::string, std::string>(), store_arguments_);
  }

  // Of the server that answers.
  std::string Active() {
    std::string active = server_->address();
    const auto answers = [&](const std::unique_ptr<ServerProcess>& server) {
      if (!ServerClient(server->address()).ListAgents().ok()) return false;
      active = server->address();
      return true;
    };
    WaitFor([&] { return answers(server_) || std::ranges::any_of(spares_, answers); });
    return active;
  }

  void Begin() {
    ASSERT_TRUE(WaitFor([&] {
      const auto listed = ServerClient(server_->address()).ListAgents();
      return listed.ok() && listed->size() == static_cast<size_t>(camera_count_);
    })) << agents_[0]->StandardError();
    ASSERT_THAT(ServerClient(server_->address()).CreateSession(WandSession()), IsOk());
    ASSERT_THAT(ServerClient(server_->address()).StartSession("wave"), IsOk());
  }

  // The capture ends once it has enough; every observation is stored once.
  void ExpectNothingLostAndTheSameResult() {
    const uint64_t enough = uint64_t{400} * static_cast<uint64_t>(camera_count_);
    const std::string active = Active();
    ASSERT_TRUE(WaitFor([&] { return StoredCount(active) >= enough; }))
        << agents_[0]->StandardError();
    ServerClient client(active);
    // A database that is starting refuses for some seconds.
    absl::Status stopped;
    ASSERT_TRUE(WaitFor([&] { return (stopped = client.StopSession("wave", 60).status()).ok(); }))
        << stopped;
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
  }

  void KillServer() {
    server_->process().Signal(SIGKILL);
    server_->process().Wait();
    const int port = server_->port();
    server_.reset();
    const auto start = std::chrono::steady_clock::now();
    server_ = StartServer(port);
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
    longest_restart_s_ = std::max(longest_restart_s_, took.count());
  }

  // The same rows, delivered to a server that nobody kills.
  std::string UndisturbedCalibration(const std::vector<ObservationBatch>& batches,
                                     const v1::Session& session) {
    const ServerProcess server(directory_.path() / "undisturbed");
    ServerClient client(server.address());
    const std::string& id = session.id();
    v1::CreateSessionRequest request = WandSession(id);
    for (const v1::SessionCamera& camera : session.cameras()) {
      *request.add_cameras() = camera.description();
    }
    EXPECT_THAT(client.CreateSession(request), IsOk());
    EXPECT_THAT(client.StartSession(id), IsOk());
    for (const ObservationBatch& batch : batches) EXPECT_THAT(client.Upload(batch), IsOk());
    for (const v1::SessionCamera& camera : session.cameras()) {
      EXPECT_THAT(client.UploadEnd(id, camera.description().camera(),
                                   camera.streams(0).stream_epoch(), camera.streams(0).last_seq()),
                  IsOk());
    }
    EXPECT_THAT(client.WaitUntilFinished(id), IsOk());
    const auto calibration = client.Calibrate(id);
    EXPECT_THAT(calibration, IsOk());
    return calibration.ok() ? ComparableBytes(*calibration) : "";
  }

  const Target target_ = [] {
    Target target;
    target.marker_positions_m = {0, 0.13, 0.39};
    return target;
  }();
  const TemporaryDirectory directory_;
  std::unique_ptr<PostgresCluster> cluster_;  // null: the database is the server's own
  std::unique_ptr<PostgresCluster> standby_;  // of cluster_; null: there is none
  std::vector<std::string> store_arguments_;
  std::unique_ptr<ServerProcess> server_;
  std::vector<std::unique_ptr<ServerProcess>> spares_;
  const int camera_count_;
  SimulationOptions options_;
  std::vector<std::unique_ptr<Process>> agents_;
  double longest_restart_s_ = 0;
};

}  // namespace rigcal::testing
