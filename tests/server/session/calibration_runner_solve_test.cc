// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <new>
#include <string>
#include <vector>

#include "server/session/calibration_runner.h"
#include "tests/server/session/runner_fixture.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing::calibration_runner_solve_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::SizeIs;

class CalibrationRunnerSolve : public RunnerFixture {
 protected:
  void SetUp() override {
    RunnerFixture::SetUp();
    FinishByHand("wave", {"left"});
  }
  std::string Create() {
    const auto created = runner().CreateCalibration({"wave"}, {});
    EXPECT_THAT(created, IsOk());
    return created.ok() ? created->id : "";
  }
};

TEST_F(CalibrationRunnerSolve, FailingSolveSaysWhyAndWhatWasLeftOut) {
  solver_.SetOutcome(
      absl::FailedPreconditionError("groups {left} and {right} share no instant"),
      {{.camera = "left", .reason = RefusalReason::kAloneInInstant, .count = 20, .example = ""}});
  const Calibration ended = AwaitEnd(Create());
  EXPECT_EQ(ended.state, CalibrationState::kFailed);
  EXPECT_THAT(ended.error, HasSubstr("share no instant"));
  EXPECT_FALSE(ended.result.has_value());
  ASSERT_THAT(ended.refused, SizeIs(1));
  EXPECT_EQ(ended.refused[0].reason, RefusalReason::kAloneInInstant);
}

TEST_F(CalibrationRunnerSolve, LateRowsAppearInTheResult) {
  Deliver({"wave", "left", 2}, 1, 4);
  const Calibration ended = AwaitEnd(Create());
  ASSERT_EQ(ended.state, CalibrationState::kSucceeded);
  ASSERT_THAT(ended.result->refused, SizeIs(1));
  EXPECT_EQ(ended.result->refused[0].reason, RefusalReason::kLate);
  EXPECT_EQ(ended.result->refused[0].count, 4u);
}

TEST_F(CalibrationRunnerSolve, ReadingErrorIsAFailureThatKeepsTheServerGoing) {
  faulty().Fail("ReadObservations", absl::DataLossError("checksum of batch 3 is wrong"));
  const Calibration ended = AwaitEnd(Create());
  EXPECT_EQ(ended.state, CalibrationState::kFailed);
  EXPECT_THAT(ended.error, HasSubstr("checksum of batch 3"));
  faulty().Fail("ReadObservations", absl::OkStatus());
  EXPECT_EQ(AwaitEnd(Create()).state, CalibrationState::kSucceeded);
}

TEST_F(CalibrationRunnerSolve, ExceptionsOfTheSolveAreFailures) {
  solver_.SetBody([](const server::CalibrationHooks&) { throw std::bad_alloc(); });
  const Calibration ended = AwaitEnd(Create());
  EXPECT_EQ(ended.state, CalibrationState::kFailed);
  EXPECT_THAT(ended.error, HasSubstr("bad_alloc"));
}

TEST_F(CalibrationRunnerSolve, AResultThatCannotBeStoredIsAFailureUntilTheNextStart) {
  solver_.SetBody([this](const server::CalibrationHooks&) {
    faulty().Fail("FinishJob", absl::ResourceExhaustedError("disk full"));
  });
  const std::string id = Create();
  const Calibration ended = AwaitEnd(id);
  EXPECT_EQ(ended.state, CalibrationState::kFailed);
  EXPECT_THAT(ended.error, AllOf(HasSubstr("cannot be stored"), HasSubstr("disk full")));
  solver_.SetBody({});
  RestartAll();
  EXPECT_EQ(AwaitEnd(id).state, CalibrationState::kSucceeded);
}

TEST_F(CalibrationRunnerSolve, OneThatCannotBeBegunFailsWithTheReason) {
  faulty().Fail("ClaimJob", absl::ResourceExhaustedError("disk full"));
  const Calibration ended = AwaitEnd(Create());
  EXPECT_EQ(ended.state, CalibrationState::kFailed);
  EXPECT_THAT(ended.error, HasSubstr("disk full"));
}

TEST_F(CalibrationRunnerSolve, ProgressIsShownButNotWritten) {
  std::atomic<int> writes_before = 0;
  std::atomic<int> writes_after = 0;
  std::string id;
  std::atomic<bool> seen = false;
  solver_.SetBody([&](const server::CalibrationHooks& hooks) {
    writes_before = faulty().CallCount("RenewJob");
    for (int i = 0; i <= 1000; ++i) hooks.progress(CalibrationStage::kAdjusting, i / 1000.0);
    hooks.progress(CalibrationStage::kReporting, 0.75);
    writes_after = faulty().CallCount("RenewJob");
    const auto calibrations = runner().ListCalibrations({}, {.limit = 1});
    seen = calibrations.ok() && calibrations->at(0).record.state == CalibrationState::kRunning &&
           calibrations->at(0).record.progress_stage == CalibrationStage::kReporting &&
           calibrations->at(0).record.progress_fraction == 0.75;
  });
  const Calibration ended = AwaitEnd(Create());
  EXPECT_EQ(ended.state, CalibrationState::kSucceeded);
  EXPECT_TRUE(seen);
  EXPECT_EQ(writes_before, writes_after);
  EXPECT_EQ(ended.progress_fraction, 1);
}

TEST_F(CalibrationRunnerSolve, AWorkerThatDoesNotRespondIsShown) {
  std::vector<bool> seen;
  solver_.SetBody([&](const server::CalibrationHooks& hooks) {
    for (const bool not_responding : {false, true, false, true}) {
      hooks.silence(not_responding);
      const auto calibrations = runner().ListCalibrations({}, {.limit = 1});
      seen.push_back(calibrations.ok() && calibrations->at(0).record.not_responding);
    }
  });
  const Calibration ended = AwaitEnd(Create());
  EXPECT_THAT(seen, ::testing::ElementsAre(false, true, false, true));
  EXPECT_FALSE(ended.not_responding);
  // Nothing of it is left for the next one.
  solver_.SetBody([&](const server::CalibrationHooks&) {
    const auto calibrations = runner().ListCalibrations({}, {.limit = 2});
    for (const auto& [calibration, position] : *calibrations) {
      EXPECT_FALSE(calibration.not_responding);
    }
  });
  AwaitEnd(Create());
}

}  // namespace
}  // namespace rigcal::testing::calibration_runner_solve_test
