// SPDX-License-Identifier: Apache-2.0
// Calibrations of a store that several processes solve from. The test plays the others.
#include "server/session/job_solver.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "tests/server/session/change_waiter.h"
#include "tests/server/session/runner_fixture.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing::job_solver_test {
namespace {

using ::testing::HasSubstr;

const server::JobHolder kOther{.host = "pc-2", .pid = 311, .software_version = ""};

class JobSolver : public RunnerFixture {
 protected:
  void SetUp() override { SessionFixture::SetUp(); }
  void Open(bool solve_here) {
    runner_.reset();
    Restart();
    faulty().ShareJobs();
    runner_options_.solve_here = solve_here;
    OpenRunner();
  }
  std::string Create() {
    const auto created = runner().CreateCalibration({"wave"}, {});
    EXPECT_THAT(created, IsOk());
    return created.ok() ? created->id : "";
  }
  template <typename Condition>
  bool Await(const std::string& id, Condition condition) {
    ChangeWaiter changes;
    const auto watch = runner().WatchCalibration(id, changes.Wake());
    const auto limit = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    while (std::chrono::steady_clock::now() < limit) {
      const auto calibration = runner().GetCalibration(id);
      if (calibration.ok() && condition(*calibration)) return true;
      changes.Wait(std::chrono::milliseconds(1000));
    }
    return false;
  }
  static Calibration Succeeded(Calibration calibration, uint32_t instants) {
    calibration.state = CalibrationState::kSucceeded;
    calibration.result.emplace();
    calibration.result->instant_count = instants;
    return calibration;
  }
};

TEST_F(JobSolver, AWorkerElsewhereIsFollowedAndItsSessionsAreHeld) {
  FinishByHand("wave", {"left"});
  Open(false);
  const std::string id = Create();
  ASSERT_TRUE(Await(id, [](const Calibration& calibration) {
    return calibration.waiting.find("no rigcal-worker runs") != std::string::npos;
  }));
  ASSERT_THAT(store().NoteWorker({.host = "pc-3", .pid = 5, .software_version = "0.9"}), IsOk());
  ASSERT_TRUE(Await(id, [](const Calibration& calibration) {
    return calibration.waiting.find("pc-3 has 0.9") != std::string::npos;
  }));
  EXPECT_EQ(runner().QueuedCount(), 1u);

  ASSERT_OK_AND_ASSIGN(const auto job, store().ClaimJob(kOther, {}));
  ASSERT_TRUE(job.has_value());
  ASSERT_THAT(store().RenewJob(
                  job->claim,
                  {.stage = CalibrationStage::kAdjusting, .fraction = 0.5, .not_responding = true}),
              IsOk());
  ASSERT_TRUE(Await(id, [](const Calibration& calibration) {
    return calibration.progress_stage == CalibrationStage::kAdjusting &&
           calibration.progress_fraction == 0.5 && calibration.not_responding &&
           calibration.solved_by == "rigcal-worker on pc-2 (process 311)" &&
           calibration.waiting.empty();
  }));
  EXPECT_EQ(runner().QueuedCount(), 0u);
  EXPECT_THAT(coordinator().DeleteSession("wave"),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("being read")));

  // The next server finds it and holds its session.
  Open(false);
  EXPECT_THAT(coordinator().DeleteSession("wave"),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("being read")));
}

TEST_F(JobSolver, ACancelIsForWhoeverSolves) {
  FinishByHand("wave", {"left"});
  Open(false);
  const std::string id = Create();
  ASSERT_OK_AND_ASSIGN(auto job, store().ClaimJob(kOther, {}));
  ASSERT_THAT(runner().CancelCalibration(id), IsOk());
  ASSERT_OK_AND_ASSIGN(const bool cancel, store().RenewJob(job->claim, {}));
  EXPECT_TRUE(cancel);
  job->calibration.state = CalibrationState::kCancelled;
  job->calibration.error = "cancelled";
  ASSERT_THAT(store().FinishJob(job->claim, job->calibration), IsOk());
  EXPECT_EQ(AwaitEnd(id).error, "cancelled");
  // The session is free once the server has seen it.
  const auto limit = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  absl::Status deleted;
  do {
    deleted = coordinator().DeleteSession("wave");
  } while (!deleted.ok() && std::chrono::steady_clock::now() < limit);
  EXPECT_THAT(deleted, IsOk());
}

TEST_F(JobSolver, WhoLostTheJobPublishesNothing) {
  FinishByHand("wave", {"left"});
  Open(true);
  CalibrationResult result;
  result.instant_count = 1;
  solver_.SetOutcome(result);
  solver_.SetBody([&](const server::CalibrationHooks&) {
    ASSERT_THAT(store().AdoptJobs(""), IsOk());
    ASSERT_OK_AND_ASSIGN(const auto job, store().ClaimJob(kOther, {}));
    ASSERT_TRUE(job.has_value());
    ASSERT_THAT(store().FinishJob(job->claim, Succeeded(job->calibration, 99)), IsOk());
  });
  const std::string id = Create();
  solver_.AwaitBegun(1);
  runner().WaitIdle();
  EXPECT_EQ(AwaitEnd(id).result->instant_count, 99u);
}

TEST_F(JobSolver, AnEndWaitsForTheStore) {
  FinishByHand("wave", {"left"});
  Open(true);
  faulty().Fail("FinishJob", absl::UnavailableError("the database is gone"));
  faulty().OnCall("FinishJob", [&] {
    if (faulty().CallCount("FinishJob") == 3) faulty().Fail("FinishJob", absl::OkStatus());
  });
  EXPECT_EQ(AwaitEnd(Create()).state, CalibrationState::kSucceeded);
  EXPECT_GE(faulty().CallCount("FinishJob"), 3);
}

TEST_F(JobSolver, BeginsAgainWhereTheStoreWasGoneWhileItRead) {
  FinishByHand("wave", {"left"});
  Open(true);
  faulty().Fail("ReadObservations", absl::UnavailableError("the database is gone"));
  faulty().OnCall("FinishJob", [&] { faulty().Fail("ReadObservations", absl::OkStatus()); });
  const Calibration ended = AwaitEnd(Create());
  EXPECT_EQ(ended.state, CalibrationState::kSucceeded) << ended.error;
  EXPECT_EQ(ended.attempt_count, 2u);
  // Not for ever.
  faulty().OnCall("FinishJob", {});
  faulty().Fail("ReadObservations", absl::UnavailableError("the database is gone"));
  const Calibration failed = AwaitEnd(Create());
  EXPECT_EQ(failed.state, CalibrationState::kFailed);
  EXPECT_THAT(failed.error, HasSubstr("the database is gone"));
}

TEST_F(JobSolver, AServerAloneMustSolve) {
  runner_options_.solve_here = false;
  EXPECT_THAT(server::CalibrationRunner::Create(runner_options_, faulty_.get(), coordinator_.get(),
                                                server::SolveInProcess(solver_.Function())),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("nobody else can")));
}

}  // namespace
}  // namespace rigcal::testing::job_solver_test
