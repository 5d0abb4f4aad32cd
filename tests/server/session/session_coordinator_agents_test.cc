// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

#include "server/session/session_coordinator.h"
#include "tests/server/session/change_waiter.h"
#include "tests/server/session/session_fixture.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing::session_coordinator_agents_test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

class SessionCoordinatorAgents : public SessionFixture {
 protected:
  // "wave" with one agent each for left and right, capturing.
  void StartWave() {
    left_ = Connect(MakeAgent("pc-left", {"left"}));
    right_ = Connect(MakeAgent("pc-right", {"right"}));
    ASSERT_THAT(coordinator().CreateSession(NewSession("wave")), IsOk());
    ASSERT_THAT(coordinator().StartSession("wave"), IsOk());
    coordinator().WaitIdle();
  }

  ConnectedAgent left_;
  ConnectedAgent right_;
};

TEST_F(SessionCoordinatorAgents, AreToldToStartAndToStopInOrder) {
  StartWave();
  ASSERT_THAT(coordinator().StopSession("wave", 60), IsOk());
  coordinator().WaitIdle();
  EXPECT_THAT(left_.link->Lines(), ElementsAre("start wave left/1=0", "stop wave"));
  EXPECT_THAT(right_.link->Lines(), ElementsAre("start wave right/1=0", "stop wave"));
}

TEST_F(SessionCoordinatorAgents, HearNothingOfSessionsOfOtherCamerasAndRigs) {
  AgentRecord elsewhere = MakeAgent("pc-other", {"left"});
  elsewhere.rig = "other";
  const auto other = Connect(std::move(elsewhere));
  StartWave();
  const auto late = Connect(MakeAgent("pc-top", {"top"}));
  ASSERT_THAT(coordinator().StopSession("wave", 60), IsOk());
  coordinator().WaitIdle();
  EXPECT_THAT(other.link->Lines(), IsEmpty());
  EXPECT_THAT(late.link->Lines(), IsEmpty());
}

TEST_F(SessionCoordinatorAgents, OneAgentGetsOneCommandForAllItsCameras) {
  const auto agent = Connect(MakeAgent("pc", {"right", "left"}));
  ASSERT_THAT(coordinator().CreateSession(NewSession("wave")), IsOk());
  ASSERT_THAT(coordinator().StartSession("wave"), IsOk());
  coordinator().WaitIdle();
  EXPECT_THAT(agent.link->Lines(), ElementsAre("start wave left/1=0 right/1=0"));
}

TEST_F(SessionCoordinatorAgents, GoOnFromTheDurablePositionWhenTheyComeBack) {
  StartWave();
  Deliver({"wave", "left", 1}, 1, 25);
  const auto back = Connect(MakeAgent("pc-left", {"left"}, 1, 2), {{"wave", "left", 1}});
  coordinator().WaitIdle();
  EXPECT_THAT(left_.link->closed(), StatusIs(absl::StatusCode::kAborted, HasSubstr("pc-left")));
  EXPECT_THAT(back.link->Lines(), ElementsAre("start wave left/1=25"));
  ASSERT_THAT(back.positions, SizeIs(1));
  EXPECT_EQ(back.positions[0].durable_seq, 25u);
  EXPECT_EQ(back.positions[0].send_limit_seq, 25u + options_.send_window);
  EXPECT_FALSE(back.positions[0].unknown);
}

TEST_F(SessionCoordinatorAgents, GoOnAfterTheServerRestarted) {
  StartWave();
  Deliver({"wave", "left", 1}, 1, 25);
  Restart();
  const auto back = Connect(MakeAgent("pc-left", {"left"}, 1, 2));
  coordinator().WaitIdle();
  EXPECT_THAT(back.link->Lines(), ElementsAre("start wave left/1=25"));
}

TEST_F(SessionCoordinatorAgents, ANewLifeOfTheSpoolBeginsAtItsOwnPosition) {
  StartWave();
  Deliver({"wave", "left", 1}, 1, 25);
  AgentRecord restarted = MakeAgent("pc-left", {"left"}, 2, 1);
  restarted.cameras[0].stream_epoch = 2;
  const auto back = Connect(std::move(restarted));
  coordinator().WaitIdle();
  EXPECT_THAT(back.link->Lines(), ElementsAre("start wave left/2=0"));
}

// The agent of left was killed and starts again, with another epoch and `pending`.
AgentRecord RestartedLeft(bool spool_survives_restart) {
  AgentRecord agent = MakeAgent("pc-left", {"left"}, 2, 1);
  agent.cameras[0].stream_epoch = 2;
  agent.spool_survives_restart = spool_survives_restart;
  return agent;
}

TEST_F(SessionCoordinatorAgents, ACameraHasEndedOnceAllItsStreamsHave) {
  StartWave();
  DeliverEnd({"wave", "right", 1}, 0);
  Deliver({"wave", "left", 1}, 1, 25);
  coordinator().DisconnectAgent(left_.registration);
  const auto back = Connect(RestartedLeft(true), {{"wave", "left", 1}});
  // What was in the spool comes first, and then nothing of the new stream for a while.
  Deliver({"wave", "left", 1}, 26, 40);
  DeliverEnd({"wave", "left", 1}, 40);
  coordinator().WaitIdle();
  EXPECT_EQ(View("wave")->session.state, SessionState::kCapturing);
  Deliver({"wave", "left", 2}, 1, 9);
  DeliverEnd({"wave", "left", 2}, 9);
  EXPECT_THAT(AwaitFinished("wave").missing_cameras, IsEmpty());
}

TEST_F(SessionCoordinatorAgents, ACameraIsMissingWhoseOldStreamNeverEnds) {
  StartWave();
  DeliverEnd({"wave", "right", 1}, 0);
  Deliver({"wave", "left", 1}, 1, 25);
  coordinator().DisconnectAgent(left_.registration);
  // A spool in memory: the rest of the old stream is lost.
  const auto back = Connect(RestartedLeft(false));
  Deliver({"wave", "left", 2}, 1, 9);
  DeliverEnd({"wave", "left", 2}, 9);
  coordinator().WaitIdle();
  EXPECT_EQ(View("wave")->session.state, SessionState::kCapturing);
  ASSERT_THAT(coordinator().StopSession("wave", 0.01), IsOk());
  EXPECT_THAT(AwaitFinished("wave").missing_cameras, ElementsAre("left"));
}

TEST_F(SessionCoordinatorAgents, AStreamThatWasOrderedAndNeverBegunDoesNotHoldASession) {
  StartWave();
  DeliverEnd({"wave", "right", 1}, 0);
  // Killed before it got the order; its spool is on a disk and has nothing.
  coordinator().DisconnectAgent(left_.registration);
  const auto back = Connect(RestartedLeft(true));
  coordinator().WaitIdle();
  EXPECT_THAT(back.link->Lines(), ElementsAre("start wave left/2=0"));
  EXPECT_EQ(View("wave")->session.state, SessionState::kCapturing);
  DeliverEnd({"wave", "left", 2}, 0);
  EXPECT_THAT(AwaitFinished("wave").missing_cameras, IsEmpty());
}

TEST_F(SessionCoordinatorAgents, RowsOfACameraThatIsNotThereAnyMoreAreStillTaken) {
  StartWave();
  Deliver({"wave", "left", 1}, 1, 25);
  coordinator().DisconnectAgent(left_.registration);
  const auto back = Connect(MakeAgent("pc-left", {"top"}, 2, 1), {{"wave", "left", 1}});
  ASSERT_THAT(back.positions, SizeIs(1));
  EXPECT_FALSE(back.positions[0].unknown);
  EXPECT_EQ(back.positions[0].durable_seq, 25u);
}

TEST_F(SessionCoordinatorAgents, AreKnownToHoldAStreamOrNot) {
  StartWave();
  using Holder = StreamHolder;
  const auto holder = [&](const std::string& agent_id, uint32_t stream_epoch) {
    return directory_of_agents_->HolderOf(agent_id, {"wave", "left", stream_epoch});
  };
  EXPECT_EQ(holder("pc-left", 1), Holder::kConnected) << "begins with the next start";
  EXPECT_EQ(holder("", 1), Holder::kNone);
  EXPECT_EQ(holder("pc-nobody", 1), Holder::kAway);
  const auto back = Connect(RestartedLeft(true), {{"wave", "left", 9}});
  EXPECT_EQ(holder("pc-left", 2), Holder::kConnected);
  EXPECT_EQ(holder("pc-left", 9), Holder::kConnected);
  EXPECT_EQ(holder("pc-left", 1), Holder::kGone);
  coordinator().RecordSpool(back.registration, {.row_count = 7, .problem = "the spool is full"});
  coordinator().RecordSpool(left_.registration, {.row_count = 8});
  EXPECT_EQ(directory_of_agents_->List("")[0].spool->row_count, 7u);
  coordinator().DisconnectAgent(back.registration);
  EXPECT_EQ(holder("pc-left", 2), Holder::kAway);
}

TEST_F(SessionCoordinatorAgents, WhileDrainingAreToldToStartAndAtOnceToStop) {
  StartWave();
  Deliver({"wave", "left", 1}, 1, 25);
  ASSERT_THAT(coordinator().StopSession("wave", 60), IsOk());
  const auto back = Connect(MakeAgent("pc-left", {"left"}, 1, 2));
  coordinator().WaitIdle();
  EXPECT_THAT(back.link->Lines(), ElementsAre("start wave left/1=25", "stop wave"));
}

TEST_F(SessionCoordinatorAgents, ThatComeBackAfterTheEndAreToldToStopOnce) {
  StartWave();
  coordinator().DisconnectAgent(left_.registration);
  ASSERT_THAT(coordinator().StopSession("wave", 0.01), IsOk());
  AwaitFinished("wave");
  const auto back = Connect(MakeAgent("pc-left", {"left"}, 1, 2));
  Deliver({"wave", "left", 1}, 1, 5);
  Deliver({"wave", "left", 1}, 6, 9);
  coordinator().WaitIdle();
  EXPECT_THAT(back.link->Lines(), ElementsAre("stop wave"));
  coordinator().DisconnectAgent(back.registration);
  const auto again = Connect(MakeAgent("pc-left", {"left"}, 1, 3));
  Deliver({"wave", "left", 1}, 10, 12);
  coordinator().WaitIdle();
  EXPECT_THAT(again.link->Lines(), ElementsAre("stop wave"));
  DeliverEnd({"wave", "left", 1}, 12);
  coordinator().WaitIdle();
  EXPECT_THAT(again.link->Lines(), SizeIs(1));
}

TEST_F(SessionCoordinatorAgents, ACameraThatHasEndedDoesNotBeginAgain) {
  StartWave();
  Deliver({"wave", "left", 1}, 1, 25);
  DeliverEnd({"wave", "left", 1}, 25);
  AgentRecord restarted = MakeAgent("pc-left", {"left"}, 2, 1);
  restarted.cameras[0].stream_epoch = 2;
  const auto back = Connect(std::move(restarted));
  coordinator().WaitIdle();
  EXPECT_THAT(back.link->Lines(), IsEmpty());
}

TEST_F(SessionCoordinatorAgents, AnotherAgentDoesNotTakeARunningCameraOver) {
  StartWave();
  Deliver({"wave", "left", 1}, 1, 25);
  coordinator().DisconnectAgent(left_.registration);
  // Its stream epoch counts from 1 as well; continuing the other's stream would mix the two.
  const auto other = Connect(MakeAgent("pc-new", {"left"}), {{"wave", "left", 1}});
  coordinator().WaitIdle();
  EXPECT_THAT(other.link->Lines(), IsEmpty());
  EXPECT_TRUE(other.positions[0].unknown);
  EXPECT_THAT(coordinator().contexts().CheckAgent({"wave", "left", 1}, "pc-new", "rig"),
              StatusIs(absl::StatusCode::kPermissionDenied, HasSubstr("pc-left")));
}

TEST_F(SessionCoordinatorAgents, PendingStreamsThatNobodyKnowsAreSaidToBeUnknown) {
  StartWave();
  FinishByHand("gone", {"left"});
  ASSERT_THAT(coordinator().DeleteSession("gone"), IsOk());
  const auto back =
      Connect(MakeAgent("pc-left", {"left"}, 1, 2),
              {{"gone", "left", 1}, {"wave", "left", 1}, {"wave", "right", 1}, {"wave", "top", 1}});
  ASSERT_THAT(back.positions, SizeIs(4));
  EXPECT_TRUE(back.positions[0].unknown);
  EXPECT_FALSE(back.positions[1].unknown);
  EXPECT_TRUE(back.positions[2].unknown) << "announced by another agent";
  EXPECT_TRUE(back.positions[3].unknown) << "not in the session";
  EXPECT_EQ(back.positions[3].stream.camera, "top");
}

TEST_F(SessionCoordinatorAgents, AStoreThatCannotBeReadRefusesTheAgentWhole) {
  StartWave();
  faulty().Fail("GetSessionCounts", absl::DataLossError("checksum"));
  const auto link = std::make_shared<RecordingLink>();
  EXPECT_THAT(coordinator().ConnectAgent(MakeAgent("pc-left", {"left"}, 1, 2), {}, link),
              StatusIs(absl::StatusCode::kDataLoss, HasSubstr("checksum")));
  EXPECT_THAT(directory_of_agents_->ConnectedCameraNames("rig"), ElementsAre("right"));
  faulty().Fail("GetSessionCounts", absl::OkStatus());
  const auto back = Connect(MakeAgent("pc-left", {"left"}, 1, 3));
  coordinator().WaitIdle();
  EXPECT_THAT(back.link->Lines(), ElementsAre("start wave left/1=0"));
}

TEST_F(SessionCoordinatorAgents, ComingAndGoingWakesWatchers) {
  StartWave();
  ChangeWaiter changes;
  ASSERT_OK_AND_ASSIGN(const auto watch, coordinator().WatchSession("wave", changes.Wake()));
  coordinator().DisconnectAgent(left_.registration);
  EXPECT_TRUE(changes.Wait(std::chrono::seconds(60)));
  ASSERT_OK_AND_ASSIGN(const SessionView view, View("wave"));
  EXPECT_THAT(view.connected_cameras, ElementsAre("right"));
}

}  // namespace
}  // namespace rigcal::testing::session_coordinator_agents_test
