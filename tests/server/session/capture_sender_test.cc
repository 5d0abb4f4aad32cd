// SPDX-License-Identifier: Apache-2.0
#include "server/session/capture_sender.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

#include "tests/server/session/recording_link.h"
#include "tests/server/session/session_fixture.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing::capture_sender_test {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

class CaptureSenderTest : public ::testing::Test {
 protected:
  void SetUp() override {
    session_ = NewSession("wave");
    session_.state = SessionState::kCapturing;
    for (const char* name : {"left", "right"}) session_.cameras.push_back({MakeCamera(name), "pc"});
    contexts_.Put(session_);
    tasks_.Start();
  }
  void TearDown() override { tasks_.Shutdown(); }
  server::AgentDirectory::Registration Connect(std::shared_ptr<RecordingLink> link,
                                               const AgentRecord& agent) {
    auto registration = directory_.Register(agent, std::move(link));
    EXPECT_THAT(registration, IsOk());
    return registration.value_or(0);
  }
  std::vector<std::string> Lines(const RecordingLink& link) {
    tasks_.WaitIdle();
    return link.Lines();
  }

  Session session_;
  server::AgentDirectory directory_;
  server::StreamContextCache contexts_;
  server::TaskQueue tasks_{"test"};
  server::CaptureSender sender_{&directory_, &contexts_, &tasks_};
  const std::shared_ptr<RecordingLink> link_ = std::make_shared<RecordingLink>();
};

TEST_F(CaptureSenderTest, StopsEachAgentOfTheSessionOnce) {
  const auto other = std::make_shared<RecordingLink>();
  Connect(link_, MakeAgent("pc", {"left", "right"}));
  Connect(other, MakeAgent("elsewhere", {"top"}));
  sender_.SendStop(session_);
  EXPECT_THAT(Lines(*link_), ElementsAre("stop wave"));
  EXPECT_THAT(Lines(*other), IsEmpty());
}

TEST_F(CaptureSenderTest, WhoStartsWhileTheSessionDrainsIsStoppedAtOnce) {
  server::CaptureOrder order{.link = link_, .command = {}};
  order.command.session_id = "wave";
  sender_.SendStart(session_, {order});
  EXPECT_THAT(Lines(*link_), ElementsAre("start wave"));
  session_.state = SessionState::kDraining;
  sender_.SendStart(session_, {order});
  EXPECT_THAT(Lines(*link_), ElementsAre("start wave", "start wave", "stop wave"));
}

TEST_F(CaptureSenderTest, StopsALateCaptureOncePerConnection) {
  const StreamKey stream{.session_id = "wave", .camera = "left", .stream_epoch = 1};
  sender_.SendLateStop(stream);  // nobody is connected
  const auto registration = Connect(link_, MakeAgent("pc", {"left", "right"}));
  sender_.SendLateStop(stream);
  sender_.SendLateStop(stream);
  EXPECT_THAT(Lines(*link_), ElementsAre("stop wave"));
  // It connects again and still captures.
  sender_.Forget(registration);
  directory_.Unregister(registration);
  const auto next = std::make_shared<RecordingLink>();
  Connect(next, MakeAgent("pc", {"left", "right"}, 1, 2));
  sender_.SendLateStop(stream);
  EXPECT_THAT(Lines(*next), ElementsAre("stop wave"));
}

}  // namespace
}  // namespace rigcal::testing::capture_sender_test
