// SPDX-License-Identifier: Apache-2.0
// Previews, from a frame of the agent to a file, through the real programs.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

#include "tests/testing/process.h"
#include "tests/testing/server_client.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing::preview_test {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;

class PreviewPrograms : public ::testing::Test {
 protected:
  Process::Options Agent(const std::string& name, const std::string& source,
                         const std::string& config = "") {
    Process::Options options{
        {"rigcal-agent", "--server", server_.address(), "--agent-id", name, "--state-dir",
         (directory_.path() / name).string(), "--source", source},
        {}};
    if (!config.empty()) {
      options.arguments.insert(options.arguments.end(),
                               {"--config", directory_.WriteFile(name + ".toml", config).string()});
    }
    return options;
  }
  bool AwaitAgents(size_t count) {
    return WaitFor([&] {
      const auto agents = ServerClient(server_.address()).ListAgents();
      return agents.ok() && agents->size() == count;
    });
  }
  CommandResult Rigcal(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "rigcal");
    return RunCommand(arguments, {{"RIGCAL_SERVER", server_.address()}});
  }
  CommandResult Preview(const std::string& camera) {
    return Rigcal({"agent", "preview", camera, "--output", File(), "-o", "json"});
  }
  std::string File() const { return (directory_.path() / "now.jpg").string(); }

  const TemporaryDirectory directory_;
  ServerProcess server_{directory_.path() / "store"};
};

TEST_F(PreviewPrograms, ArrivesDuringACaptureWithinTheAgentsLimit) {
  Process agent(Agent("pc", "cam=sim:camera=0;pixels=1",
                      "[preview]\nenabled = true\nmax_kb = 32\nmax_rate_hz = 10\n"));
  ASSERT_TRUE(AwaitAgents(1)) << agent.StandardError();
  const CommandResult idle = Preview("cam");
  EXPECT_EQ(idle.exit_code, 1);
  EXPECT_THAT(idle.error, HasSubstr("only while a session captures"));

  ASSERT_EQ(Rigcal({"session", "create", "--target", "wand:0,0.13,0.39;diameter=0.04;hz=500",
                    "--id", "wave", "--start"})
                .exit_code,
            0);
  CommandResult taken;
  ASSERT_TRUE(WaitFor([&] {
    taken = Preview("cam");
    return taken.exit_code == 0;
  })) << taken.error;
  const json meta = json::parse(taken.output);
  const cv::Mat image = cv::imread(File(), cv::IMREAD_COLOR);
  ASSERT_FALSE(image.empty());
  EXPECT_LE(std::filesystem::file_size(File()), 32u << 10);
  EXPECT_EQ(std::filesystem::file_size(File()), meta.at("info").at("jpeg_bytes"));
  EXPECT_EQ(image.cols, meta.at("info").at("jpeg_size_px").at("width"));
  EXPECT_EQ(image.rows, meta.at("info").at("jpeg_size_px").at("height"));
  EXPECT_EQ(meta.at("info").at("image_size_px").at("width"), 1280);
  EXPECT_EQ(meta.at("agent_id"), "pc");

  const CommandResult unknown = Preview("other");
  EXPECT_EQ(unknown.exit_code, 1);
  EXPECT_THAT(unknown.error, HasSubstr("connected are rig/cam"));
  // Frame counts come with the reports.
  EXPECT_TRUE(WaitFor([&] {
    const json session = json::parse(Rigcal({"session", "get", "wave", "-o", "json"}).output);
    const json& camera = session.at("cameras").at(0);
    return camera.contains("frames") && camera.at("frames").at("received") != "0" &&
           camera.contains("detections");
  }));
}

TEST_F(PreviewPrograms, ReportsPreviewsThatAreOffAndCamerasWithoutFrames) {
  Process silent(Agent("silent", "cam=sim:camera=0;pixels=1"));
  Process blind(Agent("blind", "rows=sim:camera=1", "[preview]\nenabled = true\n"));
  ASSERT_TRUE(AwaitAgents(2)) << silent.StandardError() << blind.StandardError();
  const CommandResult off = Preview("cam");
  EXPECT_EQ(off.exit_code, 1);
  EXPECT_THAT(off.error, HasSubstr("[preview]"));
  const CommandResult none = Preview("rows");
  EXPECT_EQ(none.exit_code, 1);
  EXPECT_THAT(none.error, HasSubstr("has no frames"));
  EXPECT_FALSE(std::filesystem::exists(File()));
}

}  // namespace
}  // namespace rigcal::testing::preview_test
