// SPDX-License-Identifier: Apache-2.0
// Wrong use of the programs, and their messages.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>
#include <string>

#include "tests/testing/process.h"
#include "tests/testing/server_client.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing::bad_use_test {
namespace {

using ::testing::AllOf;
using ::testing::AnyOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class BadUse : public ::testing::Test {
 protected:
  Process::Options Agent(const std::string& name, const std::string& source) const {
    return {{"rigcal-agent", "--server", server_.address(), "--agent-id", name, "--state-dir",
             (directory_.path() / name).string(), "--source", source},
            {}};
  }
  size_t ConnectedCount() {
    size_t count = 0;
    const auto agents = ServerClient(server_.address()).ListAgents();
    if (!agents.ok()) return 0;
    for (const v1::Agent& agent : *agents) count += agent.connected() ? 1 : 0;
    return count;
  }
  CommandResult Rigcal(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "rigcal");
    return RunCommand(arguments, {{"RIGCAL_SERVER", server_.address()}});
  }

  const TemporaryDirectory directory_;
  ServerProcess server_{directory_.path() / "store"};
};

TEST_F(BadUse, SecondAgentWithATakenCameraIsRefusedNamingBoth) {
  Process first(Agent("pc-left", "sim:camera=0"));
  ASSERT_TRUE(WaitFor([&] { return ConnectedCount() == 1; })) << first.StandardError();
  Process second(Agent("pc-right", "sim:camera=0"));
  ASSERT_TRUE(WaitFor([&] {
    const std::string error = second.StandardError();
    return error.find("pc-left") != std::string::npos && error.find("sim_0") != std::string::npos;
  })) << second.StandardError();
  EXPECT_EQ(ConnectedCount(), 1u);
  EXPECT_TRUE(first.Running());
}

TEST_F(BadUse, RestartedAgentReplacesItsFrozenPredecessor) {
  auto first = std::make_unique<Process>(Agent("pc", "sim:camera=0"));
  ASSERT_TRUE(WaitFor([&] { return ConnectedCount() == 1; }));
  // Killed while the server still counts it as connected, and restarted at once.
  first->Signal(SIGKILL);
  first->Wait();
  Process second(Agent("pc", "sim:camera=0"));
  ASSERT_TRUE(WaitFor([&] {
    const auto agents = ServerClient(server_.address()).ListAgents();
    return agents.ok() && agents->size() == 1 && agents->at(0).connected() &&
           agents->at(0).incarnation() == 2;
  })) << second.StandardError();
}

TEST_F(BadUse, SessionThatDoesNotExistIsNamed) {
  for (const char* verb : {"start", "stop", "get", "delete"}) {
    const CommandResult result = Rigcal({"session", verb, "nobody"});
    EXPECT_EQ(result.exit_code, 1) << verb;
    EXPECT_THAT(result.error, HasSubstr("nobody")) << verb;
    EXPECT_THAT(result.output, IsEmpty()) << verb;
  }
  EXPECT_THAT(Rigcal({"calibrate", "nobody"}).error, HasSubstr("nobody"));
  EXPECT_THAT(Rigcal({"calibration", "get", "nobody"}).error, HasSubstr("nobody"));
}

TEST_F(BadUse, SessionWithoutAnyAgentSaysSo) {
  const CommandResult created =
      Rigcal({"session", "create", "--target", "wand:0,0.13,0.39", "--id", "lonely"});
  ASSERT_EQ(created.exit_code, 0) << created.error;
  const CommandResult started = Rigcal({"session", "start", "lonely"});
  EXPECT_EQ(started.exit_code, 1);
  EXPECT_THAT(started.error, HasSubstr("camera"));
}

TEST_F(BadUse, PortInUseIsNamed) {
  const CommandResult result = RunCommand({"rigcal-server", "--listen", server_.address(),
                                           "--data-dir", (directory_.path() / "other").string()});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.error, HasSubstr(server_.address()));
}

TEST_F(BadUse, DataDirectoryInUseIsNamed) {
  const std::string store = (directory_.path() / "store").string();
  const CommandResult result =
      RunCommand({"rigcal-server", "--listen", "127.0.0.1:0", "--data-dir", store});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.error, HasSubstr(store));
}

TEST_F(BadUse, PointOfMoreThanOneMarkerIsRefused) {
  const CommandResult result =
      Rigcal({"session", "create", "--target", "point:0,0.1", "--id", "p", "--start"});
  EXPECT_NE(result.exit_code, 0);
  EXPECT_THAT(result.error, HasSubstr("point"));
}

TEST_F(BadUse, DistanceBesideAWandIsRefused) {
  Process first(Agent("a", "sim:camera=0;cameras=2;duration=2;speed=max"));
  Process second(Agent("b", "sim:camera=1;cameras=2;duration=2;speed=max"));
  ASSERT_TRUE(WaitFor([&] { return ConnectedCount() == 2; }));
  ASSERT_EQ(Rigcal({"session", "create", "--target", "wand:0,0.13,0.39", "--id", "p", "--start"})
                .exit_code,
            0);
  ASSERT_THAT(ServerClient(server_.address()).WaitUntilFinished("p"), IsOk());
  const CommandResult result =
      Rigcal({"calibrate", "p", "--wait", "--distance", "sim_0,sim_1,2.5"});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.output + result.error, AllOf(HasSubstr("wand"), HasSubstr("distance")));
}

TEST(ServerUnreachable, ExitsWithSixAndTheAddress) {
  const CommandResult result = RunCommand({"rigcal", "session", "list", "--server", "127.0.0.1:1"});
  EXPECT_EQ(result.exit_code, 6);
  EXPECT_THAT(result.error, HasSubstr("127.0.0.1:1"));
}

TEST(Usage, ExitsWithTwo) {
  EXPECT_EQ(RunCommand({"rigcal", "no-such-command"}).exit_code, 2);
  EXPECT_EQ(RunCommand({"rigcal", "session", "create"}).exit_code, 2);
  EXPECT_EQ(RunCommand({"rigcal", "local"}).exit_code, 2);
}

// Each would end the program that parses it.
TEST(Configuration, AFileOfFiftyThousandLevelsIsRefusedByEveryProgram) {
  const TemporaryDirectory directory;
  std::string dots, brackets;
  for (int i = 0; i < 50'000; ++i) {
    dots += ".a";
    brackets += "[";
  }
  const auto write = [&](const char* name, const std::string& text) {
    return directory.WriteFile(name, text).string();
  };
  const std::string store = (directory.path() / "store").string();
  const std::string state = (directory.path() / "state").string();
  const std::string toml = write("deep.toml", "[a" + dots + "]\n");
  const std::vector<std::vector<std::string>> commands = {
      {"rigcal-server", "--config", toml, "--data-dir", store},
      {"rigcal-agent", "--config", toml, "--state-dir", state, "--source", "sim:camera=0"},
      {"rigcal-agent", "join", "rk1.x", "--config", toml},
      {"rigcal", "calibration", "import", toml, "--output", store},
      {"rigcal", "calibration", "import", write("deep.yaml", "cam0: " + brackets), "--output",
       store},
      {"rigcal", "calibration", "import", write("deep.json", "{\"a\": " + brackets), "--output",
       store},
      {"rigcal-agent", "--state-dir", state, "--source",
       "sim:camera=0;calibration=" + write("lens.yaml", "%YAML:1.0\na: " + brackets)},
  };
  for (const std::vector<std::string>& command : commands) {
    const CommandResult result = RunCommand(command);
    EXPECT_THAT(result.exit_code, AnyOf(1, 2))
        << command[0] << " " << command[1] << " " << result.error;
  }
}

TEST(Configuration, UnknownKeyNamesFileAndLine) {
  const TemporaryDirectory directory;
  const auto file =
      directory.WriteFile("server.toml", "listen = \"127.0.0.1:0\"\ndata_dri = \"x\"\n");
  const CommandResult result = RunCommand({"rigcal-server", "--config", file.string()});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.error, AllOf(HasSubstr("server.toml:2"), HasSubstr("data_dri")));
}

}  // namespace
}  // namespace rigcal::testing::bad_use_test
