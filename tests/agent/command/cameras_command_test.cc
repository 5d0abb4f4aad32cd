// SPDX-License-Identifier: Apache-2.0
// `rigcal-agent cameras`, with Aravis' fake camera.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "agent/command/subcommands.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::agent::cameras_command_test {
namespace {

using ::rigcal::testing::StatusIs;
using ::testing::HasSubstr;

absl::StatusOr<std::string> RunCameras(const std::vector<std::string>& arguments) {
  CLI::App app;
  std::ostringstream out;
  Subcommands subcommands(out);
  subcommands.AddTo(app);
  std::vector<std::string> reversed(arguments.rbegin(), arguments.rend());
  reversed.push_back("cameras");
  app.parse(std::move(reversed));
  if (const absl::Status status = subcommands.Chosen()(); !status.ok()) return status;
  return out.str();
}

// Other cameras may answer in the network of whoever runs the test.
nlohmann::json FakeOf(const std::string& text) {
  for (const auto& camera : nlohmann::json::parse(text)) {
    if (camera["device"] == "Fake_1") return camera;
  }
  return {};
}

TEST(CamerasCommand, ListsAFreeCameraWithWhatItSaysOfItself) {
  const testing::TemporaryDirectory folder;
  const std::string config = folder.WriteFile("agent.toml", "").string();
  ASSERT_OK_AND_ASSIGN(const std::string json,
                       RunCameras({"--fake", "--json", "--config", config}));
  const nlohmann::json fake = FakeOf(json);
  ASSERT_TRUE(fake.is_object()) << json;
  EXPECT_EQ(fake["vendor"], "Aravis");
  EXPECT_EQ(fake["model"], "Fake");
  EXPECT_EQ(fake["source"], "aravis:Fake_1");
  EXPECT_EQ(fake["state"], "free");
  EXPECT_EQ(fake["camera"], "");
  ASSERT_OK_AND_ASSIGN(const std::string table, RunCameras({"--fake", "--config", config}));
  EXPECT_THAT(table, HasSubstr("takes part as\n"));
  EXPECT_THAT(table, HasSubstr("To use one: rigcal-agent --source"));
}

TEST(CamerasCommand, NamesCamerasOfTheConfiguration) {
  const testing::TemporaryDirectory folder;
  const std::string config =
      folder.WriteFile("agent.toml", "[[camera]]\nname = \"left\"\nsource = \"aravis:Fake_1\"\n")
          .string();
  ASSERT_OK_AND_ASSIGN(const std::string json,
                       RunCameras({"--fake", "--json", "--config", config}));
  EXPECT_EQ(FakeOf(json)["camera"], "left");
  const std::string short_form =
      folder.WriteFile("short.toml", "[[camera]]\nsource = \"right=aravis:Fake_1;gain=2\"\n")
          .string();
  ASSERT_OK_AND_ASSIGN(const std::string other,
                       RunCameras({"--fake", "--json", "--config", short_form}));
  EXPECT_EQ(FakeOf(other)["camera"], "right");
}

TEST(CamerasCommand, SaysWhatIsWrong) {
  const testing::TemporaryDirectory folder;
  EXPECT_THAT(RunCameras({"--config", (folder.path() / "none.toml").string()}).status(),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("none.toml")));
  const std::string config = folder.WriteFile("agent.toml", "").string();
  EXPECT_THAT(RunCameras({"--interface", "no_such_card", "--config", config}).status(),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("no_such_card")));
}

}  // namespace
}  // namespace rigcal::agent::cameras_command_test
