// SPDX-License-Identifier: Apache-2.0
// The live state of real programs: simulated agents, a server, `rigcal watch`.
#include <fcntl.h>
#include <gmock/gmock.h>
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
#include "tests/integration/live_rig.h"
#include "tests/testing/process.h"
#include "tests/testing/server_client.h"

namespace rigcal::testing::live_test {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::SizeIs;

using Live = LiveRig;

TEST_F(Live, ShowsCamerasOverlapAndWhoSeesNothing) {
  StartAgent(";dropouts=1");
  StartWave();
  v1::LiveState live;
  ASSERT_TRUE(WaitFor([&] {
    live = Get();
    return Alerts(live).contains("no_wand sim_3");
  })) << live.DebugString();
  // Whether a busy machine keeps up is not asked here.
  std::set<std::string> alerts = Alerts(live);
  std::erase_if(alerts, [](const std::string& alert) {
    return alert.starts_with("backlog_growing ") || alert.starts_with("rate_low ");
  });
  EXPECT_THAT(alerts, SizeIs(1)) << live.alerts().DebugString();
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
  EXPECT_TRUE(shows("y stops it")) << shown;
  ASSERT_EQ(write(terminal, "y", 1), 1);
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
