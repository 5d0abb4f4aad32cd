// SPDX-License-Identifier: Apache-2.0
#include "server/live/session_goal.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <limits>

namespace rigcal::testing::session_goal_test {
namespace {

using server::LiveEstimate;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr int64_t kNow = 1'000'000'000'000;

class JudgeGoal : public ::testing::Test {
 protected:
  void SetUp() override {
    for (const char* name : {"left", "right"}) {
      SessionCamera camera;
      camera.description.camera = name;
      session_.cameras.push_back(camera);
      server::LiveEstimatedCamera estimated;
      estimated.camera = name;
      estimate_.cameras.push_back(estimated);
    }
    estimate_.state = server::EstimateState::kReady;
    estimate_.time_utc_ns = kNow - 1'000'000'000;
    estimate_.scale_known = true;
    estimate_.volume = server::LiveVolume{};
    estimate_.volume->p95_mm = 0.46;
    estimate_.held_out =
        server::LiveHeldOut{.rms_px = 0.31, .expected_rms_px = 0.3, .agrees = true};
  }
  server::LiveGoal Judge(double elapsed_s = 30) const {
    return server::JudgeGoal(goal_, session_, &estimate_, elapsed_s, kNow);
  }

  Session session_;
  SessionGoal goal_{.until_mm = 0.5, .min_duration_s = 20};
  LiveEstimate estimate_;
};

TEST_F(JudgeGoal, IsReached) {
  const server::LiveGoal goal = Judge();
  EXPECT_TRUE(goal.reached) << goal.why_not;
  EXPECT_THAT(goal.why_not, IsEmpty());
  EXPECT_EQ(goal.now_mm, 0.46);
  EXPECT_EQ(goal.until_mm, 0.5);
  EXPECT_EQ(server::StopReason(goal), "the expected error is 0.46 mm, below 0.5 mm");
}

TEST_F(JudgeGoal, SaysWhyItGoesOn) {
  const LiveEstimate good = estimate_;
  const std::vector<std::pair<const char*, std::function<void(LiveEstimate*)>>> reasons = {
      {"no estimate yet", [](LiveEstimate* e) { e->state = server::EstimateState::kWaiting; }},
      {"left and top have 3 of 20",
       [](LiveEstimate* e) {
         e->state = server::EstimateState::kWaiting;
         e->needs = {
             {.camera_a = "left", .camera_b = "top", .common_count = 3, .needed_count = 20}};
       }},
      {"fails: no",
       [](LiveEstimate* e) {
         e->state = server::EstimateState::kFailed;
         e->problem = "no";
       }},
      {"60 s old", [](LiveEstimate* e) { e->time_utc_ns = kNow - 60'000'000'000; }},
      {"scale", [](LiveEstimate* e) { e->scale_known = false; }},
      {"no part in the estimate yet: right", [](LiveEstimate* e) { e->cameras.pop_back(); }},
      {"not known yet", [](LiveEstimate* e) { e->volume.reset(); }},
      {"not known yet", [](LiveEstimate* e) { e->volume->p95_mm = 0; }},
      {"not known yet",
       [](LiveEstimate* e) { e->volume->p95_mm = std::numeric_limits<double>::quiet_NaN(); }},
      {"0.50 mm, the goal 0.5 mm", [](LiveEstimate* e) { e->volume->p95_mm = 0.5; }},
      {"no held-out check", [](LiveEstimate* e) { e->held_out.reset(); }},
      {"0.90 px where 0.30 px", [](LiveEstimate* e) {
         e->held_out->agrees = false;
         e->held_out->rms_px = 0.9;
       }}};
  for (const auto& [text, change] : reasons) {
    estimate_ = good;
    change(&estimate_);
    const server::LiveGoal goal = Judge();
    EXPECT_FALSE(goal.reached) << text;
    EXPECT_THAT(goal.why_not, HasSubstr(text));
  }
  estimate_ = good;
  EXPECT_THAT(Judge(12).why_not, HasSubstr("12 s; it goes on for at least 20 s"));
  EXPECT_FALSE(server::JudgeGoal(goal_, session_, nullptr, 1000, kNow).reached);
}

}  // namespace
}  // namespace rigcal::testing::session_goal_test
