// SPDX-License-Identifier: Apache-2.0
// Mask and colour learnt on a running agent, asked for by a client, through the real programs.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/testing/process.h"
#include "tests/testing/server_client.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing::detector_test {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;

class DetectorPrograms : public ::testing::Test {
 protected:
  Process::Options Agent() {
    return {{"rigcal-agent", "--server", server_.address(), "--agent-id", "pc", "--state-dir",
             (directory_.path() / "pc").string(), "--source", "cam=sim:camera=0;pixels=1;clutter=1",
             "--source", "rows=sim:camera=1"},
            {}};
  }
  bool AwaitConnected(bool connected) {
    return WaitFor([&] {
      const auto agents = ServerClient(server_.address()).ListAgents();
      return agents.ok() && !agents->empty() && agents->front().connected() == connected;
    });
  }
  CommandResult Rigcal(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "rigcal");
    return RunCommand(arguments, {{"RIGCAL_SERVER", server_.address()}});
  }
  json Detector() {
    const CommandResult result = Rigcal({"camera", "detector", "cam", "-o", "json"});
    EXPECT_EQ(result.exit_code, 0) << result.error;
    return result.exit_code == 0 ? json::parse(result.output).at("detector") : json();
  }
  void Refuses(const std::vector<std::string>& arguments, const std::string& why) {
    const CommandResult result = Rigcal(arguments);
    EXPECT_EQ(result.exit_code, 1) << result.output;
    EXPECT_THAT(result.error, HasSubstr(why));
  }
  void StartSession(const std::string& id) {
    const CommandResult result =
        Rigcal({"session", "create", "--target", "wand:0,0.13,0.39;diameter=0.04;hz=500", "--id",
                id, "--start"});
    ASSERT_EQ(result.exit_code, 0) << result.error;
  }

  const TemporaryDirectory directory_;
  ServerProcess server_{directory_.path() / "store"};
};

TEST_F(DetectorPrograms, MaskAndColourAreLearntWhileASessionCapturesAndAreKept) {
  Process agent(Agent());
  ASSERT_TRUE(AwaitConnected(true)) << agent.StandardError();
  EXPECT_FALSE(Detector().at("colour_learnt").get<bool>());
  Refuses({"camera", "mask", "cam"}, "only while a session captures");
  Refuses({"camera", "mask", "other"}, "connected are rig/cam");
  Refuses({"camera", "tune", "rows"}, "has no frames");

  StartSession("wave");
  CommandResult mask;
  ASSERT_TRUE(WaitFor([&] {
    mask = Rigcal({"camera", "mask", "cam", "--frames", "8"});
    return mask.exit_code == 0;
  })) << mask.error;
  EXPECT_THAT(mask.output, HasSubstr("learnt from 8 frames"));
  EXPECT_TRUE(Detector().at("mask_learnt").get<bool>());
  CommandResult tuned;
  // In some of the frames the simulated wand is out of this camera's view.
  ASSERT_TRUE(WaitFor([&] {
    tuned = Rigcal({"camera", "tune", "cam", "--frames", "5"});
    return tuned.exit_code == 0;
  })) << tuned.error;
  EXPECT_TRUE(Detector().at("colour_learnt").get<bool>());
  Refuses({"camera", "mask", "cam", "--frames", "1001"}, "at most 1000");
  EXPECT_EQ(Rigcal({"session", "stop", "wave"}).exit_code, 0);
  const json before = Detector();

  agent.Signal(SIGTERM);
  agent.Wait();
  ASSERT_TRUE(AwaitConnected(false));
  Refuses({"camera", "detector", "cam"}, "is not connected");
  Process again(Agent());
  ASSERT_TRUE(AwaitConnected(true)) << again.StandardError();
  const json after = Detector();
  EXPECT_EQ(after.at("colour"), before.at("colour"));
  EXPECT_EQ(after.at("ignored_pixel_count"), before.at("ignored_pixel_count"));
  EXPECT_TRUE(after.at("mask_learnt").get<bool>());
  ASSERT_EQ(Rigcal({"camera", "mask", "cam", "--clear"}).exit_code, 0);
  ASSERT_EQ(Rigcal({"camera", "colour", "cam", "--reset"}).exit_code, 0);
  const json reset = Detector();
  EXPECT_FALSE(reset.at("mask_learnt").get<bool>());
  EXPECT_FALSE(reset.at("colour_learnt").get<bool>());
  EXPECT_TRUE(std::filesystem::is_empty(directory_.path() / "pc" / "detectors"));
}

}  // namespace
}  // namespace rigcal::testing::detector_test
