// SPDX-License-Identifier: Apache-2.0
// What a server has of a session is written as a recorded rig, calibrated and triangulated again.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "tests/testing/process.h"
#include "tests/testing/server_client.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing::observations_round_trip_test {
namespace {

using ::testing::HasSubstr;
using json = nlohmann::json;

constexpr char kWand[] = "wand:0,0.13,0.39";

size_t LineCount(const std::filesystem::path& path) {
  std::ifstream file(path);
  size_t count = 0;
  for (std::string line; std::getline(file, line);) ++count;
  return count;
}

TEST(ObservationsRoundTrip, LocalAndTriangulateReadWhatWasWritten) {
  const TemporaryDirectory directory;
  const ServerProcess server(directory.path() / "store");
  const auto rigcal = [&](std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "rigcal");
    return RunCommand(arguments, {{"RIGCAL_SERVER", server.address()}});
  };
  std::vector<std::unique_ptr<Process>> agents;
  for (int i = 0; i < 3; ++i) {
    agents.push_back(std::make_unique<Process>(Process::Options{
        {"rigcal-agent", "--server", server.address(), "--agent-id", absl::StrCat("pc-", i),
         "--state-dir", (directory.path() / absl::StrCat("agent", i)).string(), "--source",
         absl::StrCat("sim:camera=", i, ";cameras=3;duration=20;speed=max")},
        {}}));
  }
  ServerClient client(server.address());
  ASSERT_TRUE(WaitFor([&] {
    const auto list = client.ListAgents();
    return list.ok() && list->size() == 3;
  }));
  const CommandResult created =
      rigcal({"session", "create", "--target", kWand, "--id", "wave", "--start"});
  ASSERT_EQ(created.exit_code, 0) << created.error;
  EXPECT_THAT(created.error, HasSubstr("wave now; stop with: rigcal session stop wave"));
  ASSERT_THAT(client.WaitUntilFinished("wave"), IsOk());
  const CommandResult first = rigcal({"calibrate", "wave", "--wait"});
  ASSERT_EQ(first.exit_code, 0) << first.error;
  EXPECT_THAT(first.error, HasSubstr("rigcal rig activate c-000001"));

  const std::filesystem::path folder = directory.path() / "rig";
  const CommandResult written =
      rigcal({"session", "observations", "wave", "--output", folder.string(), "-o", "json"});
  ASSERT_EQ(written.exit_code, 0) << written.error;
  EXPECT_EQ(json::parse(written.output)["files"].size(), 6u);
  const auto session = client.GetSession("wave");
  ASSERT_THAT(session, IsOk());
  size_t rows = 0;
  for (const v1::SessionCamera& camera : session->cameras()) {
    rows += LineCount(folder / (camera.description().camera() + ".csv"));
  }
  EXPECT_EQ(rows, session->observation_count());

  // Nothing is replaced unless it is asked for.
  const CommandResult again =
      rigcal({"session", "observations", "wave", "--output", folder.string()});
  EXPECT_EQ(again.exit_code, 1);
  EXPECT_THAT(again.error, HasSubstr("--force"));
  EXPECT_EQ(
      rigcal({"session", "observations", "wave", "--output", folder.string(), "--force"}).exit_code,
      0);

  const CommandResult second =
      rigcal({"local", "--data", folder.string(), "--target", kWand, "-o", "json"});
  ASSERT_EQ(second.exit_code, 0) << second.error;
  const json result = json::parse(second.output);
  EXPECT_EQ(result["cameras"].size(), 3u);
  EXPECT_EQ(result["quality"]["grade"], "GRADE_GOOD");

  const std::string points = (directory.path() / "points.csv").string();
  const CommandResult triangulated =
      rigcal({"triangulate", "c-000001", "--data", folder.string(), "--output", points});
  ASSERT_EQ(triangulated.exit_code, 0) << triangulated.error;
  EXPECT_GT(LineCount(points), 300u);
  const CommandResult kept =
      rigcal({"triangulate", "c-000001", "--data", folder.string(), "--output", points});
  EXPECT_EQ(kept.exit_code, 1);
  EXPECT_THAT(kept.error, HasSubstr("--force"));
}

}  // namespace
}  // namespace rigcal::testing::observations_round_trip_test
