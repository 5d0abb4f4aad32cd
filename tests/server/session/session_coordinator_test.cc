// SPDX-License-Identifier: Apache-2.0
#include "server/session/session_coordinator.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <thread>
#include <vector>

#include "tests/server/session/change_waiter.h"
#include "tests/server/session/session_fixture.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing::session_coordinator_test {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

using SessionCoordinator = SessionFixture;

TEST_F(SessionCoordinator, CreatesWithAnOwnOrAMadeUpId) {
  ASSERT_OK_AND_ASSIGN(const Session named, coordinator().CreateSession(NewSession("wave")));
  EXPECT_EQ(named.id, "wave");
  EXPECT_EQ(named.state, SessionState::kCreated);
  EXPECT_GT(named.create_utc_ns, 0);
  ASSERT_OK_AND_ASSIGN(const Session unnamed, coordinator().CreateSession(NewSession("")));
  EXPECT_THAT(unnamed.id, Not(IsEmpty()));
  EXPECT_THAT(coordinator().CreateSession(NewSession("wave")),
              StatusIs(absl::StatusCode::kAlreadyExists, HasSubstr("wave")));
}

TEST_F(SessionCoordinator, RefusesUnknownSessionsByName) {
  EXPECT_THAT(coordinator().StartSession("nobody"),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("nobody")));
  EXPECT_THAT(coordinator().StopSession("nobody", 1),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("nobody")));
  EXPECT_THAT(View("nobody"), StatusIs(absl::StatusCode::kNotFound, HasSubstr("nobody")));
  EXPECT_THAT(coordinator().DeleteSession("nobody"),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("nobody")));
  EXPECT_THAT(coordinator().HoldSessions({"nobody"}),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("nobody")));
}

TEST_F(SessionCoordinator, StartKeepsTheCamerasAsTheyAreThen) {
  Connect(MakeAgent("pc", {"left", "right"}));
  ASSERT_THAT(coordinator().CreateSession(NewSession("wave")), IsOk());
  ASSERT_OK_AND_ASSIGN(const Session started, coordinator().StartSession("wave"));
  EXPECT_EQ(started.state, SessionState::kCapturing);
  ASSERT_THAT(started.cameras, SizeIs(2));
  EXPECT_EQ(started.cameras[0].description, MakeCamera("left"));
  EXPECT_EQ(started.cameras[0].agent_id, "pc");
  // A camera that comes later does not take part.
  Connect(MakeAgent("late", {"top"}));
  ASSERT_OK_AND_ASSIGN(const SessionView view, View("wave"));
  EXPECT_THAT(view.session.cameras, SizeIs(2));
  EXPECT_THAT(view.connected_cameras, ElementsAre("left", "right", "top"));
  EXPECT_EQ(coordinator().CapturingCount(), 1u);
}

TEST_F(SessionCoordinator, StartWithoutCamerasFailsAndChangesNothing) {
  ASSERT_THAT(coordinator().CreateSession(NewSession("wave")), IsOk());
  EXPECT_THAT(coordinator().StartSession("wave"),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("no camera")));
  Connect(MakeAgent("pc", {"left"}));
  EXPECT_THAT(coordinator().StartSession("wave"), IsOk());
}

TEST_F(SessionCoordinator, StartingAgainReturnsTheRunningSession) {
  const auto agent = Connect(MakeAgent("pc", {"left"}));
  ASSERT_THAT(coordinator().CreateSession(NewSession("wave")), IsOk());
  ASSERT_OK_AND_ASSIGN(const Session first, coordinator().StartSession("wave"));
  ASSERT_OK_AND_ASSIGN(const Session second, coordinator().StartSession("wave"));
  EXPECT_EQ(first.start_utc_ns, second.start_utc_ns);
  coordinator().WaitIdle();
  EXPECT_THAT(agent.link->Lines(), ElementsAre("start wave left/1=0"));
}

TEST_F(SessionCoordinator, ACameraCapturesForOneSessionAtATime) {
  Connect(MakeAgent("pc", {"left", "right"}));
  ASSERT_THAT(coordinator().CreateSession(NewSession("one")), IsOk());
  ASSERT_THAT(coordinator().CreateSession(NewSession("two")), IsOk());
  ASSERT_THAT(coordinator().StartSession("one"), IsOk());
  EXPECT_THAT(coordinator().StartSession("two"),
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       AllOf(HasSubstr("'one'"), HasSubstr("'rig/left'"))));
  ASSERT_THAT(coordinator().StopSession("one", 60), IsOk());
  EXPECT_THAT(coordinator().StartSession("two"), IsOk());
}

TEST_F(SessionCoordinator, FinishesByItselfWhenEveryCameraHasEnded) {
  StartByHand("wave", {"left", "right"});
  Deliver({"wave", "left", 1}, 1, 10);
  DeliverEnd({"wave", "left", 1}, 10);
  coordinator().WaitIdle();
  ASSERT_OK_AND_ASSIGN(const SessionView view, View("wave"));
  EXPECT_EQ(view.session.state, SessionState::kCapturing);
  DeliverEnd({"wave", "right", 1}, 0);
  const Session finished = AwaitFinished("wave");
  EXPECT_THAT(finished.missing_cameras, IsEmpty());
  EXPECT_GT(finished.finish_utc_ns, 0);
}

TEST_F(SessionCoordinator, AnEndBeforeItsRowsWaitsForThem) {
  StartByHand("wave", {"left"});
  DeliverEnd({"wave", "left", 1}, 10);
  Deliver({"wave", "left", 1}, 1, 9);
  coordinator().WaitIdle();
  ASSERT_OK_AND_ASSIGN(const SessionView view, View("wave"));
  EXPECT_EQ(view.session.state, SessionState::kCapturing);
  Deliver({"wave", "left", 1}, 10, 10);
  EXPECT_THAT(AwaitFinished("wave").missing_cameras, IsEmpty());
}

TEST_F(SessionCoordinator, StopNamesWhoIsMissingAtTheDeadline) {
  StartByHand("wave", {"left", "right", "top"});
  Deliver({"wave", "left", 1}, 1, 10);
  DeliverEnd({"wave", "left", 1}, 10);
  Deliver({"wave", "right", 1}, 1, 5);
  ASSERT_OK_AND_ASSIGN(const Session stopped, coordinator().StopSession("wave", 0.05));
  EXPECT_EQ(stopped.state, SessionState::kDraining);
  EXPECT_EQ(stopped.drain_deadline_utc_ns - stopped.stop_utc_ns, 50'000'000);
  const Session finished = AwaitFinished("wave");
  EXPECT_THAT(finished.missing_cameras, ElementsAre("right", "top"));
  // Later rows are stored as late.
  EXPECT_TRUE(Deliver({"wave", "right", 1}, 6, 8).late);
}

TEST_F(SessionCoordinator, StopFinishesAtOnceWhenNobodyIsMissing) {
  StartByHand("wave", {"left"});
  ASSERT_THAT(coordinator().StopSession("wave", 600), IsOk());
  DeliverEnd({"wave", "left", 1}, 0);
  EXPECT_THAT(AwaitFinished("wave").missing_cameras, IsEmpty());
}

TEST_F(SessionCoordinator, StopIsForSessionsThatWereStarted) {
  ASSERT_THAT(coordinator().CreateSession(NewSession("wave")), IsOk());
  EXPECT_THAT(coordinator().StopSession("wave", 1),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("not been started")));
  EXPECT_THAT(coordinator().StopSession("wave", -1),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("drain_timeout is")));
  FinishByHand("done", {"left"});
  ASSERT_OK_AND_ASSIGN(const Session again, coordinator().StopSession("done", 1));
  EXPECT_EQ(again.state, SessionState::kFinished);
  EXPECT_THAT(coordinator().StartSession("done"),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("create a new one")));
}

TEST_F(SessionCoordinator, DeletesWhatDoesNotRun) {
  StartByHand("wave", {"left"});
  EXPECT_THAT(coordinator().DeleteSession("wave"),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("capturing")));
  ASSERT_THAT(coordinator().StopSession("wave", 600), IsOk());
  EXPECT_THAT(coordinator().DeleteSession("wave"),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("draining")));
  DeliverEnd({"wave", "left", 1}, 0);
  AwaitFinished("wave");
  {
    ASSERT_OK_AND_ASSIGN(const auto hold, coordinator().HoldSessions({"wave"}));
    EXPECT_THAT(coordinator().DeleteSession("wave"),
                StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("being read")));
  }
  EXPECT_THAT(coordinator().DeleteSession("wave"), IsOk());
  EXPECT_THAT(View("wave"), StatusIs(absl::StatusCode::kNotFound, HasSubstr("wave")));
  EXPECT_THAT(coordinator().contexts().GetStreamContext({"wave", "left", 1}),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("wave")));
}

TEST_F(SessionCoordinator, ADeleteThatFailsLeavesTheSessionUsable) {
  FinishByHand("wave", {"left"});
  faulty().Fail("DeleteSession", absl::InternalError("disk"));
  EXPECT_THAT(coordinator().DeleteSession("wave"),
              StatusIs(absl::StatusCode::kInternal, HasSubstr("disk")));
  EXPECT_THAT(coordinator().contexts().GetStreamContext({"wave", "left", 1}), IsOk());
  faulty().Fail("DeleteSession", absl::OkStatus());
  EXPECT_THAT(coordinator().DeleteSession("wave"), IsOk());
}

TEST_F(SessionCoordinator, SessionsGoOnAfterARestart) {
  StartByHand("capturing", {"left"});
  StartByHand("draining", {"left"});
  StartByHand("overdue", {"left"});
  Deliver({"capturing", "left", 1}, 1, 10);
  ASSERT_THAT(coordinator().StopSession("draining", 600), IsOk());
  // A deadline that passes while the server is down.
  ASSERT_OK_AND_ASSIGN(Session overdue, store().GetSession("overdue"));
  overdue.state = SessionState::kDraining;
  overdue.stop_utc_ns = overdue.drain_deadline_utc_ns = 1;
  ASSERT_THAT(store().UpdateSession(overdue), IsOk());
  Restart();

  EXPECT_THAT(AwaitFinished("overdue").missing_cameras, ElementsAre("left"));
  EXPECT_EQ(coordinator().CapturingCount(), 1u);
  EXPECT_EQ(coordinator().SessionCount(), 3u);
  EXPECT_EQ(Deliver({"capturing", "left", 1}, 6, 12).stored_rows, 2u);
  DeliverEnd({"capturing", "left", 1}, 12);
  EXPECT_THAT(AwaitFinished("capturing").missing_cameras, IsEmpty());
  DeliverEnd({"draining", "left", 1}, 0);
  EXPECT_THAT(AwaitFinished("draining").missing_cameras, IsEmpty());
}

TEST_F(SessionCoordinator, ASessionWhoseLastEndWasDurableBeforeTheCrashFinishesAfterIt) {
  StartByHand("wave", {"left"});
  // On disk, but unknown to the coordinator.
  Append(EndDelivery({"wave", "left", 1}, 0));
  Restart();
  EXPECT_THAT(AwaitFinished("wave").missing_cameras, IsEmpty());
}

TEST_F(SessionCoordinator, AFullDiskDelaysTheEndOnly) {
  options_.store_retry_interval = std::chrono::milliseconds(1);
  Restart();
  StartByHand("wave", {"left"});
  faulty().Fail("UpdateSession", absl::ResourceExhaustedError("disk full"));
  DeliverEnd({"wave", "left", 1}, 0);
  coordinator().WaitIdle();
  ASSERT_OK_AND_ASSIGN(const SessionView view, View("wave"));
  EXPECT_EQ(view.session.state, SessionState::kCapturing);
  faulty().Fail("UpdateSession", absl::OkStatus());
  EXPECT_THAT(AwaitFinished("wave").missing_cameras, IsEmpty());
}

TEST_F(SessionCoordinator, AFullDiskAtTheDeadlineIsTriedAgain) {
  options_.store_retry_interval = std::chrono::milliseconds(1);
  Restart();
  StartByHand("wave", {"left"});
  ASSERT_THAT(coordinator().StopSession("wave", 0.01), IsOk());
  faulty().Fail("GetSessionCounts", absl::InternalError("no"));
  while (faulty().CallCount("GetSessionCounts") < 3) std::this_thread::yield();
  faulty().Fail("GetSessionCounts", absl::OkStatus());
  EXPECT_THAT(AwaitFinished("wave").missing_cameras, ElementsAre("left"));
}

TEST_F(SessionCoordinator, LimitsTheNumberOfSessions) {
  options_.max_sessions = 1;
  Restart();
  ASSERT_THAT(coordinator().CreateSession(NewSession("one")), IsOk());
  EXPECT_THAT(coordinator().CreateSession(NewSession("two")),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("max_sessions")));
  ASSERT_THAT(coordinator().DeleteSession("one"), IsOk());
  EXPECT_THAT(coordinator().CreateSession(NewSession("two")), IsOk());
}

TEST_F(SessionCoordinator, WatchersAreWokenByTheDeletion) {
  ASSERT_THAT(coordinator().CreateSession(NewSession("wave")), IsOk());
  ChangeWaiter changes;
  ASSERT_OK_AND_ASSIGN(const auto watch, coordinator().WatchSession("wave", changes.Wake()));
  ASSERT_THAT(coordinator().DeleteSession("wave"), IsOk());
  EXPECT_TRUE(changes.Wait(std::chrono::seconds(60)));
  EXPECT_THAT(View("wave"), StatusIs(absl::StatusCode::kNotFound, HasSubstr("wave")));
}

TEST_F(SessionCoordinator, ManyThreadsAtOnceEndInOneState) {
  StartByHand("shared", {"left"});
  std::vector<std::thread> threads;
  for (int t = 0; t < 4; ++t) {
    threads.emplace_back([&, t] {
      for (int i = 0; i < 10; ++i) {
        const std::string id = "s-" + std::to_string(t) + "-" + std::to_string(i);
        Session session = NewSession(id);
        session.cameras = {{MakeCamera("left"), ""}};
        EXPECT_THAT(coordinator().CreateSession(session), IsOk());
        EXPECT_THAT(coordinator().StartSession(id), IsOk());
        coordinator().RecordProgress({"shared", "left", 1}, {.complete = true});
        EXPECT_THAT(coordinator().StopSession(id, 0.001), IsOk());
        EXPECT_THAT(View(id), IsOk());
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  for (int t = 0; t < 4; ++t) {
    for (int i = 0; i < 10; ++i) {
      AwaitFinished("s-" + std::to_string(t) + "-" + std::to_string(i));
    }
  }
  EXPECT_EQ(coordinator().CapturingCount(), 1u);
}

}  // namespace
}  // namespace rigcal::testing::session_coordinator_test
