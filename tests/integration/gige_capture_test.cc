// SPDX-License-Identifier: Apache-2.0
// A GigE Vision camera of 1280 x 1024 pixels at 50 Hz over the real protocol on loopback: every
// frame sent is accounted for, and nearly all arrive complete, with and without privileges.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <unistd.h>

#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "tests/testing/process.h"

namespace rigcal::testing::gige_capture_test {
namespace {

using ::testing::HasSubstr;

// "received 7 lost 0" as a map.
std::map<std::string, uint64_t> Counts(const std::string& line) {
  std::map<std::string, uint64_t> counts;
  std::istringstream words(line);
  std::string name;
  uint64_t value = 0;
  while (words >> name >> value) counts[name] = value;
  return counts;
}

void CaptureForTwentySeconds(std::vector<std::string> as_user, bool may_have_raw_sockets) {
  Process camera({.arguments = {"rigcal-fake-gige-camera"}, .environment = {}});
  ASSERT_TRUE(WaitFor([&] {
    return camera.StandardOutput().find("ready") != std::string::npos || !camera.Running();
  })) << camera.StandardError();
  ASSERT_THAT(camera.StandardOutput(), HasSubstr("ready")) << camera.StandardError();

  std::vector<std::string> arguments = std::move(as_user);
  for (const char* argument : {RIGCAL_BIN_DIR "/rigcal-gige-capture", "--seconds", "20"}) {
    arguments.emplace_back(argument);
  }
  const CommandResult capture = RunCommand(arguments);
  camera.Signal(SIGINT);
  ASSERT_EQ(camera.Wait(), 0) << camera.StandardError();
  ASSERT_EQ(capture.exit_code, 0) << capture.error;
  std::string sent_line = camera.StandardOutput();
  sent_line.erase(0, sent_line.find("sent"));
  auto sent = Counts(sent_line);
  auto counts = Counts(capture.output);
  SCOPED_TRACE(capture.output + sent_line + capture.error);
  std::printf("%s%s", capture.output.c_str(), sent_line.c_str());

  if (!may_have_raw_sockets) {
    EXPECT_EQ(counts["cap_net_raw"], 0u);
  }
  // 50 per second for 20 s; the camera sends fewer on a busy machine.
  EXPECT_GE(sent["sent"], 500u);
  EXPECT_EQ(counts["received"] + counts["damaged"] + counts["lost"], sent["sent"]);
  EXPECT_GE(100 * counts["received"], 99 * sent["sent"]);
  EXPECT_LE(counts["received"] - counts["yielded"], 32u);  // still in the buffers at the end
  EXPECT_EQ(counts["wrong"], 0u);
  EXPECT_EQ(counts["reconnects"], 0u);
}

TEST(GigeCapture, AccountsForEveryFrameAsThisUser) {
  CaptureForTwentySeconds({}, /*may_have_raw_sockets=*/true);
}

TEST(GigeCapture, AccountsForEveryFrameWithoutPrivileges) {
  if (geteuid() != 0) GTEST_SKIP() << "not root: the other case covers this one";
  CaptureForTwentySeconds({"/usr/bin/setpriv", "--reuid=65534", "--regid=65534", "--clear-groups",
                           "--inh-caps=-all", "--bounding-set=-all"},
                          /*may_have_raw_sockets=*/false);
}

TEST(GigeCapture, SilentCameraIsReportedOnce) {
  const CommandResult capture =
      RunCommand({"rigcal-gige-capture", "--device", "127.0.0.77", "--interface", "lo"});
  EXPECT_EQ(capture.exit_code, 1);
  EXPECT_THAT(capture.error, HasSubstr("no camera answers at 127.0.0.77"));
}

}  // namespace
}  // namespace rigcal::testing::gige_capture_test
