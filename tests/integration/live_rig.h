// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <memory>
#include <set>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "rigcal/v1/live_service.grpc.pb.h"
#include "tests/testing/process.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing {

// A server and an agent with four simulated cameras, and the live state of them.
class LiveRig : public ::testing::Test {
 protected:
  static constexpr double kRateHz = 50;
  // An alert must name the problem within this much waving.
  static constexpr double kAlertLimitS = 10;

  void SetUp() override {
    server_ = std::make_unique<ServerProcess>(directory_.path() / "store");
    OpenStub();
  }
  void OpenStub() {
    stub_ = v1::LiveService::NewStub(
        grpc::CreateChannel(server_->address(), grpc::InsecureChannelCredentials()));
  }
  // Three cameras that see the wand, and one with `odd` options.
  void StartAgent(const std::string& odd) {
    Process::Options options{{"rigcal-agent", "--server", server_->address(), "--state-dir",
                              (directory_.path() / "agent").string()},
                             {}};
    for (int i = 0; i < 4; ++i) {
      options.arguments.insert(
          options.arguments.end(),
          {"--source", absl::StrCat("sim:camera=", i, ";cameras=4;rate=", kRateHz, ";duration=600",
                                    i == 3 ? odd : "")});
    }
    agent_ = std::make_unique<Process>(std::move(options));
    ASSERT_TRUE(WaitFor([&] { return Get().cameras_size() == 4; })) << agent_->StandardError();
    EXPECT_EQ(Get().cameras(0).state(), v1::LiveCamera::STATE_IDLE);
  }
  CommandResult Rigcal(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "rigcal");
    arguments.insert(arguments.end(), {"--server", server_->address()});
    return RunCommand(arguments);
  }
  void StartWave() {
    const CommandResult created = Rigcal({"session", "create", "--target", "wand:0,0.13,0.39",
                                          "--id", "wave", "--until-mm", "0.001", "--start"});
    ASSERT_EQ(created.exit_code, 0) << created.error;
    EXPECT_THAT(created.output,
                ::testing::HasSubstr("expected error below 0.001 mm, not before 20"));
  }
  v1::LiveState Get(const std::string& since = "") {
    grpc::ClientContext context;
    v1::GetLiveRequest request;
    request.set_since_revision(since);
    v1::GetLiveResponse response;
    stub_->GetLive(&context, request, &response);
    return response.live();
  }
  // Waits for the alert, and says how many seconds of data of a camera that sees the wand from its
  // first row on were stored until then. A machine that stands still has no data either.
  double SecondsOfWavingUntil(const std::string& alert) {
    v1::LiveState live;
    EXPECT_TRUE(WaitFor([&] {
      live = Get();
      return Alerts(live).contains(alert);
    })) << live.DebugString();
    const double seconds = static_cast<double>(live.cameras(0).observation_count()) / kRateHz;
    RecordProperty(alert, std::to_string(seconds));
    return seconds;
  }
  static std::set<std::string> Alerts(const v1::LiveState& live) {
    std::set<std::string> alerts;
    for (const v1::LiveAlert& alert : live.alerts().alerts()) {
      alerts.insert(absl::StrCat(alert.kind(), " ", alert.camera()));
    }
    return alerts;
  }

  TemporaryDirectory directory_;
  std::unique_ptr<ServerProcess> server_;
  std::unique_ptr<Process> agent_;
  std::unique_ptr<v1::LiveService::Stub> stub_;
};

}  // namespace rigcal::testing
