// SPDX-License-Identifier: Apache-2.0
#include "server/estimate/estimate_loop.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <new>
#include <string>
#include <utility>
#include <vector>

#include "tests/server/session/session_fixture.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing::estimate_loop_test {
namespace {

using server::EstimateLoop;
using server::EstimateState;
using server::EstimateTask;
using server::LiveEstimate;
using server::RunningOutcome;
using ::testing::HasSubstr;

// A loop over a store with faults on demand, and an estimate that a test makes.
class EstimateLoopTest : public SessionFixture {
 protected:
  void SetUp() override {
    SessionFixture::SetUp();
    StartByHand("wave", {"left", "right"});
    loop_ = std::make_unique<EstimateLoop>(
        server::EstimateLoopOptions{.max_age = std::chrono::milliseconds(10)}, &faulty(),
        [this](EstimateTask task, const std::atomic<bool>&) { return Estimate(std::move(task)); },
        [this](LiveEstimate shown) {
          std::function<void()> hook;
          {
            const std::lock_guard lock(mutex_);
            shown_.push_back(std::move(shown));
            hook = std::exchange(on_show_, nullptr);
          }
          changed_.notify_all();
          if (hook) hook();
        });
    loop_->SetWaits([this](const std::string& id) { return id == "wave" && waits_; });
    loop_->Start();
  }
  void TearDown() override {
    loop_->Shutdown();
    SessionFixture::TearDown();
  }

  // Rows of both cameras, as they become durable.
  void AddRows() {
    for (const char* camera : {"left", "right"}) {
      const StreamKey stream{"wave", camera, 1};
      loop_->AddRows(stream, MakeBatch(stream, next_seq_, next_seq_ + 9));
    }
    next_seq_ += 10;
  }
  // Counts rounds in `start.round`, as the solver does.
  absl::StatusOr<RunningOutcome> Estimate(EstimateTask task) {
    std::function<void()> hook;
    {
      const std::lock_guard lock(mutex_);
      hook = std::exchange(on_estimate_, nullptr);
    }
    if (hook) hook();
    RunningOutcome outcome;
    outcome.estimate.emplace();
    outcome.estimate->next = task.start;
    ++outcome.estimate->next.round;
    const std::lock_guard lock(mutex_);
    rounds_.push_back(static_cast<size_t>(task.start.round));
    changed_.notify_all();
    return outcome;
  }
  // With new rows whenever nothing happens.
  bool Await(const std::function<bool()>& condition) {
    for (int i = 0; i < 500; ++i) {
      AddRows();
      std::unique_lock lock(mutex_);
      if (changed_.wait_for(lock, std::chrono::milliseconds(200), condition)) return true;
    }
    return false;
  }
  size_t RoundCount() {
    const std::lock_guard lock(mutex_);
    return rounds_.size();
  }
  template <typename Value>
  void Set(Value* member, Value value) {
    const std::lock_guard lock(mutex_);
    *member = std::move(value);
  }

  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<LiveEstimate> shown_;
  std::vector<size_t> rounds_;
  std::function<void()> on_estimate_, on_show_;
  std::atomic<bool> waits_ = false;
  uint32_t next_seq_ = 1;
  std::unique_ptr<EstimateLoop> loop_;
};

TEST_F(EstimateLoopTest, GoesOnWithTheLastEstimate) {
  ASSERT_TRUE(Await([&] { return rounds_.size() >= 3; }));
  EXPECT_EQ(rounds_[0], 0u);
  EXPECT_EQ(rounds_[2], 2u);
}

TEST_F(EstimateLoopTest, WaitsForRowsFromBefore) {
  waits_ = true;
  AddRows();
  const int calls = faulty().CallCount("GetSession");
  // Longer than the loop takes to look, several times.
  std::unique_lock lock(mutex_);
  EXPECT_FALSE(changed_.wait_for(lock, std::chrono::seconds(1), [&] { return !rounds_.empty(); }));
  EXPECT_EQ(faulty().CallCount("GetSession"), calls);
  waits_ = false;
  EXPECT_TRUE(changed_.wait_for(lock, std::chrono::seconds(30), [&] { return !rounds_.empty(); }));
}

TEST_F(EstimateLoopTest, KeepsItsStartWhileTheStoreCannotAnswer) {
  for (const absl::StatusCode code :
       {absl::StatusCode::kUnavailable, absl::StatusCode::kInternal, absl::StatusCode::kDataLoss}) {
    SCOPED_TRACE(absl::StatusCodeToString(code));
    size_t before = 0;
    ASSERT_TRUE(Await([&] { return (before = rounds_.size()) > 0; }));
    faulty().Fail("GetSession", absl::Status(code, "the store is busy"));
    const int calls = faulty().CallCount("GetSession");
    ASSERT_TRUE(Await([&] { return faulty().CallCount("GetSession") > calls + 1; }));
    faulty().Fail("GetSession", absl::OkStatus());
    ASSERT_TRUE(Await([&] { return rounds_.size() > before + 1; }));
    const std::lock_guard lock(mutex_);
    for (size_t i = 1; i < rounds_.size(); ++i) EXPECT_EQ(rounds_[i], rounds_[i - 1] + 1);
  }
}

TEST_F(EstimateLoopTest, ForgetsASessionThatIsGone) {
  ASSERT_TRUE(Await([&] { return rounds_.size() >= 2; }));
  faulty().Fail("GetSession", absl::NotFoundError("no session wave"));
  const int calls = faulty().CallCount("GetSession");
  ASSERT_TRUE(Await([&] { return faulty().CallCount("GetSession") > calls; }));
  faulty().Fail("GetSession", absl::OkStatus());
  ASSERT_TRUE(Await([&] { return std::ranges::count(rounds_, 0u) == 2; }));
}

TEST_F(EstimateLoopTest, SurvivesWhatAnEstimateThrows) {
  Set(&on_estimate_, std::function<void()>([] { throw std::bad_alloc(); }));
  ASSERT_TRUE(Await([&] { return rounds_.size() >= 2; }));
  const std::lock_guard lock(mutex_);
  EXPECT_EQ(shown_.front().state, EstimateState::kFailed);
  EXPECT_THAT(shown_.front().problem, HasSubstr("bad_alloc"));
  EXPECT_EQ(shown_.back().state, EstimateState::kReady);
}

TEST_F(EstimateLoopTest, SurvivesWhatTheStoreThrows) {
  ASSERT_TRUE(Await([&] { return rounds_.size() >= 1; }));
  const int calls = faulty().CallCount("GetSession");
  faulty().OnCall("GetSession", [] { throw std::bad_alloc(); });
  ASSERT_TRUE(Await([&] { return faulty().CallCount("GetSession") > calls + 1; }));
  faulty().OnCall("GetSession", nullptr);
  const size_t before = RoundCount();
  ASSERT_TRUE(Await([&] { return rounds_.size() > before; }));
  const std::lock_guard lock(mutex_);
  EXPECT_EQ(std::ranges::count(rounds_, 0u), 1);
}

TEST_F(EstimateLoopTest, SurvivesWhatItsViewersThrow) {
  Set(&on_show_, std::function<void()>([] { throw 7; }));
  ASSERT_TRUE(Await([&] { return rounds_.size() >= 3; }));
}

}  // namespace
}  // namespace rigcal::testing::estimate_loop_test
