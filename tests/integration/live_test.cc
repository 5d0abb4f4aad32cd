// SPDX-License-Identifier: Apache-2.0
// The live state of real programs: simulated agents, a server, `rigcal watch`.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>
#include <pty.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "rigcal/v1/live_service.grpc.pb.h"
#include "tests/testing/process.h"
#include "tests/testing/server_client.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing::live_test {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::SizeIs;

class Live : public ::testing::Test {
 protected:
  static constexpr double kRateHz = 50;
  // Of waving; at most so much until an alert says what is wrong.
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
    EXPECT_THAT(created.output, HasSubstr("expected error below 0.001 mm, not before 20"));
  }
  v1::LiveState Get(const std::string& since = "") {
    grpc::ClientContext context;
    v1::GetLiveRequest request;
    request.set_since_revision(since);
    v1::GetLiveResponse response;
    stub_->GetLive(&context, request, &response);
    return response.live();
  }
  // Waits for the alert, and says how many seconds of the other cameras' data there were until
  // then, from the first that shows the wand on. A machine that stands still has no data either.
  double SecondsOfWavingUntil(const std::string& alert) {
    const auto seconds = [](const v1::LiveState& live) {
      return static_cast<double>(live.cameras(0).observation_count()) / kRateHz;
    };
    v1::LiveState live;
    EXPECT_TRUE(WaitFor([&] {
      live = Get();
      return live.cameras_size() == 4 && live.cameras(0).wand_count() > 0;
    })) << live.DebugString();
    const double begin_s = seconds(live);
    EXPECT_TRUE(WaitFor([&] {
      live = Get();
      return Alerts(live).contains(alert);
    })) << live.DebugString();
    return seconds(live) - begin_s;
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

TEST_F(Live, ShowsCamerasOverlapAndWhoSeesNothing) {
  StartAgent(";dropouts=1");
  StartWave();
  EXPECT_LE(SecondsOfWavingUntil("no_wand sim_3"), kAlertLimitS);
  v1::LiveState live = Get();
  EXPECT_THAT(Alerts(live), SizeIs(1)) << live.alerts().DebugString();
  for (int i = 0; i < 3; ++i) {
    const v1::LiveCamera& camera = live.cameras(i);
    EXPECT_EQ(camera.state(), v1::LiveCamera::STATE_CAPTURING);
    EXPECT_GT(camera.observation_rate_hz(), 0);
    EXPECT_GT(camera.wand_count(), 0u);
    EXPECT_GT(camera.trail_size(), 0);
    EXPECT_GT(camera.shared_instant_count(), 0u);
    EXPECT_GT(camera.coverage().covered_share(), 0);
  }
  EXPECT_EQ(live.cameras(3).wand_count(), 0u);
  ASSERT_THAT(live.overlap().counts(), SizeIs(6));
  EXPECT_GT(live.overlap().counts(0), 0u);  // sim_0, sim_1
  EXPECT_EQ(live.overlap().counts(2), 0u);  // sim_0, sim_3
  EXPECT_FALSE(live.goal().reached());
  EXPECT_THAT(live.goal().why_not(), Not(::testing::IsEmpty()));

  // Deltas add up to the whole.
  v1::LiveState delta;
  ASSERT_TRUE(WaitFor([&] {
    delta = Get(live.revision());
    return delta.cameras_size() == 4;
  }));
  EXPECT_FALSE(delta.full());
  EXPECT_LT(delta.ByteSizeLong(), size_t{1} << 20);

  // Lines for programs, until the session has finished.
  Process watch(
      {{"rigcal", "watch", "--session", "wave", "-o", "json", "--server", server_->address()}, {}});
  ASSERT_TRUE(WaitFor([&] { return watch.StandardOutput().find('\n') != std::string::npos; }));
  const CommandResult stopped = Rigcal({"session", "stop", "wave", "--wait"});
  EXPECT_EQ(stopped.exit_code, 0) << stopped.error;
  EXPECT_EQ(watch.Wait(), 0) << watch.StandardError();
  const std::string output = watch.StandardOutput();
  const auto first = nlohmann::json::parse(output.substr(0, output.find('\n')));
  EXPECT_EQ(first.at("session").at("id"), "wave");
  EXPECT_EQ(first.at("cameras").size(), 4u);
}

TEST_F(Live, TellsOfAClockThatIsOff) {
  StartAgent(";offset.3=-3");
  StartWave();
  EXPECT_LE(SecondsOfWavingUntil("clock_off sim_3"), kAlertLimitS);
}

TEST_F(Live, TellsOfASecondWand) {
  StartAgent(";second_wand.3=0.4");
  StartWave();
  EXPECT_LE(SecondsOfWavingUntil("two_wands sim_3"), kAlertLimitS);
  EXPECT_THAT(Alerts(Get()), Not(Contains("two_wands sim_0")));
}

TEST_F(Live, WhoeverStartsOrStopsSecondIsTold) {
  StartAgent("");
  StartWave();
  const auto expect_told = [](const CommandResult& result, const std::string& since) {
    EXPECT_NE(result.exit_code, 0);
    EXPECT_THAT(result.error, HasSubstr(since));
  };
  // Another session with the same cameras, by somebody who did not see that one runs.
  expect_told(Rigcal({"session", "create", "--target", "wand:0,0.13,0.39", "--start"}),
              "takes part in session 'wave', which is capturing since 20");
  ASSERT_EQ(Rigcal({"session", "stop", "wave", "--wait"}).exit_code, 0);
  expect_told(Rigcal({"session", "start", "wave"}),
              "it has been stopped already and is finished since 20");
  const CommandResult again = Rigcal({"session", "stop", "wave"});
  EXPECT_EQ(again.exit_code, 0) << "it is as they wanted it";
  EXPECT_THAT(again.error, HasSubstr("session wave had been stopped already, at 20"));
}

TEST_F(Live, WatchSurvivesARestartOfTheServer) {
  StartAgent("");
  StartWave();
  Process watch({{"rigcal", "watch", "--server", server_->address()}, {}});
  const auto says = [&](const std::string& text, const std::string& where) {
    return where.find(text) != std::string::npos;
  };
  ASSERT_TRUE(WaitFor([&] { return says("session wave capturing", watch.StandardOutput()); }));
  const std::string revision = Get().revision();
  const int port = server_->port();
  server_->process().Signal(SIGKILL);
  server_->process().Wait();
  ASSERT_TRUE(WaitFor([&] { return says("the server has not answered", watch.StandardError()); }));
  const size_t before = watch.StandardOutput().size();
  server_ = std::make_unique<ServerProcess>(directory_.path() / "store", port);
  OpenStub();
  ASSERT_TRUE(WaitFor([&] {
    return says("session wave capturing", watch.StandardOutput().substr(before));
  })) << watch.StandardError();
  const v1::LiveState live = Get(revision);
  EXPECT_TRUE(live.full());
  EXPECT_EQ(live.session().id(), "wave");
  EXPECT_GT(live.cameras(0).observation_count(), 0u);
  watch.Signal(SIGTERM);
  EXPECT_EQ(watch.Wait(), 128 + SIGTERM);
}

// On a terminal: shows, stops by a key, leaves the terminal as it was.
TEST_F(Live, WatchOnATerminal) {
  StartAgent("");
  StartWave();
  int terminal = -1;
  const winsize size{.ws_row = 30, .ws_col = 100, .ws_xpixel = 0, .ws_ypixel = 0};
  const std::string program = RIGCAL_BIN_DIR "/rigcal";
  const std::string address = server_->address();
  const pid_t child = forkpty(&terminal, nullptr, nullptr, &size);
  if (child == 0) {
    setenv("TERM", "xterm", 1);
    execl(program.c_str(), "rigcal", "watch", "--server", address.c_str(), nullptr);
    _exit(127);
  }
  ASSERT_GT(child, 0);
  fcntl(terminal, F_SETFL, O_NONBLOCK);
  std::string shown;
  const auto read_on = [&] {
    char buffer[4096];
    ssize_t count = 0;
    while ((count = read(terminal, buffer, sizeof(buffer))) > 0) {
      shown.append(buffer, static_cast<size_t>(count));
    }
  };
  const auto shows = [&](const std::string& text) {
    return WaitFor([&] {
      read_on();
      return shown.find(text) != std::string::npos;
    });
  };
  EXPECT_TRUE(shows("session wave capturing")) << shown;
  EXPECT_TRUE(shows("sim_3")) << shown;
  EXPECT_THAT(shown, HasSubstr("\x1b[?1049h"));
  ASSERT_EQ(write(terminal, "s", 1), 1);
  EXPECT_TRUE(shows("session wave stopped at")) << shown;
  EXPECT_TRUE(WaitFor([&] {
    return ServerClient(server_->address()).GetSession("wave")->state() !=
           v1::Session::STATE_CAPTURING;
  }));
  ASSERT_EQ(write(terminal, "q", 1), 1);
  EXPECT_TRUE(shows("\x1b[?25h\x1b[?1049l")) << shown;
  int status = 0;
  EXPECT_TRUE(WaitFor([&] {
    read_on();
    return waitpid(child, &status, WNOHANG) == child;
  }));
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0);
  close(terminal);
}

}  // namespace
}  // namespace rigcal::testing::live_test
