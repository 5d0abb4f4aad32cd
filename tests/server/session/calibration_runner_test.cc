// SPDX-License-Identifier: Apache-2.0
#include "server/session/calibration_runner.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <thread>
#include <vector>

#include "tests/server/session/runner_fixture.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing::calibration_runner_test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::SizeIs;

using CalibrationRunner = RunnerFixture;

TEST_F(CalibrationRunner, RunsFromQueuedToSucceeded) {
  runner_options_.software_version = "9.9";
  RestartAll();
  FinishByHand("wave", {"left", "right"});
  CalibrationResult result;
  result.instant_count = 17;
  solver_.SetOutcome(result);
  CalibrationOptions options;
  options.seed = 5;
  ASSERT_OK_AND_ASSIGN(const Calibration created, runner().CreateCalibration({"wave"}, options));
  EXPECT_EQ(created.state, CalibrationState::kQueued);
  EXPECT_EQ(created.rig, "rig");
  EXPECT_EQ(created.version, 1u);
  const Calibration ended = AwaitEnd(created.id);
  EXPECT_EQ(ended.state, CalibrationState::kSucceeded);
  EXPECT_EQ(ended.result->instant_count, 17u);
  EXPECT_EQ(ended.options, options);
  EXPECT_EQ(ended.software_version, "9.9");
  EXPECT_GT(ended.start_utc_ns, 0);
  EXPECT_GE(ended.end_utc_ns, ended.start_utc_ns);
  EXPECT_THAT(solver_.last_input().tracks, SizeIs(2));
}

TEST_F(CalibrationRunner, RefusesWhatCannotBeCalibrated) {
  ASSERT_THAT(coordinator().CreateSession(NewSession("fresh")), IsOk());
  FinishByHand("wave", {"left"});
  EXPECT_THAT(runner().CreateCalibration({}, {}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("session_ids")));
  EXPECT_THAT(runner().CreateCalibration({"wave", "wave"}, {}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("twice")));
  EXPECT_THAT(runner().CreateCalibration({"wave", "nobody"}, {}),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("nobody")));
  EXPECT_THAT(runner().CreateCalibration({"fresh"}, {}),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("'fresh'")));
  CalibrationOptions options;
  options.sigma_px = -1;
  EXPECT_THAT(runner().CreateCalibration({"wave"}, options),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("sigma")));
  EXPECT_THAT(runner().CreateCalibration(std::vector<std::string>(65, "x"), {}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("65")));
  // The refused ones do not hold their sessions.
  EXPECT_THAT(coordinator().DeleteSession("wave"), IsOk());
}

TEST_F(CalibrationRunner, TakesWhatASessionContinues) {
  FinishByHand("one", {"left", "right"});
  for (const auto& [id, continued] : {std::pair("two", "one"), std::pair("three", "two")}) {
    Session session = NewSession(id);
    for (const char* camera : {"left", "right"})
      session.cameras.push_back({MakeCamera(camera), ""});
    session.continues = continued;
    ASSERT_THAT(coordinator().CreateSession(session), IsOk());
    ASSERT_THAT(coordinator().StartSession(id), IsOk());
    ASSERT_THAT(coordinator().StopSession(id, 0.001), IsOk());
    AwaitFinished(id);
  }
  ASSERT_OK_AND_ASSIGN(Calibration calibration, runner().CreateCalibration({"three"}, {}));
  EXPECT_THAT(calibration.session_ids, ::testing::ElementsAre("three", "two", "one"));
  ASSERT_OK_AND_ASSIGN(calibration, runner().CreateCalibration({"one", "three"}, {}));
  EXPECT_THAT(calibration.session_ids, ::testing::ElementsAre("one", "three", "two"));
  Session session = NewSession("four");
  session.continues = "nobody";
  EXPECT_THAT(coordinator().CreateSession(session),
              StatusIs(absl::StatusCode::kNotFound, ::testing::HasSubstr("nobody")));
}

TEST_F(CalibrationRunner, TakesNoSessionThatWasThrownAway) {
  FinishByHand("one", {"left", "right"});
  Session session = NewSession("two");
  for (const char* camera : {"left", "right"}) session.cameras.push_back({MakeCamera(camera), ""});
  session.continues = "one";
  ASSERT_THAT(coordinator().CreateSession(session), IsOk());
  ASSERT_THAT(coordinator().StartSession("two"), IsOk());
  EXPECT_THAT(coordinator().DiscardSession("two", false),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("stop it first")));
  ASSERT_THAT(coordinator().StopSession("two", 0.001), IsOk());
  AwaitFinished("two");

  ASSERT_OK_AND_ASSIGN(Session one, coordinator().DiscardSession("one", false));
  EXPECT_NE(one.discard_utc_ns, 0);
  EXPECT_EQ(store().GetSession("one")->discard_utc_ns, one.discard_utc_ns);
  EXPECT_THAT(runner().CreateCalibration({"one"}, {}),
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       ::testing::AllOf(HasSubstr("'one'"), HasSubstr("--undo"))));
  session.id = "three";
  EXPECT_THAT(coordinator().CreateSession(session),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("thrown away")));
  ASSERT_OK_AND_ASSIGN(Calibration calibration, runner().CreateCalibration({"two"}, {}));
  EXPECT_THAT(calibration.session_ids, ::testing::ElementsAre("two"));

  ASSERT_OK_AND_ASSIGN(one, coordinator().DiscardSession("one", true));
  EXPECT_EQ(one.discard_utc_ns, 0);
  ASSERT_OK_AND_ASSIGN(calibration, runner().CreateCalibration({"two"}, {}));
  EXPECT_THAT(calibration.session_ids, ::testing::ElementsAre("two", "one"));
  EXPECT_THAT(coordinator().DiscardSession("nobody", false),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("nobody")));
}

TEST_F(CalibrationRunner, QueueIsBounded) {
  runner_options_.max_queued = 1;
  RestartAll();
  FinishByHand("wave", {"left"});
  solver_.Hold();
  ASSERT_THAT(runner().CreateCalibration({"wave"}, {}), IsOk());
  solver_.AwaitBegun(1);
  ASSERT_THAT(runner().CreateCalibration({"wave"}, {}), IsOk());
  EXPECT_EQ(runner().QueuedCount(), 1u);
  EXPECT_THAT(runner().CreateCalibration({"wave"}, {}),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("queued")));
  solver_.Release();
  runner().WaitIdle();
  EXPECT_THAT(runner().CreateCalibration({"wave"}, {}), IsOk());
}

TEST_F(CalibrationRunner, RunsInTheOrderOfCreationWithRisingVersions) {
  FinishByHand("wave", {"left"});
  solver_.Hold();
  std::vector<std::string> ids;
  for (uint32_t i = 0; i < 3; ++i) {
    ASSERT_OK_AND_ASSIGN(const Calibration created, runner().CreateCalibration({"wave"}, {}));
    EXPECT_EQ(created.version, i + 1);
    ids.push_back(created.id);
  }
  solver_.Release();
  runner().WaitIdle();
  int64_t before = 0;
  for (const std::string& id : ids) {
    ASSERT_OK_AND_ASSIGN(const Calibration ended, runner().GetCalibration(id));
    EXPECT_EQ(ended.state, CalibrationState::kSucceeded);
    EXPECT_GE(ended.start_utc_ns, before);
    before = ended.end_utc_ns;
  }
  ASSERT_OK_AND_ASSIGN(const auto page, runner().ListCalibrations({.rig = "rig"}, {.limit = 2}));
  ASSERT_THAT(page, SizeIs(2));
  EXPECT_EQ(page[0].record.id, ids[2]);
  ASSERT_OK_AND_ASSIGN(
      const auto rest,
      runner().ListCalibrations({.rig = "rig"}, {.limit = 2, .after = page[1].position}));
  ASSERT_THAT(rest, SizeIs(1));
  EXPECT_EQ(rest[0].record.id, ids[0]);
}

TEST_F(CalibrationRunner, DeletesOneThatHasEndedAndNoOther) {
  FinishByHand("wave", {"left"});
  ASSERT_OK_AND_ASSIGN(const Calibration ended, runner().CreateCalibration({"wave"}, {}));
  AwaitEnd(ended.id);
  solver_.Hold();
  ASSERT_OK_AND_ASSIGN(const Calibration running, runner().CreateCalibration({"wave"}, {}));
  solver_.AwaitBegun(2);
  ASSERT_OK_AND_ASSIGN(const Calibration queued, runner().CreateCalibration({"wave"}, {}));
  for (const std::string& id : {running.id, queued.id}) {
    EXPECT_THAT(runner().DeleteCalibration(id),
                StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("cancel it first")));
  }
  ASSERT_THAT(runner().DeleteCalibration(ended.id), IsOk());
  EXPECT_THAT(runner().GetCalibration(ended.id),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr(ended.id)));
  EXPECT_THAT(runner().DeleteCalibration(ended.id),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr(ended.id)));
  solver_.Release();
  EXPECT_EQ(AwaitEnd(queued.id).version, 3u) << "a version is never used again";
}

TEST_F(CalibrationRunner, CancelsAQueuedOne) {
  FinishByHand("wave", {"left"});
  solver_.Hold();
  ASSERT_OK_AND_ASSIGN(const Calibration first, runner().CreateCalibration({"wave"}, {}));
  solver_.AwaitBegun(1);
  ASSERT_OK_AND_ASSIGN(const Calibration second, runner().CreateCalibration({"wave"}, {}));
  ASSERT_OK_AND_ASSIGN(const Calibration cancelled, runner().CancelCalibration(second.id));
  EXPECT_EQ(cancelled.state, CalibrationState::kCancelled);
  EXPECT_EQ(cancelled.error, "cancelled");
  solver_.Release();
  runner().WaitIdle();
  ASSERT_OK_AND_ASSIGN(const Calibration stored, runner().GetCalibration(second.id));
  EXPECT_EQ(stored.error, "cancelled");
  EXPECT_EQ(AwaitEnd(first.id).state, CalibrationState::kSucceeded);
}

TEST_F(CalibrationRunner, CancelsTheRunningOneAndGoesOnWithTheNext) {
  FinishByHand("wave", {"left"});
  solver_.Hold();
  ASSERT_OK_AND_ASSIGN(const Calibration first, runner().CreateCalibration({"wave"}, {}));
  ASSERT_OK_AND_ASSIGN(const Calibration second, runner().CreateCalibration({"wave"}, {}));
  solver_.AwaitBegun(1);
  ASSERT_THAT(runner().CancelCalibration(first.id), IsOk());
  const Calibration ended = AwaitEnd(first.id);
  EXPECT_EQ(ended.state, CalibrationState::kCancelled);
  EXPECT_EQ(ended.error, "cancelled");
  EXPECT_FALSE(ended.result.has_value());
  solver_.AwaitBegun(2);
  solver_.Release();
  EXPECT_EQ(AwaitEnd(second.id).state, CalibrationState::kSucceeded);
}

TEST_F(CalibrationRunner, CancellingAnEndedOneReturnsItAsItIs) {
  FinishByHand("wave", {"left"});
  ASSERT_OK_AND_ASSIGN(const Calibration created, runner().CreateCalibration({"wave"}, {}));
  AwaitEnd(created.id);
  ASSERT_OK_AND_ASSIGN(const Calibration again, runner().CancelCalibration(created.id));
  EXPECT_EQ(again.state, CalibrationState::kSucceeded);
  EXPECT_THAT(runner().CancelCalibration("nobody"),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("nobody")));
}

TEST_F(CalibrationRunner, SessionsAreNotDeletedWhileTheyAreNeeded) {
  FinishByHand("wave", {"left"});
  solver_.Hold();
  ASSERT_OK_AND_ASSIGN(const Calibration created, runner().CreateCalibration({"wave"}, {}));
  EXPECT_THAT(coordinator().DeleteSession("wave"),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("being read")));
  solver_.Release();
  runner().WaitIdle();
  EXPECT_THAT(coordinator().DeleteSession("wave"), IsOk());
  // The calibration stays.
  EXPECT_THAT(runner().GetCalibration(created.id), IsOk());
}

TEST_F(CalibrationRunner, ACleanStopQueuesTheRunningOneAgain) {
  FinishByHand("wave", {"left"});
  solver_.Hold();
  ASSERT_OK_AND_ASSIGN(const Calibration first, runner().CreateCalibration({"wave"}, {}));
  ASSERT_OK_AND_ASSIGN(const Calibration second, runner().CreateCalibration({"wave"}, {}));
  solver_.AwaitBegun(1);
  runner().Shutdown();
  ASSERT_OK_AND_ASSIGN(const Calibration stopped, store().GetCalibration(first.id));
  EXPECT_EQ(stopped.state, CalibrationState::kQueued);
  EXPECT_EQ(stopped.start_utc_ns, 0);
  solver_.Release();
  RestartAll();
  EXPECT_EQ(AwaitEnd(first.id).state, CalibrationState::kSucceeded);
  EXPECT_EQ(AwaitEnd(second.id).state, CalibrationState::kSucceeded);
}

TEST_F(CalibrationRunner, OneThatKeepsKillingTheServerFailsInTheEnd) {
  runner_options_.max_attempts = 2;
  RestartAll();
  FinishByHand("wave", {"left"});
  solver_.Hold();
  ASSERT_OK_AND_ASSIGN(const Calibration created, runner().CreateCalibration({"wave"}, {}));
  for (int attempt = 1; attempt <= 2; ++attempt) {
    solver_.AwaitBegun(attempt);
    ASSERT_OK_AND_ASSIGN(const Calibration running, store().GetCalibration(created.id));
    EXPECT_EQ(running.state, CalibrationState::kRunning);
    runner().Shutdown();
    // The store as kill -9 in the solve leaves it.
    ASSERT_OK_AND_ASSIGN(const auto job, store().ClaimJob(server::ThisHolder("", true), {}));
    ASSERT_TRUE(job.has_value());
    RestartAll();
  }
  const Calibration ended = AwaitEnd(created.id);
  EXPECT_EQ(ended.state, CalibrationState::kFailed);
  EXPECT_THAT(ended.error, HasSubstr("2 times"));
}

TEST_F(CalibrationRunner, ASessionDeletedBehindItsBackFailsWithItsName) {
  FinishByHand("wave", {"left"});
  solver_.Hold();
  ASSERT_OK_AND_ASSIGN(const Calibration created, runner().CreateCalibration({"wave"}, {}));
  solver_.AwaitBegun(1);
  runner().Shutdown();
  ASSERT_THAT(store().DeleteSession("wave"), IsOk());
  solver_.Release();
  RestartAll();
  const Calibration ended = AwaitEnd(created.id);
  EXPECT_EQ(ended.state, CalibrationState::kFailed);
  EXPECT_THAT(ended.error, HasSubstr("wave"));
}

TEST_F(CalibrationRunner, ManyClientsAtOnce) {
  FinishByHand("wave", {"left"});
  std::vector<std::thread> clients;
  for (int t = 0; t < 4; ++t) {
    clients.emplace_back([&, t] {
      for (int i = 0; i < 5; ++i) {
        const auto created = runner().CreateCalibration({"wave"}, {});
        ASSERT_THAT(created, IsOk());
        if (t % 2 == 0) {
          EXPECT_THAT(runner().CancelCalibration(created->id), IsOk());
        }
        EXPECT_THAT(runner().GetCalibration(created->id), IsOk());
      }
    });
  }
  for (std::thread& client : clients) client.join();
  runner().WaitIdle();
  ASSERT_OK_AND_ASSIGN(const auto all, runner().ListCalibrations({}, {.limit = 100}));
  EXPECT_THAT(all, SizeIs(20));
  for (const auto& [calibration, position] : all) {
    EXPECT_TRUE(calibration.state == CalibrationState::kSucceeded ||
                calibration.error == "cancelled")
        << calibration.error;
  }
}

}  // namespace
}  // namespace rigcal::testing::calibration_runner_test
