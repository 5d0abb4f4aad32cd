// SPDX-License-Identifier: Apache-2.0
// A solve whose process is stopped: everybody is told, it is ended, and the queue goes on.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "tests/testing/process.h"
#include "tests/testing/server_client.h"
#include "tests/testing/simulated_rows.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing::worker_stopped_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

class WorkerStopped : public ::testing::Test {
 protected:
  CommandResult Rigcal(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "rigcal");
    arguments.insert(arguments.end(), {"--server", server_->address()});
    return RunCommand(arguments);
  }

  void SetUp() override {
    const std::filesystem::path config = directory_.path() / "server.toml";
    std::ofstream(config) << "[limits]\ncalibration_silence_s = 5\n";
    server_ = std::make_unique<ServerProcess>(
        directory_.path() / "store", 0, std::map<std::string, std::string>{},
        std::vector<std::string>{"--config", config.string()});
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

  TemporaryDirectory directory_;
  std::unique_ptr<ServerProcess> server_;
  std::unique_ptr<Process> agent_;
};

TEST_F(WorkerStopped, IsShownAndEndedAndTheQueueGoesOn) {
  ASSERT_EQ(Rigcal({"calibrate", "wave"}).exit_code, 0);
  ASSERT_EQ(Rigcal({"calibrate", "wave"}).exit_code, 0);
  // Of this server alone.
  const std::string mark = absl::StrCat("--parent=", server_->process().pid());
  pid_t worker = 0;
  ASSERT_TRUE(WaitFor([&] {
    for (const pid_t pid : ProcessesWith(mark)) worker = pid;
    return worker != 0;
  }));
  ASSERT_EQ(kill(worker, SIGSTOP), 0);
  EXPECT_TRUE(WaitFor([&] {
    return Rigcal({"calibration", "list"}).output.find("running, not responding") !=
           std::string::npos;
  }));
  const CommandResult shown = Rigcal({"calibration", "get", "c-000001"});
  if (shown.output.find("calibrating") != std::string::npos) {
    EXPECT_THAT(shown.output, HasSubstr("not responding"));
  }
  const auto state = [&](const std::string& id) {
    const CommandResult got = Rigcal({"calibration", "get", id, "-o", "json"});
    const auto json = nlohmann::json::parse(got.output, nullptr, false);
    return json.is_discarded() ? std::string() : json.value("state", "");
  };
  ASSERT_TRUE(WaitFor([&] { return state("c-000001") == "STATE_FAILED"; }));
  EXPECT_THAT(Rigcal({"calibration", "get", "c-000001"}).output,
              AllOf(HasSubstr("rigcal-worker (process "), HasSubstr("gave no sign of life for 5 s"),
                    HasSubstr("create the calibration again")));
  EXPECT_TRUE(WaitFor([&] { return state("c-000002") == "STATE_SUCCEEDED"; }));
  EXPECT_THAT(ProcessesWith(mark), ::testing::IsEmpty());
}

}  // namespace
}  // namespace rigcal::testing::worker_stopped_test
