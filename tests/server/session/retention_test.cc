// SPDX-License-Identifier: Apache-2.0
#include "server/session/retention.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <string>
#include <thread>

#include "tests/server/session/runner_fixture.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing::retention_test {
namespace {

using ::testing::HasSubstr;

constexpr int64_t kDayNs = int64_t{24} * 3600 * 1'000'000'000;

class RetentionTest : public RunnerFixture {
 protected:
  RetentionTest() {
    options_.utc_now_ns = [this] { return now_utc_ns_; };
  }
  server::RetentionOptions OfDays(int days) {
    return {.max_age = std::chrono::hours(24 * days), .utc_now_ns = [this] { return now_utc_ns_; }};
  }
  // One look with these options.
  server::RetentionStats RunOnce(const server::RetentionOptions& options) {
    server::Retention retention(options, faulty_.get(), coordinator_.get());
    EXPECT_THAT(retention.Run(), IsOk());
    return retention.Stats();
  }
  // The runner lets go of its sessions a moment after their calibration has ended.
  server::RetentionStats RunUntilDeleted(const server::RetentionOptions& options) {
    server::RetentionStats stats;
    for (int i = 0; i < 10'000 && stats.session_count == 0; ++i) {
      stats = RunOnce(options);
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    return stats;
  }
  bool HasRows(const std::string& id) { return !ReadRows(store(), id).empty(); }

  int64_t now_utc_ns_ = 1000 * kDayNs;
};

TEST_F(RetentionTest, IsOffByDefault) {
  FinishByHand("old", {"left"});
  now_utc_ns_ += 10'000 * kDayNs;
  const server::RetentionOptions options;
  EXPECT_FALSE(options.enabled());
  EXPECT_EQ(RunOnce(options).session_count, 0u);
  EXPECT_TRUE(HasRows("old"));
}

TEST_F(RetentionTest, DeletesObservationsThatAreTooOldAndKeepsTheSession) {
  FinishByHand("old", {"left", "right"});
  now_utc_ns_ += 5 * kDayNs;
  FinishByHand("young", {"left"});
  StartByHand("running", {"left", "right"});
  Deliver({"running", "left", 1}, 1, 20);
  now_utc_ns_ += 6 * kDayNs;
  const server::RetentionStats stats = RunOnce(OfDays(10));
  EXPECT_EQ(stats.session_count, 1u);
  EXPECT_EQ(stats.last_session_id, "old");
  EXPECT_EQ(stats.last_run_utc_ns, now_utc_ns_);
  EXPECT_FALSE(HasRows("old"));
  EXPECT_TRUE(HasRows("young"));
  EXPECT_TRUE(HasRows("running"));
  ASSERT_OK_AND_ASSIGN(const SessionView view, View("old"));
  EXPECT_EQ(view.session.observations_delete_utc_ns, now_utc_ns_);
  EXPECT_EQ(view.counts[0].observation_count, 20u);
  EXPECT_THAT(runner().CreateCalibration({"old"}, {}),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("retention")));
  EXPECT_EQ(RunOnce(OfDays(10)).session_count, 0u) << "once only";
}

TEST_F(RetentionTest, KeepsWhatACalibrationWasMadeFromUnlessToldOtherwise) {
  FinishByHand("used", {"left", "right"});
  FinishByHand("failed", {"left", "right"});
  ASSERT_OK_AND_ASSIGN(const Calibration kept, runner().CreateCalibration({"used"}, {}));
  AwaitEnd(kept.id);
  solver_.SetOutcome(absl::InternalError("no"));
  ASSERT_OK_AND_ASSIGN(const Calibration failed, runner().CreateCalibration({"failed"}, {}));
  AwaitEnd(failed.id);
  now_utc_ns_ += 20 * kDayNs;
  server::RetentionOptions options = OfDays(10);
  const server::RetentionStats stats = RunUntilDeleted(options);
  EXPECT_EQ(stats.session_count, 1u);
  EXPECT_EQ(stats.kept_session_count, 1u);
  EXPECT_TRUE(HasRows("used"));
  EXPECT_FALSE(HasRows("failed"));
  ASSERT_THAT(runner().DeleteCalibration(kept.id), IsOk());
  EXPECT_EQ(RunUntilDeleted(options).session_count, 1u);
  EXPECT_FALSE(HasRows("used"));

  FinishByHand("again", {"left", "right"});
  solver_.SetOutcome(CalibrationResult{});
  ASSERT_OK_AND_ASSIGN(const Calibration last, runner().CreateCalibration({"again"}, {}));
  AwaitEnd(last.id);
  now_utc_ns_ += 20 * kDayNs;
  options.delete_calibrated = true;
  EXPECT_EQ(RunUntilDeleted(options).session_count, 1u);
  EXPECT_FALSE(HasRows("again"));
}

TEST_F(RetentionTest, DeletesTheOldestUntilTheDatabaseIsSmallEnough) {
  for (const char* id : {"one", "two", "three"}) {
    FinishByHand(id, {"left"}, 20'000);
    now_utc_ns_ += kDayNs;
  }
  const server::StoreHealth health = store().Health();
  const uint64_t used = health.size_bytes - health.unused_bytes;
  ASSERT_GT(used, 3'000'000u);
  server::RetentionOptions options;
  options.max_bytes = used - 1;
  EXPECT_EQ(RunOnce(options).session_count, 1u);
  EXPECT_FALSE(HasRows("one"));
  EXPECT_TRUE(HasRows("two"));
  EXPECT_TRUE(HasRows("three"));
  options.max_bytes = 1;
  EXPECT_EQ(RunOnce(options).session_count, 2u);
}

TEST_F(RetentionTest, WaitsForReadersAndReportsFailures) {
  FinishByHand("read", {"left"});
  now_utc_ns_ += 20 * kDayNs;
  {
    const auto hold = coordinator().HoldSessions({"read"});
    EXPECT_EQ(RunOnce(OfDays(10)).session_count, 0u);
  }
  faulty().Fail("DeleteObservations", absl::InternalError("disk broken"));
  server::Retention retention(OfDays(10), faulty_.get(), coordinator_.get());
  EXPECT_FALSE(retention.Run().ok());
  EXPECT_EQ(retention.Stats().problem, "disk broken");
  EXPECT_TRUE(HasRows("read"));
}

}  // namespace
}  // namespace rigcal::testing::retention_test
