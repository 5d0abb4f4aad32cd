// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "tests/server/store/contract/store_contract.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::store_jobs_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::_;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

const JobHolder kFirst{.host = "one", .pid = 11, .software_version = "1.0"};
const JobHolder kSecond{.host = "two", .pid = 22, .software_version = "1.0"};

class StoreJobs : public ::rigcal::testing::StoreContract {
 protected:
  std::string Create(const std::string& software_version = "1.0") {
    Calibration calibration;
    calibration.rig = "rig";
    calibration.session_ids = {"s-000001"};
    calibration.software_version = software_version;
    const auto created = store().CreateCalibration(calibration);
    EXPECT_THAT(created, IsOk());
    return created.ok() ? created->id : "";
  }
  // A claim that must succeed.
  ClaimedJob Claim(const JobHolder& holder, const ClaimOptions& options = {}) {
    const auto job = store().ClaimJob(holder, options);
    EXPECT_THAT(job, IsOk());
    if (!job.ok() || !*job) {
      ADD_FAILURE() << "no job";
      return {};
    }
    return **job;
  }
  bool NoJob(const JobHolder& holder, const ClaimOptions& options = {}) {
    const auto job = store().ClaimJob(holder, options);
    EXPECT_THAT(job, IsOk());
    return job.ok() && !*job;
  }
  // A job whose holder is not heard of any more: in a store of several processes its lease is over,
  // in another one the next server adopts it.
  ClaimedJob ClaimAndDie(const JobHolder& holder) {
    ClaimedJob job = Claim(holder, {.lease = std::chrono::milliseconds(-1)});
    if (!store().jobs_are_shared()) {
      EXPECT_THAT(store().AdoptJobs("1.0"), IsOk());
    }
    return job;
  }
  static Calibration Succeeded(Calibration calibration, uint32_t instants = 7) {
    calibration.state = CalibrationState::kSucceeded;
    calibration.result.emplace();
    calibration.result->instant_count = instants;
    return calibration;
  }
};

TEST_P(StoreJobs, AreClaimedOnceTheOldestFirst) {
  const std::string first = Create(), second = Create();
  ASSERT_OK_AND_ASSIGN(const auto queued, store().ListJobs());
  ASSERT_THAT(queued, SizeIs(2));
  EXPECT_EQ(queued[0].state, CalibrationState::kQueued);
  EXPECT_THAT(queued[0].session_ids, ElementsAre("s-000001"));
  const ClaimedJob claimed = Claim(kFirst, {.utc_now_ns = 5});
  EXPECT_EQ(claimed.claim.calibration_id, first);
  EXPECT_EQ(claimed.calibration.state, CalibrationState::kRunning);
  EXPECT_EQ(claimed.calibration.attempt_count, 1u);
  EXPECT_EQ(store().GetCalibration(first)->start_utc_ns, 5);
  EXPECT_EQ(Claim(kSecond).claim.calibration_id, second);
  EXPECT_TRUE(NoJob(kFirst));
  ASSERT_OK_AND_ASSIGN(const auto jobs, store().ListJobs());
  ASSERT_THAT(jobs, SizeIs(2));
  EXPECT_EQ(jobs[0].holder, kFirst);
  EXPECT_EQ(jobs[1].holder, kSecond);
  EXPECT_FALSE(jobs[0].lease_is_over);
}

TEST_P(StoreJobs, AHeartbeatKeepsProgress) {
  Create();
  const ClaimedJob job = Claim(kFirst);
  const JobProgress progress{
      .stage = CalibrationStage::kAdjusting, .fraction = 0.25, .not_responding = true};
  ASSERT_OK_AND_ASSIGN(const bool cancel, store().RenewJob(job.claim, progress));
  EXPECT_FALSE(cancel);
  ASSERT_OK_AND_ASSIGN(const auto jobs, store().ListJobs());
  ASSERT_THAT(jobs, SizeIs(1));
  EXPECT_EQ(jobs[0].progress, progress);
}

TEST_P(StoreJobs, EndOnceAndStayEnded) {
  const std::string id = Create();
  const ClaimedJob job = Claim(kFirst);
  ASSERT_THAT(store().FinishJob(job.claim, Succeeded(job.calibration)), IsOk());
  EXPECT_EQ(store().GetCalibration(id)->result->instant_count, 7u);
  EXPECT_THAT(*store().ListJobs(), IsEmpty());
  EXPECT_TRUE(NoJob(kSecond));
  // The answer of the first call was lost.
  EXPECT_THAT(store().FinishJob(job.claim, Succeeded(job.calibration, 8)), IsOk());
  EXPECT_EQ(store().GetCalibration(id)->result->instant_count, 7u);
  Calibration failed = job.calibration;
  failed.state = CalibrationState::kFailed;
  EXPECT_THAT(store().FinishJob(job.claim, failed), StatusIs(absl::StatusCode::kAborted, _));
  EXPECT_THAT(store().RenewJob(job.claim, {}), StatusIs(absl::StatusCode::kAborted, _));
  EXPECT_THAT(store().DeleteCalibration(id), IsOk());
}

TEST_P(StoreJobs, WhoLostTheClaimStoresNothing) {
  const std::string id = Create();
  const ClaimedJob stalled = ClaimAndDie(kFirst);
  const ClaimedJob taken = Claim(kSecond);
  EXPECT_EQ(taken.claim.calibration_id, id);
  EXPECT_EQ(taken.calibration.attempt_count, 2u);
  EXPECT_THAT(store().RenewJob(stalled.claim, {}),
              StatusIs(absl::StatusCode::kAborted,
                       AllOf(HasSubstr(id), HasSubstr("rigcal-worker on two (process 22)"))));
  EXPECT_THAT(store().FinishJob(stalled.claim, Succeeded(stalled.calibration, 1)),
              StatusIs(absl::StatusCode::kAborted, HasSubstr("nothing of this solve is stored")));
  EXPECT_FALSE(store().GetCalibration(id)->result.has_value());
  ASSERT_THAT(store().FinishJob(taken.claim, Succeeded(taken.calibration, 2)), IsOk());
  // Also when both came to the same end.
  EXPECT_THAT(store().FinishJob(stalled.claim, Succeeded(stalled.calibration, 1)),
              StatusIs(absl::StatusCode::kAborted, HasSubstr("two")));
  EXPECT_EQ(store().GetCalibration(id)->result->instant_count, 2u);
}

TEST_P(StoreJobs, OneGivenBackIsNoAttempt) {
  const std::string id = Create();
  ClaimedJob job = Claim(kFirst);
  job.calibration.state = CalibrationState::kQueued;
  job.calibration.attempt_count = 0;
  ASSERT_THAT(store().FinishJob(job.claim, job.calibration), IsOk());
  const ClaimedJob again = Claim(kSecond);
  EXPECT_EQ(again.claim.calibration_id, id);
  EXPECT_EQ(again.calibration.attempt_count, 1u);
  EXPECT_THAT(store().FinishJob(job.claim, Succeeded(job.calibration)),
              StatusIs(absl::StatusCode::kAborted, _));
}

TEST_P(StoreJobs, TriedTooOftenAreToBeEnded) {
  Create();
  const ClaimOptions options{.max_attempts = 2};
  EXPECT_THAT(ClaimAndDie(kFirst).give_up, IsEmpty());
  EXPECT_TRUE(NoJob(kSecond, {.max_attempts = 2, .only_to_end = true}));
  EXPECT_THAT(ClaimAndDie(kFirst).give_up, IsEmpty());
  const ClaimedJob last = Claim(kSecond, {.max_attempts = 2, .only_to_end = true});
  EXPECT_THAT(last.give_up, AllOf(HasSubstr("2 times"), HasSubstr("on one (process 11)")));
  Calibration failed = last.calibration;
  failed.state = CalibrationState::kFailed;
  EXPECT_THAT(store().FinishJob(last.claim, failed), IsOk());
  EXPECT_TRUE(NoJob(kFirst, options));
}

TEST_P(StoreJobs, QueuedAreCancelledAtOnceAndRunningOnesByTheirHolder) {
  const std::string running = Create(), queued = Create();
  const ClaimedJob job = Claim(kFirst);
  ASSERT_OK_AND_ASSIGN(const Calibration cancelled, store().CancelJob(queued, 9));
  EXPECT_EQ(cancelled.state, CalibrationState::kCancelled);
  EXPECT_EQ(cancelled.error, "cancelled");
  EXPECT_EQ(store().GetCalibration(queued)->end_utc_ns, 9);
  EXPECT_TRUE(NoJob(kSecond));
  ASSERT_OK_AND_ASSIGN(const Calibration asked, store().CancelJob(running, 9));
  EXPECT_EQ(asked.state, CalibrationState::kRunning);
  ASSERT_OK_AND_ASSIGN(const bool cancel, store().RenewJob(job.claim, {}));
  EXPECT_TRUE(cancel);
  ASSERT_THAT(store().FinishJob(job.claim, Succeeded(job.calibration)), IsOk());
  EXPECT_EQ(store().CancelJob(running, 9)->state, CalibrationState::kSucceeded);
  EXPECT_THAT(store().CancelJob("c-999999", 9), StatusIs(absl::StatusCode::kNotFound, _));
}

TEST_P(StoreJobs, CancelledOnesOfADeadHolderAreToBeEnded) {
  const std::string id = Create();
  if (store().jobs_are_shared()) {
    Claim(kFirst, {.lease = std::chrono::milliseconds(-1)});
    ASSERT_THAT(store().CancelJob(id, 9), IsOk());
  } else {
    Claim(kFirst);
    ASSERT_THAT(store().CancelJob(id, 9), IsOk());
    ASSERT_THAT(store().AdoptJobs("1.0"), IsOk());
  }
  EXPECT_TRUE(Claim(kSecond, {.only_to_end = true}).cancel);
}

TEST_P(StoreJobs, AreForTheirSoftwareVersion) {
  const std::string id = Create("2.0");
  EXPECT_TRUE(NoJob(kFirst));
  ASSERT_THAT(store().AdoptJobs("1.0"), IsOk());
  EXPECT_EQ(Claim(kFirst).claim.calibration_id, id);
  // One that is solved stays with the version that does.
  if (!store().jobs_are_shared()) return;
  ASSERT_THAT(store().AdoptJobs("3.0"), IsOk());
  EXPECT_EQ(store().ListJobs()->at(0).software_version, "1.0");
}

TEST_P(StoreJobs, WhatAServerHeldIsQueuedAgainByTheNext) {
  Create();
  JobHolder server = kFirst;
  server.is_server = true;
  const ClaimedJob before = Claim(server);
  EXPECT_TRUE(NoJob(kSecond));
  ASSERT_THAT(store().AdoptJobs("1.0"), IsOk());
  EXPECT_EQ(store().ListJobs()->at(0).state, CalibrationState::kQueued);
  EXPECT_EQ(Claim(kSecond).calibration.attempt_count, 2u);
  EXPECT_THAT(store().FinishJob(before.claim, Succeeded(before.calibration)),
              StatusIs(absl::StatusCode::kAborted, _));
  if (!store().jobs_are_shared()) return;
  ASSERT_THAT(store().AdoptJobs("1.0"), IsOk());
  EXPECT_EQ(store().ListJobs()->at(0).state, CalibrationState::kRunning)
      << "a worker keeps its job";
}

TEST_P(StoreJobs, AClockThatWasSetBackKeepsNoJobForGood) {
  Create();
  // As the lease of a holder that is gone looks after the clock was set back by an hour.
  const ClaimedJob gone = Claim(kFirst, {.lease = std::chrono::hours(1)});
  if (!store().jobs_are_shared()) {
    EXPECT_TRUE(NoJob(kSecond)) << "a claim of one process has no end";
    return;
  }
  const ClaimedJob next = Claim(kSecond);
  EXPECT_GT(next.claim.fence, gone.claim.fence);
  EXPECT_THAT(store().FinishJob(gone.claim, Succeeded(gone.calibration)),
              StatusIs(absl::StatusCode::kAborted, _));
}

TEST_P(StoreJobs, ManyTakersGetEachJobOnce) {
  constexpr int kJobs = 24;
  for (int i = 0; i < kJobs; ++i) Create();
  std::vector<std::thread> takers;
  std::vector<int> taken(4);
  for (size_t t = 0; t < taken.size(); ++t) {
    takers.emplace_back([&, t] {
      const JobHolder holder{
          .host = "host", .pid = static_cast<int64_t>(t), .software_version = "1.0"};
      while (true) {
        const auto job = store().ClaimJob(holder, {});
        ASSERT_THAT(job, IsOk());
        if (!*job) return;
        ASSERT_THAT(store().FinishJob((*job)->claim, Succeeded((*job)->calibration)), IsOk());
        ++taken[t];
      }
    });
  }
  for (std::thread& taker : takers) taker.join();
  EXPECT_EQ(taken[0] + taken[1] + taken[2] + taken[3], kJobs);
  EXPECT_THAT(*store().ListJobs(), IsEmpty());
}

TEST_P(StoreJobs, ListsWorkers) {
  const std::string id = Create();
  ASSERT_THAT(store().NoteWorker(kSecond), IsOk());
  ASSERT_THAT(store().NoteWorker(kFirst), IsOk());
  ASSERT_THAT(store().NoteWorker(kFirst), IsOk());
  Claim(kSecond);
  ASSERT_OK_AND_ASSIGN(const auto workers, store().ListWorkers());
  ASSERT_THAT(workers, SizeIs(2));
  EXPECT_EQ(workers[0].holder, kFirst);
  EXPECT_THAT(workers[0].calibration_ids, IsEmpty());
  EXPECT_THAT(workers[1].calibration_ids, ElementsAre(id));
  EXPECT_GT(workers[0].start_utc_ns, int64_t{1'500'000'000} * 1'000'000'000);
  EXPECT_GE(workers[0].heartbeat_utc_ns, workers[0].start_utc_ns);
  EXPECT_TRUE(workers[0].is_alive);
  ASSERT_THAT(store().ForgetWorker(kFirst), IsOk());
  EXPECT_THAT(*store().ListWorkers(), SizeIs(1));
}

RIGCAL_FOR_EVERY_STORE(StoreJobs);

}  // namespace
}  // namespace rigcal::server::store_jobs_test
