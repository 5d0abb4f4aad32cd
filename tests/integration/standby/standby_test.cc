// SPDX-License-Identifier: Apache-2.0
// A standby follows a server, and takes over when that is killed: real processes, agents that go on
// all the while.
#include <gmock/gmock.h>
#include <grpcpp/create_channel.h>
#include <grpcpp/security/credentials.h>
#include <gtest/gtest.h>

#include <chrono>
#include <csignal>
#include <cstdio>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "rigcal/v1/session_service.grpc.pb.h"
#include "rigcal/v1/status_service.grpc.pb.h"
#include "tests/integration/running_wave.h"
#include "tests/testing/process.h"
#include "tests/testing/server_client.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing::standby_test {
namespace {

using ::testing::HasSubstr;

// What a primary says of its standby.
v1::StandbyStatus StandbyOf(const std::string& address) {
  const auto stub =
      v1::StatusService::NewStub(grpc::CreateChannel(address, grpc::InsecureChannelCredentials()));
  grpc::ClientContext context;
  v1::GetStatusResponse response;
  EXPECT_TRUE(stub->GetStatus(&context, {}, &response).ok());
  return response.standby();
}

class WithStandby : public RunningWave {
 protected:
  // 50 Hz.
  explicit WithStandby(const std::vector<std::string>& agent_arguments)
      : RunningWave("sqlite", 600, {.speed = 1, .agent_arguments = agent_arguments}) {}

  std::string StandbyFolder() const { return (directory_.path() / "standby").string(); }
  void StartStandby() {
    standby_ =
        std::make_unique<ServerProcess>(StandbyFolder(), 0, std::map<std::string, std::string>(),
                                        std::vector<std::string>{"--follow", server_->address()});
  }
  static void Kill(std::unique_ptr<ServerProcess>* server) {
    (*server)->process().Signal(SIGKILL);
    (*server)->process().Wait();
    server->reset();
  }
  // Rows of all cameras that the store in `folder` has, as far as a check of it counts them.
  void ExpectSound(const std::string& folder) {
    const CommandResult check = RunCommand({"rigcal-server", "check", "--data-dir", folder});
    EXPECT_EQ(check.exit_code, 0) << check.output << check.error;
  }
  void WaitForRows(uint64_t count) {
    ASSERT_TRUE(WaitFor([&] { return StoredCount(server_->address()) >= count; }))
        << agents_[0]->StandardError();
  }

  // The primary is killed, the standby promoted; it serves at the primary's address then, as agents
  // know no other.
  void TakeOver() { TakeOver(StandbyFolder(), 2); }
  void TakeOver(
      const std::string& folder, int generation, const std::function<void()>& once_killed = [] {}) {
    const int port = server_->port();
    Kill(&server_);
    once_killed();
    const auto start = std::chrono::steady_clock::now();
    const CommandResult promoted = RunCommand({"rigcal-server", "promote", "--data-dir", folder});
    ASSERT_EQ(promoted.exit_code, 0) << promoted.error << standby_->process().StandardError();
    EXPECT_THAT(promoted.output, HasSubstr(absl::StrCat("generation ", generation)));
    // In the same process, without a restart by hand.
    ASSERT_TRUE(WaitFor([&] {
      return standby_->process().StandardError().find("rigcal-server 0.1.0 listens on") !=
             std::string::npos;
    })) << standby_->process().StandardError();
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
    std::printf("promoted after %.2f s\n", took.count());
    standby_->process().Signal(SIGTERM);
    EXPECT_EQ(standby_->process().Wait(), 0);
    standby_.reset();
    server_ = std::make_unique<ServerProcess>(folder, port);
  }

  std::unique_ptr<ServerProcess> standby_;
};

class KeptUntilStandby : public WithStandby {
 protected:
  KeptUntilStandby() : WithStandby({"--durable-on", "standby"}) {}
};

TEST_F(KeptUntilStandby, LosesNothingWhenThePrimaryIsKilled) {
  StartStandby();
  Begin();
  WaitForRows(150);
  TakeOver();
  ExpectNothingLostAndTheSameResult();
  ExpectSound(StandbyFolder());
}

// The old primary's rows are cut into other batches than those that the agents have sent again.
TEST_F(KeptUntilStandby, LosesNothingWhenTheOldPrimaryFollowsAndTakesOverAgain) {
  const std::string first = (directory_.path() / "store").string();
  StartStandby();
  Begin();
  WaitForRows(150);
  // Its last rows stay in the spools until it is gone.
  standby_->process().Signal(SIGSTOP);
  WaitForRows(300);
  TakeOver(StandbyFolder(), 2, [&] { standby_->process().Signal(SIGCONT); });
  WaitForRows(450);
  standby_ =
      std::make_unique<ServerProcess>(first, 0, std::map<std::string, std::string>(),
                                      std::vector<std::string>{"--follow", server_->address()});
  ASSERT_TRUE(WaitFor([&] {
    return standby_->process().StandardError().find("has everything of it") != std::string::npos;
  })) << standby_->process().StandardError();
  WaitForRows(600);
  TakeOver(first, 3);
  ExpectNothingLostAndTheSameResult();
  ExpectSound(first);
}

TEST_F(KeptUntilStandby, LosesNothingWhenTheStandbyWasKilledBefore) {
  StartStandby();
  Begin();
  WaitForRows(60);
  Kill(&standby_);
  WaitForRows(150);
  StartStandby();
  WaitForRows(240);
  Kill(&standby_);
  WaitForRows(330);
  // Behind by 90 rows, which the spools still have.
  const int port = server_->port();
  Kill(&server_);
  const CommandResult promoted =
      RunCommand({"rigcal-server", "promote", "--data-dir", StandbyFolder()});
  ASSERT_EQ(promoted.exit_code, 0) << promoted.error;
  server_ = std::make_unique<ServerProcess>(StandbyFolder(), port);
  ExpectNothingLostAndTheSameResult();
  ExpectSound(StandbyFolder());
}

class ForgottenOnAcknowledgement : public WithStandby {
 protected:
  ForgottenOnAcknowledgement() : WithStandby({}) {}
};

// Spools have acknowledged rows for a while, that on the disk for longer, and send them again.
class ForgottenAtOnce : public WithStandby {
 protected:
  ForgottenAtOnce() : WithStandby({"--spool", "memory"}) {}
};

TEST_F(ForgottenAtOnce, WhatTheStandbyDidNotHaveIsNamed) {
  StartStandby();
  Begin();
  WaitForRows(90);
  Kill(&standby_);
  // The spool frees 256 rows of a camera at a time.
  WaitForRows(1800);
  const int port = server_->port();
  Kill(&server_);
  const CommandResult promoted =
      RunCommand({"rigcal-server", "promote", "--data-dir", StandbyFolder()});
  ASSERT_EQ(promoted.exit_code, 0) << promoted.error;
  server_ = std::make_unique<ServerProcess>(StandbyFolder(), port);
  const auto before = ServerClient(server_->address()).GetSession("wave");
  ASSERT_THAT(before, IsOk());
  WaitForRows(before->observation_count() + 90);
  ServerClient client(server_->address());
  ASSERT_THAT(client.StopSession("wave", 60), IsOk());
  const auto finished = client.WaitUntilFinished("wave");
  ASSERT_THAT(finished, IsOk());
  uint64_t missing = 0;
  uint64_t numbered = 0;
  for (const v1::SessionCamera& camera : finished->cameras()) {
    ASSERT_EQ(camera.streams_size(), 1);
    numbered += camera.streams(0).last_seq();
    for (const v1::RefusalCount& refusal : camera.refused()) {
      if (refusal.reason() == v1::REFUSAL_REASON_SPOOL_FREED) missing += refusal.count();
    }
  }
  EXPECT_GT(missing, 0u);
  EXPECT_EQ(numbered, finished->observation_count() + missing);
  EXPECT_EQ(finished->missing_cameras_size(), 0);
}

TEST_F(ForgottenOnAcknowledgement, FollowsAPrimaryThatIsRestartedAndDeletes) {
  StartStandby();
  Begin();
  {
    ServerClient client(server_->address());
    v1::CreateSessionRequest request = WandSession();
    request.set_id("unwanted");
    ASSERT_THAT(client.CreateSession(request), IsOk());
  }
  WaitForRows(60);
  KillServer();
  WaitForRows(150);
  ServerClient client(server_->address());
  {
    const auto channel =
        grpc::CreateChannel(server_->address(), grpc::InsecureChannelCredentials());
    grpc::ClientContext context;
    v1::DeleteSessionRequest request;
    request.set_id("unwanted");
    v1::DeleteSessionResponse response;
    ASSERT_TRUE(
        v1::SessionService::NewStub(channel)->DeleteSession(&context, request, &response).ok());
  }
  ASSERT_THAT(client.StopSession("wave", 60), IsOk());
  ASSERT_THAT(client.WaitUntilFinished("wave"), IsOk());
  const auto calibration = client.Calibrate("wave");
  ASSERT_THAT(calibration, IsOk());
  const auto rows = client.ReadObservations("wave");
  ASSERT_THAT(rows, IsOk());
  ASSERT_TRUE(WaitFor([&] {
    const v1::StandbyStatus standby = StandbyOf(server_->address());
    return standby.connected() && standby.behind_count() == 0 && standby.behind_s() == 0;
  })) << StandbyOf(server_->address()).ShortDebugString()
      << standby_->process().StandardError();
  TakeOver();
  ServerClient after(server_->address());
  EXPECT_FALSE(after.GetSession("unwanted").ok());
  const auto rows_after = after.ReadObservations("wave");
  ASSERT_THAT(rows_after, IsOk());
  EXPECT_TRUE(ComparableBytes(*rows_after) == ComparableBytes(*rows));
  // A number that was used is not used again.
  const auto another = after.Calibrate("wave");
  ASSERT_THAT(another, IsOk());
  EXPECT_NE(another->id(), calibration->id());
  EXPECT_TRUE(ComparableBytes(*another) == ComparableBytes(*calibration));
  ExpectSound(StandbyFolder());
}

TEST_F(ForgottenOnAcknowledgement, TheOldPrimaryStopsWhenItComesBack) {
  StartStandby();
  Begin();
  WaitForRows(60);
  TakeOver();
  WaitForRows(300);
  const ServerProcess old(directory_.path() / "store", 0);
  // An agent that has spoken with the new one tells it.
  agents_[0]->Signal(SIGTERM);
  agents_[0]->Wait();
  Process moved({{"rigcal-agent", "--server", old.address(), "--state-dir",
                  (directory_.path() / "agent0").string(), "--source", "sim:camera=0;cameras=3"},
                 {}});
  ASSERT_TRUE(WaitFor([&] {
    const absl::Status refused = ServerClient(old.address()).GetSession("wave").status();
    return absl::StrContains(refused.message(), "another one has taken over with generation 2");
  })) << moved.StandardError();
}

}  // namespace
}  // namespace rigcal::testing::standby_test
