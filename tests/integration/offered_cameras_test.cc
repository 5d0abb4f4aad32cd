// SPDX-License-Identifier: Apache-2.0
// A PC without any camera in its configuration: its agent offers what it sees, and cameras are
// chosen at the server, with the real programs.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/testing/process.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing::offered_cameras_test {
namespace {

using nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;

class OfferedCameras : public ::testing::Test {
 protected:
  void StartAgent(const std::string& simulated, std::vector<std::string> more = {}) {
    std::vector<std::string> arguments = {
        "rigcal-agent", "--server",    server_.address(),   "--agent-id", "pc-1",
        "--state-dir",  State("pc-1"), "--offer-simulated", simulated};
    arguments.insert(arguments.end(), more.begin(), more.end());
    agent_ = std::make_unique<Process>(Process::Options{arguments, {}});
  }
  std::string State(const char* agent) const { return (directory_.path() / agent).string(); }
  CommandResult Rigcal(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "rigcal");
    return RunCommand(arguments, {{"RIGCAL_SERVER", server_.address()}});
  }
  void Succeeds(const std::vector<std::string>& arguments, const std::string& output = "") {
    const CommandResult result = Rigcal(arguments);
    EXPECT_EQ(result.exit_code, 0) << result.error << agent_->StandardError();
    EXPECT_THAT(result.output, HasSubstr(output));
  }
  void Refuses(const std::vector<std::string>& arguments, const std::string& why) {
    const CommandResult result = Rigcal(arguments);
    EXPECT_EQ(result.exit_code, 1) << result.output;
    EXPECT_THAT(result.error, HasSubstr(why));
  }
  // "sim-0 USE_FREE , sim-1 ..." of the only agent; "gone": it is not connected.
  std::string Offer() {
    const CommandResult listed = Rigcal({"cameras", "--json"});
    EXPECT_EQ(listed.exit_code, 0) << listed.error;
    const json list = json::parse(listed.output, nullptr, false);
    if (list.is_discarded() || list.value("agents", json::array()).empty()) return "none";
    const json& agent = list.at("agents").at(0);
    if (!agent.value("connected", false)) return "gone";
    std::string text;
    for (const json& camera : agent.value("offered", json::array())) {
      if (camera.at("kind") != "sim") continue;  // what else this PC sees
      text += (text.empty() ? "" : ", ") + camera.at("device").get<std::string>() + " " +
              camera.at("use").get<std::string>() + " " + camera.value("camera", "-");
    }
    return text;
  }
  bool AwaitOffer(const std::string& offer) {
    return WaitFor([&] { return Offer() == offer; });
  }

  const TemporaryDirectory directory_;
  ServerProcess server_{directory_.path() / "store"};
  std::unique_ptr<Process> agent_;
};

TEST_F(OfferedCameras, AreChosenCapturedKeptAndDropped) {
  StartAgent("3;speed=max;duration=30");
  ASSERT_TRUE(AwaitOffer("sim-0 USE_FREE , sim-1 USE_FREE , sim-2 USE_FREE "))
      << Offer() << agent_->StandardError();
  EXPECT_THAT(Rigcal({"cameras"}).output,
              AllOf(HasSubstr("pc-1"), HasSubstr("simulated camera"),
                    HasSubstr("rigcal cameras use pc-1/sim-0 --name NAME")));
  Succeeds({"cameras", "use", "pc-1/sim-0", "--name", "left"}, "camera rig/left is device sim-0");
  Succeeds({"cameras", "use", "sim-1", "--name", "middle"}, "agent pc-1");
  Succeeds({"cameras", "use", "pc-1/sim-2", "--name", "right"});
  const std::string all =
      "sim-0 USE_TAKES_PART left, sim-1 USE_TAKES_PART middle, sim-2 USE_TAKES_PART right";
  ASSERT_TRUE(AwaitOffer(all)) << Offer() << agent_->StandardError();

  Succeeds({"session", "create", "--target", "wand:0,0.13,0.39", "--id", "wave", "--start"});
  Succeeds({"session", "stop", "wave", "--wait"});
  Succeeds({"calibrate", "wave", "--wait"}, "Quality: good");

  agent_->Signal(SIGKILL);
  agent_->Wait();
  ASSERT_TRUE(AwaitOffer("gone")) << Offer();
  Refuses({"cameras", "use", "pc-1/sim-0", "--name", "top"}, "agent 'pc-1' is not connected");
  StartAgent("3;speed=max;duration=30");
  ASSERT_TRUE(AwaitOffer(all)) << Offer() << agent_->StandardError();

  Succeeds({"cameras", "drop", "middle"}, "camera rig/middle takes no part any more");
  ASSERT_TRUE(AwaitOffer("sim-0 USE_TAKES_PART left, sim-1 USE_FREE , sim-2 USE_TAKES_PART right"))
      << Offer();
  Refuses({"cameras", "drop", "middle"}, "no connected agent has chosen a camera 'middle'");
}

TEST_F(OfferedCameras, AreRefusedWithWhatToDo) {
  StartAgent("2", {"--source", "fixed=sim:camera=1"});
  ASSERT_TRUE(AwaitOffer("sim-0 USE_FREE , sim-1 USE_FREE ")) << Offer();
  Refuses({"cameras", "use", "pc-1/7", "--name", "left"}, "it offers sim-0, sim-1");
  Refuses({"cameras", "use", "7", "--name", "left"}, "there are pc-1/sim-0, pc-1/sim-1");
  Refuses({"cameras", "use", "pc-2/sim-0", "--name", "left"}, "agent 'pc-2' is not connected");
  Refuses({"cameras", "use", "pc-1/sim-0", "--name", "fixed"}, "the name 'fixed' is taken");
  Refuses({"cameras", "use", "pc-1/sim-0", "--name", "a/b"}, "camera");
  Refuses({"cameras", "use", "sim-0", "--name", "left", "--calibration", State("no.yaml")},
          "no.yaml");
  const auto wrong = directory_.WriteFile(
      "wrong.yaml",
      "%YAML:1.0\n---\nimage_width: 64\nimage_height: 48\ncamera_matrix: !!opencv-matrix\n"
      "   rows: 3\n   cols: 3\n   dt: d\n   data: [ 60., 0., 32., 0., 60., 24., 0., 0., 1. ]\n"
      "distortion_coefficients: !!opencv-matrix\n   rows: 1\n   cols: 5\n   dt: d\n"
      "   data: [ 0., 0., 0., 0., 0. ]\n");
  Refuses({"cameras", "use", "sim-0", "--name", "left", "--calibration", wrong.string()},
          "the lens file is for images of 64x48");
  Refuses({"cameras", "drop", "fixed"}, "no connected agent has chosen a camera 'fixed'");
  EXPECT_EQ(Offer(), "sim-0 USE_FREE , sim-1 USE_FREE ");

  Succeeds({"cameras", "use", "sim-0", "--name", "left"});
  Refuses({"cameras", "use", "sim-0", "--name", "right"}, "takes part as 'left'");
  Refuses({"cameras", "use", "sim-1", "--name", "left"}, "the name 'left' is device sim-0's");
  Succeeds({"session", "create", "--target", "wand:0,0.13,0.39", "--id", "wave", "--start"});
  Refuses({"cameras", "use", "sim-1", "--name", "right"}, "captures a session now");
  Refuses({"cameras", "drop", "left"}, "captures a session now");
  Succeeds({"session", "stop", "wave", "--wait"});
  Succeeds({"cameras", "use", "sim-1", "--name", "right"});

  // The configuration wins over what was chosen before, and says so.
  agent_->Signal(SIGTERM);
  agent_->Wait();
  ASSERT_TRUE(AwaitOffer("gone"));
  StartAgent("2", {"--source", "left=sim:camera=1"});
  ASSERT_TRUE(AwaitOffer("sim-0 USE_FREE left, sim-1 USE_TAKES_PART right")) << Offer();
  EXPECT_THAT(Rigcal({"cameras"}).output,
              HasSubstr("gives this name to another camera, and that holds"));
}

}  // namespace
}  // namespace rigcal::testing::offered_cameras_test
