// SPDX-License-Identifier: Apache-2.0
// `rigcal local` with stand-ins for rigcal-server and rigcal-agent: shell scripts beside it, the
// services themselves in this process. The real programs are tried in tests/integration.
#include "client/local/local_command.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <cerrno>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <sstream>

#include "tests/client/fake_server.h"
#include "tests/client/sample_messages.h"
#include "tests/testing/process.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::client::local_command_test {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using ::rigcal::testing::FakeServer;
using ::rigcal::testing::Process;
using ::rigcal::testing::TrueCalibration;
using ::rigcal::testing::WaitFor;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::StartsWith;

constexpr char kSimulation[] = "cameras=3;duration=2";

class LocalCommand : public ::testing::Test {
 protected:
  LocalCommand() {
    fs::create_directories(Programs());
    fs::create_directories(Temporary());
    WriteProgram("rigcal-server",
                 "port_file=\nwhile [ $# -gt 0 ]; do\n"
                 "  if [ \"$1\" = --port-file ]; then port_file=$2; fi\n  shift\ndone\n"
                 "echo " +
                     std::to_string(fake_.port()) +
                     " > \"$port_file.new\" && mv \"$port_file.new\" \"$port_file\"\n" + kStay);
    WriteProgram("rigcal-agent", kStay);
    for (const SimulatedCamera& camera : world_.cameras()) {
      v1::Agent* agent = fake_.agents.add_agents();
      agent->set_connected(true);
      agent->add_cameras()->set_camera(camera.description.camera);
    }
    fake_.calibrations["cal-new"] = TrueCalibration(world_);
    // Finished once every stand-in has begun.
    fake_.on_get_session = [this](v1::Session& session) {
      const std::string begun = ReadFile("arguments");
      if (std::count(begun.begin(), begun.end(), '\n') < 4) return;
      session.set_state(v1::Session::STATE_FINISHED);
    };
  }

  fs::path Programs() const { return directory_.path() / "bin"; }
  // Where temporary folders go, so that what stays behind is seen.
  fs::path Temporary() const { return directory_.path() / "tmp"; }

  // Every stand-in first writes its process id, name and arguments.
  void WriteProgram(const std::string& name, const std::string& body) {
    const fs::path file = directory_.WriteFile(
        "bin/" + name, "#!/bin/sh\necho $$ >> " + (directory_.path() / "pids").string() +
                           "\necho \"$(basename $0) $*\" >> " +
                           (directory_.path() / "arguments").string() + "\n" + body);
    fs::permissions(file, fs::perms::owner_all);
  }
  std::string ReadFile(const std::string& name) const {
    std::ifstream stream(directory_.path() / name);
    return {std::istreambuf_iterator<char>(stream), {}};
  }
  // Those of the stand-ins that are still there. A zombie that nobody has waited for yet is not.
  std::vector<pid_t> Running() const {
    std::vector<pid_t> running;
    std::istringstream pids(ReadFile("pids"));
    for (pid_t pid = 0; pids >> pid;) {
      std::ifstream stat("/proc/" + std::to_string(pid) + "/stat");
      const std::string text{std::istreambuf_iterator<char>(stat), {}};
      if (!text.empty() && text.find(") Z ") == std::string::npos) running.push_back(pid);
    }
    return running;
  }

  struct Outcome {
    int exit_code = -1;
    std::string out;
    std::string err;
  };
  Outcome Local(OutputFormat format = OutputFormat::kJson, const fs::path& keep = "",
                bool terminal = false) {
    std::ostringstream out, err;
    Console console{.out = out, .err = err, .err_is_terminal = terminal, .format = format};
    CommandContext context{console, "127.0.0.1:1"};
    LocalOptions options;
    options.simulation = *ParseSimulatedRigOptions(kSimulation);
    options.target = *ParseTarget(kDefaultTarget);
    options.keep = keep;
    options.programs = Programs();
    const char* before = getenv("TMPDIR");
    const std::string restore = before == nullptr ? "" : before;
    setenv("TMPDIR", Temporary().c_str(), 1);
    Outcome outcome;
    outcome.exit_code = static_cast<int>(RunLocal(options, context));
    if (before == nullptr) {
      unsetenv("TMPDIR");
    } else {
      setenv("TMPDIR", restore.c_str(), 1);
    }
    outcome.out = out.str();
    outcome.err = err.str();
    EXPECT_THAT(Running(), IsEmpty()) << "processes stay behind";
    EXPECT_TRUE(fs::is_empty(Temporary())) << "files stay behind";
    return outcome;
  }

  // The stand-ins run until they are stopped.
  static constexpr const char* kStay = "echo started\nexec sleep 1000\n";

  const SimulatedWorld world_ = *SimulatedWorld::Create(
      ParseSimulatedRigOptions(kSimulation)->world, *ParseTarget(kDefaultTarget));
  const rigcal::testing::TemporaryDirectory directory_;
  FakeServer fake_;
};

TEST_F(LocalCommand, ComparesWithTheTruthAndLeavesNothingBehind) {
  const Outcome outcome = Local();
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.err, IsEmpty());
  const json calibration = json::parse(outcome.out);
  ASSERT_EQ(calibration.at("ground_truth").at("cameras").size(), 3u);
  EXPECT_EQ(calibration.at("ground_truth").at("cameras").at(2).at("camera"), "sim_2");
  EXPECT_LT(calibration.at("ground_truth").at("max_position_error_m"), 1e-9);
}

TEST_F(LocalCommand, StartsAServerOnAnyPortAndAnAgentPerCamera) {
  ASSERT_EQ(Local().exit_code, 0);
  const std::string arguments = ReadFile("arguments");
  EXPECT_THAT(arguments, HasSubstr("rigcal-server --listen 127.0.0.1:0 --data-dir "));
  for (int i = 0; i < 3; ++i) {
    const std::string name = "sim_" + std::to_string(i);
    EXPECT_THAT(arguments, HasSubstr("rigcal-agent --server " + fake_.address() +
                                     " --agent-id local-" + name + " --state-dir "));
    EXPECT_THAT(arguments, HasSubstr("--source " + name + "=sim:camera=" + std::to_string(i) +
                                     ";seed=1;cameras=3;duration=2;speed=max\n"));
  }
  EXPECT_THAT(fake_.created_session.camera_names(),
              ::testing::ElementsAre("sim_0", "sim_1", "sim_2"));
}

TEST_F(LocalCommand, NoProxyStandsBetweenItsProcesses) {
  WriteProgram("rigcal-agent", "env | grep no_grpc_proxy >> " +
                                   (directory_.path() / "arguments").string() + "\n" + kStay);
  ASSERT_EQ(Local().exit_code, 0);
  EXPECT_THAT(ReadFile("arguments"), HasSubstr("\nno_grpc_proxy=127.0.0.1\n"));
}

TEST_F(LocalCommand, KeepsStoreLogsAndExportAndSaysWhere) {
  const fs::path keep = directory_.path() / "keep this";
  const Outcome outcome = Local(OutputFormat::kTable, keep);
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr(keep.string()));
  for (const char* file : {"store", "logs/server.log", "logs/agent_sim_1.log",
                           "export/calibration.json", "export/sim_2.yaml"}) {
    EXPECT_TRUE(fs::exists(keep / file)) << file;
  }
  // A second run is not mixed into the first.
  const Outcome again = Local(OutputFormat::kTable, keep);
  EXPECT_EQ(again.exit_code, 1);
  EXPECT_THAT(again.err, HasSubstr("not empty"));
}

TEST_F(LocalCommand, TheTableBeginsWithWhatWasCaptured) {
  const Outcome outcome = Local(OutputFormat::kTable);
  EXPECT_THAT(outcome.out, StartsWith("Captured 2.0 s of waving in "));
}

TEST_F(LocalCommand, ShowsProgressOnATerminalOnly) {
  EXPECT_THAT(Local(OutputFormat::kTable, "", /*terminal=*/true).err,
              AllOf(HasSubstr("connecting"), HasSubstr("capturing")));
  EXPECT_THAT(Local(OutputFormat::kTable, "", /*terminal=*/false).err, IsEmpty());
}

TEST_F(LocalCommand, AServerThatDoesNotStartIsQuoted) {
  WriteProgram("rigcal-server", "echo 'no space left for the store' >&2\nexit 1\n");
  const Outcome outcome = Local();
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.err, AllOf(HasSubstr("server"), HasSubstr("exited with code 1"),
                                 HasSubstr("no space left for the store")));
  EXPECT_THAT(outcome.out, IsEmpty());
}

TEST_F(LocalCommand, AnAgentThatDiesIsNamedAndQuoted) {
  WriteProgram("rigcal-agent",
               "case \"$*\" in *camera=1*) echo 'sim_1.csv:17: broken' >&2; exit 1;; esac\n" +
                   std::string(kStay));
  fake_.on_get_session = nullptr;  // it never finishes by itself
  const Outcome outcome = Local();
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.err, AllOf(HasSubstr("agent of camera sim_1"), HasSubstr("code 1"),
                                 HasSubstr("sim_1.csv:17: broken"), Not(HasSubstr("sim_0"))));
}

TEST_F(LocalCommand, ProgramsThatAreMissingAreNamed) {
  fs::remove(Programs() / "rigcal-agent");
  const Outcome outcome = Local();
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.err,
              AllOf(HasSubstr((Programs() / "rigcal-agent").string()), HasSubstr("No such file")));
}

TEST_F(LocalCommand, ATargetTheServerRefusesIsRefusedBeforeAgentsStart) {
  fake_.failures["CreateSession"] =
      grpc::Status(grpc::StatusCode::INVALID_ARGUMENT, "the wand is too long");
  const Outcome outcome = Local();
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.err, HasSubstr("too long"));
  EXPECT_THAT(ReadFile("arguments"), Not(HasSubstr("rigcal-agent")));
}

TEST_F(LocalCommand, AFailedCalibrationIsShownAndExitsWithOne) {
  fake_.calibrations["cal-new"].set_state(v1::Calibration::STATE_FAILED);
  fake_.calibrations["cal-new"].set_error("no overlap");
  const Outcome outcome = Local();
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.err, HasSubstr("no overlap"));
  EXPECT_EQ(json::parse(outcome.out).at("state"), "STATE_FAILED");
}

TEST_F(LocalCommand, BelowTheQualityGateExitsWithThree) {
  fake_.calibrations["cal-new"].mutable_quality()->set_grade(v1::Quality::GRADE_BAD);
  EXPECT_EQ(Local().exit_code, 3);
}

TEST_F(LocalCommand, OwnServerThatVanishesIsAFailureNotAnUnreachableServer) {
  fake_.failures["StartSession"] = grpc::Status(grpc::StatusCode::UNAVAILABLE, "gone");
  EXPECT_EQ(Local().exit_code, 1);
}

// The same through the program itself, copied beside the stand-ins.
class LocalProgram : public LocalCommand {
 protected:
  LocalProgram() {
    fs::copy_file(fs::path(RIGCAL_BIN_DIR) / "rigcal", Programs() / "rigcal");
    fake_.on_get_session = nullptr;  // captures forever
  }
  Process::Options Command() const {
    return {{(Programs() / "rigcal").string(), "local", "--simulate", kSimulation},
            {{"TMPDIR", Temporary().string()}}};
  }
  // And every stand-in has begun: a server and three agents.
  bool Captures() {
    if (Running().size() != 4) return false;
    const std::lock_guard lock(fake_.mutex);
    return fake_.sessions["made"].state() == v1::Session::STATE_CAPTURING;
  }
};

TEST_F(LocalProgram, CleansUpAfterASignalAndDiesOfIt) {
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    {
      const std::lock_guard lock(fake_.mutex);
      fake_.sessions.clear();
    }
    Process process(Command());
    ASSERT_TRUE(WaitFor([&] { return Captures(); })) << process.StandardError();
    process.Signal(signal);
    EXPECT_EQ(process.Wait(), 128 + signal);
    EXPECT_THAT(Running(), IsEmpty());
    EXPECT_TRUE(fs::is_empty(Temporary()));
    EXPECT_THAT(process.StandardError(), HasSubstr("interrupted"));
  }
}

TEST_F(LocalProgram, LeavesNoProcessWhenItIsKilled) {
  Process process(Command());
  ASSERT_TRUE(WaitFor([&] { return Captures(); })) << process.StandardError();
  process.Signal(SIGKILL);
  process.Wait();
  EXPECT_TRUE(WaitFor([&] { return Running().empty(); }));
  // Its folder is all that stays, until the next run.
  EXPECT_FALSE(fs::is_empty(Temporary()));
  {
    const std::lock_guard lock(fake_.mutex);
    fake_.on_get_session = [](v1::Session& session) {
      session.set_state(v1::Session::STATE_FINISHED);
    };
  }
  EXPECT_EQ(Local().exit_code, 0);
}

TEST_F(LocalProgram, AServerKilledInTheMiddleIsReported) {
  Process process(Command());
  ASSERT_TRUE(WaitFor([&] { return Captures(); })) << process.StandardError();
  std::istringstream pids(ReadFile("pids"));
  pid_t server = 0;
  pids >> server;
  kill(server, SIGKILL);
  EXPECT_EQ(process.Wait(), 1);
  EXPECT_THAT(process.StandardError(), AllOf(HasSubstr("the server"), HasSubstr("signal 9")));
  EXPECT_THAT(Running(), IsEmpty());
}

}  // namespace
}  // namespace rigcal::client::local_command_test
