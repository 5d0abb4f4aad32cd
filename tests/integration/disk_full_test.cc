// SPDX-License-Identifier: Apache-2.0
// The disk of a running server, or of a running agent, becomes full and has room again: nothing
// ends, nothing is lost, and all goes on by itself. The disk is a small tmpfs, in a mount namespace
// that the program has for itself; this test reaches it by /proc/<pid>/root.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <grpc/health/v1/health.pb.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <thread>

#include "absl/strings/str_cat.h"
#include "common/wire/camera_wire.h"
#include "rigcal/v1/status_service.grpc.pb.h"
#include "tests/testing/http_connection.h"
#include "tests/testing/process.h"
#include "tests/testing/reflection_client.h"
#include "tests/testing/server_client.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing::disk_full_test {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::Not;

// A program with a tmpfs of its own at `disk`.
class OnSmallDisk {
 public:
  OnSmallDisk(const fs::path& disk, int size_mb, const std::string& command) : disk_(disk) {
    fs::create_directories(disk);
    process_ = std::make_unique<Process>(
        Process::Options{{"/bin/sh", "-c", InNamespace(disk, size_mb, "exec " + command)}, {}});
  }
  // Why it cannot be done on this machine; empty: it can.
  static std::string Problem(const fs::path& disk) {
    fs::create_directories(disk);
    const CommandResult result = RunCommand({"/bin/sh", "-c", InNamespace(disk, 1, "true")});
    return result.exit_code == 0 ? "" : result.error + " ";
  }

  Process& process() { return *process_; }
  // What the program has at this place.
  fs::path Seen(const fs::path& path) const {
    return fs::path("/proc") / std::to_string(process_->pid()) / "root" / path.relative_path();
  }
  double FreeMb() const {
    struct statvfs disk = {};
    if (statvfs(Seen(disk_).c_str(), &disk) != 0) return -1;
    return static_cast<double>(disk.f_bavail) * static_cast<double>(disk.f_frsize) / (1 << 20);
  }
  // Writes a file until no more than `free_mb` are left; 0: until nothing more can be written.
  void Fill(double free_mb) {
    const int file = open(Seen(disk_ / "filler").c_str(), O_WRONLY | O_CREAT | O_APPEND, 0600);
    ASSERT_GE(file, 0);
    const std::string bytes(4096, 'x');
    while (FreeMb() > free_mb && write(file, bytes.data(), bytes.size()) > 0) {
    }
    close(file);
  }
  void Free() { fs::remove(Seen(disk_ / "filler")); }

 private:
  static std::string InNamespace(const fs::path& disk, int size_mb, const std::string& command) {
    const std::string user = geteuid() == 0 ? "" : "--user --map-root-user ";
    return absl::StrCat("exec unshare ", user, "--mount sh -c 'mount -t tmpfs -o size=", size_mb,
                        "m,mode=0700 tmpfs ", disk.string(), " && ", command, "'");
  }

  const fs::path disk_;
  std::unique_ptr<Process> process_;
};

class DiskFull : public ::testing::Test {
 protected:
  void SetUp() override {
    const std::string problem = OnSmallDisk::Problem(disk_);
    if (!problem.empty()) GTEST_SKIP() << "no small disk can be mounted here: " << problem;
  }

  std::string AgentCommand(const fs::path& state_dir) {
    const auto config = directory_.WriteFile("agent.toml", R"(
[[camera]]
source = "sim:camera=0;cameras=2;duration=80000;rate=400;speed=1"
[[camera]]
source = "sim:camera=1;cameras=2;duration=80000;rate=400;speed=1"
)");
    return absl::StrCat(RIGCAL_BIN_DIR "/rigcal-agent --config ", config.string(), " --server ",
                        address_, " --state-dir ", state_dir.string());
  }
  static v1::CreateSessionRequest SessionRequest(const std::string& id) {
    v1::CreateSessionRequest request;
    request.set_id(id);
    request.mutable_target()->set_kind(v1::Target::KIND_WAND);
    for (const double position : {0.0, 0.13, 0.39}) {
      request.mutable_target()->add_marker_positions_m(position);
    }
    return request;
  }
  void StartWave(Process& agent) {
    ASSERT_TRUE(WaitFor([&] {
      const auto listed = client().ListAgents();
      return listed.ok() && listed->size() == 1 && listed->at(0).connected();
    })) << agent.StandardError();
    ASSERT_THAT(client().CreateSession(SessionRequest("wave")), IsOk());
    ASSERT_THAT(client().StartSession("wave"), IsOk());
    ASSERT_TRUE(WaitFor([&] { return StoredCount() > 400; })) << agent.StandardError();
  }
  // Ends the session: everything is delivered, and proved to be.
  void ExpectNothingLost(Process& agent) {
    const uint64_t before = StoredCount();
    ASSERT_TRUE(WaitFor([&] { return StoredCount() > before + 400; })) << agent.StandardError();
    ASSERT_THAT(client().StopSession("wave", 60), IsOk());
    const auto finished = client().WaitUntilFinished("wave");
    ASSERT_THAT(finished, IsOk());
    EXPECT_EQ(finished->missing_cameras_size(), 0) << agent.StandardError();
    for (const v1::SessionCamera& camera : finished->cameras()) {
      EXPECT_EQ(camera.refused_size(), 0) << camera.description().camera();
    }
    const CommandResult verified =
        RunCommand({"rigcal", "session", "verify", "wave", "--server", address_});
    EXPECT_EQ(verified.exit_code, 0) << verified.output << verified.error;
    agent.Signal(SIGTERM);
    EXPECT_EQ(agent.Wait(), 0) << agent.StandardError();
  }

  ServerClient client() const { return ServerClient(address_); }
  uint64_t StoredCount() const {
    const auto session = client().GetSession("wave");
    return session.ok() ? session->observation_count() : 0;
  }
  std::string IngestHealth() const {
    grpc::health::v1::HealthCheckRequest request;
    request.set_service("rigcal.v1.IngestService");
    const auto channel = grpc::CreateChannel(address_, grpc::InsecureChannelCredentials());
    const auto bytes =
        CallRaw(channel, "/grpc.health.v1.Health/Check", request.SerializeAsString());
    grpc::health::v1::HealthCheckResponse response;
    if (!bytes.ok() || !response.ParseFromString(*bytes)) return "no answer";
    return grpc::health::v1::HealthCheckResponse::ServingStatus_Name(response.status());
  }

  const TemporaryDirectory directory_;
  const fs::path disk_ = directory_.path() / "disk";
  std::string address_;
};

class ServerOnFullDisk : public DiskFull {
 protected:
  void Start() {
    const fs::path port_file = disk_ / "port";
    const auto config =
        directory_.WriteFile("server.toml", absl::StrCat("listen = \"127.0.0.1:0\"\ndata_dir = \"",
                                                         (disk_ / "store").string(),
                                                         "\"\n[limits]\ndisk_reserve_mb = 4\n"));
    server_ = std::make_unique<OnSmallDisk>(
        disk_, 64,
        absl::StrCat(RIGCAL_BIN_DIR "/rigcal-server --config ", config.string(), " --port-file ",
                     port_file.string(), " --http-port-file ", (disk_ / "http_port").string()));
    int port = 0;
    ASSERT_TRUE(WaitFor([&] {
      return std::ifstream(server_->Seen(port_file)) >> port && port > 0;
    })) << server_->process().StandardError();
    address_ = "127.0.0.1:" + std::to_string(port);
    std::ifstream(server_->Seen(disk_ / "http_port")) >> http_port_;
  }
  int Readiness() const {
    const auto reply = HttpConnection(http_port_).Get("/readyz");
    return reply.ok() ? reply->status : 0;
  }
  // A session that was delivered by hand, with this number of rows of some 30 bytes.
  void MakeOldSession(uint32_t rows = 30'000) {
    v1::CreateSessionRequest request = SessionRequest("old");
    CameraDescription camera;
    camera.camera = "by_hand";
    camera.image_size_px = {.width = 1280, .height = 1024};
    camera.clock = {.clock_id = "by_hand", .timebase = "recording"};
    *request.add_cameras() = wire::ToProto(camera);
    ASSERT_THAT(client().CreateSession(request), IsOk());
    ASSERT_THAT(client().StartSession("old"), IsOk());
    for (uint32_t first = 1; first < rows; first += 3000) {
      ASSERT_THAT(client().Upload(ByHand(first, first + 2999)), IsOk());
    }
    ASSERT_THAT(client().UploadEnd("old", "by_hand", 1, rows), IsOk());
    ASSERT_THAT(client().WaitUntilFinished("old"), IsOk());
  }
  static ObservationBatch ByHand(uint32_t first_seq, uint32_t last_seq) {
    ObservationBatch batch;
    batch.stream = {"old", "by_hand", 1};
    batch.first_seq = first_seq;
    batch.marker_count = 3;
    uint32_t noise = first_seq;
    for (uint32_t seq = first_seq; seq <= last_seq; ++seq) {
      Observation row;
      row.time_ns = int64_t{seq} * 1'000'000;
      row.markers.resize(3);
      for (MarkerObservation& marker : row.markers) {
        marker.visible = true;
        // Nothing that can be compressed.
        noise = noise * 1664525 + 1013904223;
        marker.centre_px = {1e-5 * (noise >> 6), 1e-5 * (noise % (1 << 26))};
      }
      batch.Append(row);
    }
    return batch;
  }
  void ExpectReadsAreServed() {
    EXPECT_THAT(client().GetSession("wave"), IsOk());
    const auto rows = client().ReadObservations("wave");
    ASSERT_THAT(rows, IsOk());
    EXPECT_FALSE(rows->empty());
    EXPECT_EQ(RunCommand({"rigcal", "session", "list", "--server", address_}).exit_code, 0);
    grpc::ClientContext context;
    v1::GetStatusResponse status;
    EXPECT_TRUE(v1::StatusService::NewStub(
                    grpc::CreateChannel(address_, grpc::InsecureChannelCredentials()))
                    ->GetStatus(&context, {}, &status)
                    .ok());
    EXPECT_THAT(status.ingest().problem(), HasSubstr("disk"));
  }

  std::unique_ptr<OnSmallDisk> server_;
  int http_port_ = 0;
};

TEST_F(ServerOnFullDisk, IsNotReadyThoughNothingArrives) {
  ASSERT_NO_FATAL_FAILURE(Start());
  EXPECT_EQ(Readiness(), 200);
  ASSERT_NO_FATAL_FAILURE(server_->Fill(3));
  EXPECT_EQ(Readiness(), 503);
  EXPECT_THAT(HttpConnection(http_port_).Get("/readyz")->body, HasSubstr("the disk has"));
  EXPECT_EQ(HttpConnection(http_port_).Get("/healthz")->status, 200);
  server_->Free();
  EXPECT_EQ(Readiness(), 200);
}

// Somebody else's bytes keep the disk full: what is deleted makes room inside the database.
TEST_F(ServerOnFullDisk, GoesOnWhenSessionsAreDeletedThoughTheDiskStaysFull) {
  ASSERT_NO_FATAL_FAILURE(Start());
  ASSERT_NO_FATAL_FAILURE(MakeOldSession(450'000));
  Process agent({{"/bin/sh", "-c", "exec " + AgentCommand(directory_.path() / "agent")}, {}});
  ASSERT_NO_FATAL_FAILURE(StartWave(agent));
  ASSERT_NO_FATAL_FAILURE(server_->Fill(0));
  ASSERT_TRUE(WaitFor([&] { return IngestHealth() == "NOT_SERVING"; }));
  EXPECT_EQ(Readiness(), 503);
  EXPECT_EQ(RunCommand({"rigcal", "session", "delete", "old", "--yes", "--server", address_}).exit_code, 0);
  EXPECT_TRUE(WaitFor([&] { return IngestHealth() == "SERVING" && Readiness() == 200; }))
      << server_->process().StandardError();
  EXPECT_LT(server_->FreeMb(), 16);
  ExpectNothingLost(agent);
}

TEST_F(ServerOnFullDisk, ReadsDeletesAndGoesOnByItself) {
  ASSERT_NO_FATAL_FAILURE(Start());
  ASSERT_NO_FATAL_FAILURE(MakeOldSession());
  Process agent({{"/bin/sh", "-c", "exec " + AgentCommand(directory_.path() / "agent")}, {}});
  ASSERT_NO_FATAL_FAILURE(StartWave(agent));

  // Below the reserve.
  ASSERT_NO_FATAL_FAILURE(server_->Fill(3));
  ASSERT_TRUE(WaitFor([&] { return IngestHealth() == "NOT_SERVING"; }));
  ExpectReadsAreServed();
  // To the last byte.
  ASSERT_NO_FATAL_FAILURE(server_->Fill(0));
  SleepBriefly();
  EXPECT_EQ(IngestHealth(), "NOT_SERVING");
  ExpectReadsAreServed();
  const auto deleted = [&] {
    grpc::ClientContext context;
    v1::DeleteSessionRequest request;
    request.set_id("old");
    v1::DeleteSessionResponse response;
    const grpc::Status status =
        v1::SessionService::NewStub(
            grpc::CreateChannel(address_, grpc::InsecureChannelCredentials()))
            ->DeleteSession(&context, request, &response);
    return status.ok() ? "" : status.error_message();
  };
  EXPECT_EQ(deleted(), "");
  EXPECT_THAT(client().GetSession("old"), Not(IsOk()));

  ASSERT_TRUE(server_->process().Running()) << server_->process().StandardError();
  server_->Free();
  ASSERT_TRUE(WaitFor([&] { return IngestHealth() == "SERVING"; }))
      << server_->process().StandardError();
  ExpectNothingLost(agent);
  server_->process().Signal(SIGTERM);
  EXPECT_EQ(server_->process().Wait(), 0);
  EXPECT_THAT(server_->process().StandardError(), HasSubstr("ingest takes no observations"));
}

class AgentOnFullDisk : public DiskFull {};

TEST_F(AgentOnFullDisk, WaitsAndGoesOnByItself) {
  ServerProcess server(directory_.path() / "store");
  address_ = server.address();
  OnSmallDisk agent(disk_, 8, AgentCommand(disk_ / "state"));
  ASSERT_NO_FATAL_FAILURE(StartWave(agent.process()));

  // While the server takes nothing, the spool fills what is left of the disk.
  server.process().Signal(SIGSTOP);
  ASSERT_NO_FATAL_FAILURE(agent.Fill(0.2));
  ASSERT_TRUE(WaitFor([&] {
    return agent.process().StandardError().find("full") != std::string::npos;
  })) << agent.process().StandardError();
  ASSERT_NO_FATAL_FAILURE(agent.Fill(0));
  std::this_thread::sleep_for(std::chrono::seconds(2));
  ASSERT_TRUE(agent.process().Running()) << agent.process().StandardError();
  server.process().Signal(SIGCONT);
  // Delivering alone makes room again, though the disk stays full of others' bytes: more than the
  // spool can have held.
  const uint64_t before = StoredCount();
  EXPECT_TRUE(WaitFor([&] { return StoredCount() > before + 8000; }))
      << StoredCount() << " after " << before << "\n"
      << agent.process().StandardError();
  agent.Free();
  ExpectNothingLost(agent.process());
}

}  // namespace
}  // namespace rigcal::testing::disk_full_test
