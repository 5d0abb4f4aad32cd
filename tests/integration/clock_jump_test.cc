// SPDX-License-Identifier: Apache-2.0
// The wall clock of an agent's PC jumps while it streams (T7): nothing is lost, nothing changes its
// order, and the server is told how far off the clock is.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <csignal>
#include <filesystem>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "common/wire/camera_wire.h"
#include "tests/testing/process.h"
#include "tests/testing/server_client.h"
#include "tests/testing/simulated_rows.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/tcp_fault_proxy.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing::clock_jump_test {
namespace {

namespace fs = std::filesystem;

// Empty: it is not installed.
fs::path FakeTimeLibrary() {
  std::error_code none;
  for (const auto& folder : fs::directory_iterator("/usr/lib", none)) {
    const fs::path library = folder.path() / "faketime" / "libfaketimeMT.so.1";
    if (fs::exists(library, none)) return library;
  }
  return {};
}

class ClockJump : public ::testing::Test {
 protected:
  static constexpr int kCameras = 2;

  void SetUp() override {
#ifdef __SANITIZE_ADDRESS__
    GTEST_SKIP() << "faketime and the address sanitizer exclude each other";
#endif
    const fs::path library = FakeTimeLibrary();
    if (library.empty()) GTEST_SKIP() << "needs faketime (Debian: faketime)";
    options_.camera_count = kCameras;
    options_.rate_hz = 200;
    options_.duration_s = 600;
    SetClock("+0");
    Process::Options agent;
    agent.arguments = {"rigcal-agent", "--server", link_.address(), "--state-dir",
                       (directory_.path() / "agent").string()};
    for (int i = 0; i < kCameras; ++i) {
      agent.arguments.insert(agent.arguments.end(),
                             {"--source", absl::StrCat("sim:camera=", i, ";cameras=", kCameras,
                                                       ";rate=200;duration=600")});
    }
    agent.environment = {{"LD_PRELOAD", library.string()},
                         {"FAKETIME_TIMESTAMP_FILE", clock_file().string()},
                         {"FAKETIME_NO_CACHE", "1"},
                         {"FAKETIME_DONT_FAKE_MONOTONIC", "1"},
                         {"NO_FAKE_STAT", "1"}};
    agent_ = std::make_unique<Process>(std::move(agent));
    ASSERT_TRUE(WaitFor([&] {
      const auto listed = client_.ListAgents();
      return listed.ok() && listed->size() == 1;
    })) << agent_->StandardError();
    Target target;
    target.marker_positions_m = {0, 0.13, 0.39};
    v1::CreateSessionRequest request;
    request.set_id("wave");
    *request.mutable_target() = wire::ToProto(target);
    ASSERT_THAT(client_.CreateSession(request), IsOk());
    ASSERT_THAT(client_.StartSession("wave"), IsOk());
    world_ = std::make_unique<SimulatedWorld>(*SimulatedWorld::Create(options_, target));
  }

  fs::path clock_file() const { return directory_.path() / "clock"; }
  // Of the agent's PC, against the true time: "+1h".
  void SetClock(const std::string& offset) {
    const fs::path next = directory_.WriteFile("clock.new", offset);
    fs::rename(next, clock_file());
  }
  uint64_t StoredCount() {
    const auto session = client_.GetSession("wave");
    return session.ok() ? session->observation_count() : 0;
  }
  void ExpectProgress() {
    const uint64_t before = StoredCount();
    EXPECT_TRUE(WaitFor([&] { return StoredCount() >= before + 200; })) << agent_->StandardError();
  }

  TemporaryDirectory directory_;
  ServerProcess server_{directory_.path() / "store"};
  TcpFaultProxy link_{server_.port()};
  ServerClient client_{server_.address()};
  SimulationOptions options_;
  std::unique_ptr<SimulatedWorld> world_;
  std::unique_ptr<Process> agent_;
};

TEST_F(ClockJump, LosesNothingAndKeepsTheOrder) {
  ExpectProgress();
  for (const char* jump : {"+1h", "-1h", "+0"}) {
    SetClock(jump);
    ExpectProgress();
    // The connection breaks as well: the next one measures the clock again.
    link_.Cut();
    link_.Restore();
    ExpectProgress();
  }
  // As a clock that is disciplined by two quarrelling programs.
  for (int i = 0; i < 60; ++i) {
    SetClock(i % 2 == 0 ? "+0.2" : "-0.2");
    std::this_thread::sleep_for(std::chrono::milliseconds(25));
    if (i % 20 == 10) {
      link_.Cut();
      link_.Restore();
    }
  }
  ExpectProgress();
  SetClock("+0");
  ExpectProgress();
  ASSERT_THAT(client_.StopSession("wave", 60), IsOk());
  const auto finished = client_.WaitUntilFinished("wave");
  ASSERT_THAT(finished, IsOk()) << agent_->StandardError();
  EXPECT_EQ(finished->missing_cameras_size(), 0) << agent_->StandardError();
  EXPECT_EQ(finished->late_count(), 0u);
  const auto batches = client_.ReadObservations("wave");
  ASSERT_THAT(batches, IsOk());
  ExpectSimulatedRows(*world_, *batches, *finished);
  const CommandResult verified =
      RunCommand({"rigcal", "session", "verify", "wave", "--server", server_.address()});
  EXPECT_EQ(verified.exit_code, 0) << verified.output << verified.error;

  std::vector<double> hours;
  for (const ObservationBatch& batch : *batches) {
    if (batch.stream.camera != "sim_0") continue;
    for (const HostAlignment& alignment : batch.host_alignments) {
      hours.push_back(1e-9 * static_cast<double>(alignment.server_minus_host_ns) / 3600);
    }
  }
  constexpr double kHalfAMinute = 0.5 / 60;
  using ::testing::DoubleNear;
  EXPECT_THAT(hours,
              ::testing::IsSupersetOf({DoubleNear(-1, kHalfAMinute), DoubleNear(1, kHalfAMinute),
                                       DoubleNear(0, kHalfAMinute)}));
  agent_->Signal(SIGTERM);
  EXPECT_EQ(agent_->Wait(), 0) << agent_->StandardError();
}

}  // namespace
}  // namespace rigcal::testing::clock_jump_test
