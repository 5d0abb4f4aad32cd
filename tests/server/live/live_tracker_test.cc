// SPDX-License-Identifier: Apache-2.0
#include "server/live/live_tracker.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "tests/server/live/live_fixture.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing::live_tracker_test {
namespace {

using server::LiveCameraState;
using server::LiveEstimate;
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::Ge;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Le;
using ::testing::SizeIs;

using LiveTracker = LiveFixture;

// What a goal of 0.5 mm needs to be reached.
LiveEstimate GoodEstimate(int64_t time_utc_ns, const std::vector<std::string>& cameras) {
  LiveEstimate estimate;
  estimate.session_id = "wave";
  estimate.state = server::EstimateState::kReady;
  estimate.time_utc_ns = time_utc_ns;
  estimate.scale_known = true;
  for (const std::string& camera : cameras) {
    server::LiveEstimatedCamera estimated;
    estimated.camera = camera;
    estimated.time_offset_s = 0.004;
    estimated.reprojection_rms_px = 0.3;
    estimate.cameras.push_back(estimated);
  }
  estimate.volume = server::LiveVolume{};
  estimate.volume->p95_mm = 0.4;
  estimate.held_out = server::LiveHeldOut{.rms_px = 0.3, .expected_rms_px = 0.3, .agrees = true};
  return estimate;
}

TEST_F(LiveTracker, SaysNothingOfARigThatNobodyKnows) {
  const auto unknown = tracker_->Get("nowhere");
  ASSERT_NE(unknown, nullptr);
  EXPECT_EQ(unknown->rig, "nowhere");
  EXPECT_THAT(unknown->cameras, IsEmpty());
  EXPECT_EQ(unknown->session.value, nullptr);
}

TEST_F(LiveTracker, ShowsWhatCamerasDo) {
  StartWave({"left", "right"});
  EXPECT_EQ(camera("left").state, LiveCameraState::kCapturing);
  Wave(3, {{"left", SeeWand}, {"right", SeeNothing}});
  const server::LiveCamera left = camera("left");
  EXPECT_NEAR(left.observation_rate_hz, 50, 1);
  EXPECT_NEAR(left.wand_rate_hz, 50, 3);
  EXPECT_EQ(left.observation_count, 150u);
  EXPECT_EQ(left.wand_count, 150u);
  EXPECT_EQ(left.agent_id, "pc");
  EXPECT_THAT(left.coverage.counts, SizeIs(16 * 12));
  EXPECT_GT(left.coverage.covered_share, 0);
  EXPECT_THAT(left.trail, SizeIs(::testing::AllOf(Ge(20u), Le(40u))));
  for (size_t i = 1; i < left.trail.size(); ++i) {
    EXPECT_GT(left.trail[i - 1].age_ms, left.trail[i].age_ms);
  }
  EXPECT_LE(left.trail.front().age_ms, 2000u);
  const server::LiveCamera right = camera("right");
  EXPECT_NEAR(right.observation_rate_hz, 50, 1);
  EXPECT_EQ(right.wand_rate_hz, 0);
  EXPECT_EQ(right.wand_count, 0u);
  EXPECT_THAT(right.trail, IsEmpty());
  EXPECT_EQ(state()->session.value->session.id, "wave");
}

TEST_F(LiveTracker, RatesAndTrailsEndWithTheRows) {
  StartWave({"left"});
  Wave(3, {{"left", SeeWand}});
  Pass(3);
  EXPECT_EQ(camera("left").observation_rate_hz, 0);
  EXPECT_THAT(camera("left").trail, IsEmpty());
  EXPECT_EQ(camera("left").observation_count, 150u);
}

TEST_F(LiveTracker, CountsInstantsThatCamerasHaveInCommon) {
  StartWave({"a", "b", "c"});
  Wave(2, {{"a", SeeWand}, {"b", SeeWand}, {"c", SeeNothing}});
  Wave(1, {{"a", SeeWand}, {"b", SeeNothing}, {"c", SeeWand}});
  const server::LiveOverlap overlap = *state()->overlap.value;
  EXPECT_THAT(overlap.cameras, ElementsAre("a", "b", "c"));
  ASSERT_THAT(overlap.counts, SizeIs(3));
  EXPECT_NEAR(overlap.counts[0], 100, 5);  // a, b
  // The overlap is made twice a second.
  EXPECT_NEAR(overlap.counts[1], 50, 27);  // a, c
  EXPECT_EQ(overlap.counts[2], 0u);        // b, c
  EXPECT_NEAR(camera("a").shared_instant_count, 150, 8);
  EXPECT_NEAR(camera("b").shared_instant_count, 100, 5);
}

TEST_F(LiveTracker, AClockFarAheadDoesNotHideTheOthers) {
  clock_offset_s_["c"] = 86400;
  StartWave({"a", "b", "c"});
  Wave(3, {{"a", SeeWand}, {"b", SeeWand}, {"c", SeeWand}});
  EXPECT_NEAR(camera("a").shared_instant_count, 150, 8);
  EXPECT_EQ(camera("c").shared_instant_count, 0u);
}

TEST_F(LiveTracker, ChangesTheRevisionOnlyWithTheState) {
  StartWave({"left", "right"});
  Wave(3, {{"left", SeeWand}, {"right", SeeWand}});
  // Rates, trails and what alerts begin after silence settle.
  Pass(40);
  const auto before = state();
  Pass(2);
  EXPECT_EQ(state()->revision, before->revision);
  Wave(0.1, {{"left", SeeWand}});
  const auto after = state();
  EXPECT_GT(after->revision, before->revision);
  EXPECT_GT(after->cameras.at("left").revision, before->revision);
  EXPECT_LE(after->cameras.at("right").revision, before->revision);
  EXPECT_LE(after->agents.revision, before->revision);
}

TEST_F(LiveTracker, SaysWhichCamerasHaveGone) {
  const ConnectedAgent agent = Connect(MakeAgent("pc", {"left", "right"}));
  tracker_->Update();
  Pass(1);
  const auto before = state();
  EXPECT_THAT(before->cameras, SizeIs(2));
  EXPECT_EQ(camera("left").state, LiveCameraState::kIdle);
  coordinator().DisconnectAgent(agent.registration);
  Pass(1);
  EXPECT_THAT(state()->cameras, IsEmpty());
  ASSERT_THAT(state()->removed_cameras, SizeIs(2));
  EXPECT_GT(state()->removed_cameras[0].first, before->revision);
  EXPECT_FALSE(state()->agents.value->front().connected);
}

TEST_F(LiveTracker, AnotherSessionBeginsAnew) {
  StartWave({"left"});
  Wave(3, {{"left", SeeWand}});
  const auto before = state();
  ASSERT_THAT(coordinator().StopSession("wave", 0.001), IsOk());
  AwaitFinished("wave");
  now_s_ += 1;
  ASSERT_THAT(coordinator().CreateSession(NewSession("next")), IsOk());
  tracker_->Update();
  EXPECT_EQ(state()->session.value->session.id, "next");
  EXPECT_GT(state()->full_since, before->revision);
  EXPECT_EQ(camera("left").observation_count, 0u);
}

TEST_F(LiveTracker, KnowsTheCountsAfterARestart) {
  StartWave({"left"});
  Wave(2, {{"left", SeeWand}});
  const std::string incarnation = state()->incarnation;
  RestartTracker();
  EXPECT_NE(state()->incarnation, incarnation);
  EXPECT_EQ(state()->session.value->session.id, "wave");
  EXPECT_EQ(camera("left").observation_count, 100u);
  EXPECT_EQ(camera("left").state, LiveCameraState::kOffline);
  Wave(1, {{"left", SeeWand}});
  EXPECT_EQ(camera("left").observation_count, 150u);
}

TEST_F(LiveTracker, DoesNotCountWhatIsDeliveredAgain) {
  StartWave({"left"});
  server::Delivery sent;
  Send("left", now_s_, 10, SeeWand, [&](server::Delivery* delivery) { sent = *delivery; });
  const auto outcomes = store().Append({&sent, 1});
  ASSERT_THAT(outcomes, IsOk());
  tracker_->RecordDelivery(sent, outcomes->front());
  tracker_->Update();
  EXPECT_EQ(camera("left").observation_count, 10u);
}

TEST_F(LiveTracker, GivesAcceptedRowsToTheTap) {
  std::vector<uint32_t> seqs;
  tracker_->SetRowTap([&](const StreamKey& stream, const ObservationBatch& batch) {
    EXPECT_EQ(stream.camera, "left");
    for (uint32_t seq = batch.first_seq; seq < batch.end_seq(); ++seq) seqs.push_back(seq);
  });
  StartWave({"left"});
  Send("left", now_s_, 4, SeeWand);
  Send("left", now_s_ + 1, 4, SeeWand, [](server::Delivery* delivery) {
    delivery->refused_rows.push_back({.row = 1, .reason = RefusalReason::kNotFinite});
  });
  EXPECT_THAT(seqs, ElementsAre(1, 2, 3, 4, 5, 7, 8));
}

TEST_F(LiveTracker, ShowsTheEstimateOfItsSessionOnly) {
  StartWave({"left", "right"});
  LiveEstimate estimate = GoodEstimate(options_.utc_now_ns(), {"left", "right"});
  estimate.session_id = "another";
  tracker_->SetEstimate(estimate);
  tracker_->Update();
  EXPECT_EQ(state()->estimate.value, nullptr);
  estimate.session_id = "wave";
  estimate.needs.resize(40);
  estimate.history.resize(1000);
  estimate.history.back().p95_mm = 0.7;
  tracker_->SetEstimate(estimate);
  tracker_->Update();
  ASSERT_NE(state()->estimate.value, nullptr);
  EXPECT_THAT(state()->estimate.value->needs, SizeIs(16));
  EXPECT_THAT(state()->estimate.value->history, SizeIs(300));
  EXPECT_EQ(state()->estimate.value->history.back().p95_mm, 0.7);
  EXPECT_DOUBLE_EQ(camera("left").clock.time_offset_s.value(), 0.004);
  EXPECT_DOUBLE_EQ(camera("left").reprojection_rms_px, 0.3);
}

TEST_F(LiveTracker, StopsASessionThatHasReachedItsGoal) {
  tracker_->Start();
  StartWave({"left", "right"}, [](Session* session) {
    session->goal = SessionGoal{.until_mm = 0.5, .min_duration_s = 20};
  });
  LiveEstimate estimate = GoodEstimate(options_.utc_now_ns(), {"left", "right"});
  estimate.volume->p95_mm = 0.6;
  tracker_->SetEstimate(estimate);
  tracker_->Update();
  EXPECT_EQ(state()->goal.value->now_mm, 0.6);
  EXPECT_THAT(state()->goal.value->why_not, HasSubstr("0.60 mm"));

  estimate.volume->p95_mm = 0.4;
  tracker_->SetEstimate(estimate);
  tracker_->Update();
  EXPECT_THAT(state()->goal.value->why_not, HasSubstr("at least 20 s"));

  now_s_ += 25;
  estimate.time_utc_ns = options_.utc_now_ns();
  tracker_->SetEstimate(estimate);
  tracker_->Update();
  tracker_->WaitIdle();
  ASSERT_OK_AND_ASSIGN(const SessionView view, View("wave"));
  EXPECT_EQ(view.session.state, SessionState::kDraining);
  EXPECT_EQ(view.session.stop_reason, "the expected error is 0.40 mm, below 0.5 mm");
  tracker_->Update();
  EXPECT_TRUE(state()->goal.value->reached);
  EXPECT_THAT(state()->goal.value->why_not, IsEmpty());
  // Whoever presses start now is told.
  EXPECT_THAT(
      coordinator().StartSession("wave"),
      StatusIs(absl::StatusCode::kFailedPrecondition,
               ::testing::AllOf(HasSubstr("draining since 2027-"), HasSubstr("below 0.5 mm"))));
}

TEST_F(LiveTracker, NeverStopsOnCountsAlone) {
  tracker_->Start();
  StartWave({"left", "right"}, [](Session* session) {
    session->goal = SessionGoal{.until_mm = 1000, .min_duration_s = 0};
  });
  Wave(30, {{"left", SeeWand}, {"right", SeeWand}});
  tracker_->WaitIdle();
  ASSERT_OK_AND_ASSIGN(const SessionView view, View("wave"));
  EXPECT_EQ(view.session.state, SessionState::kCapturing);
  EXPECT_EQ(state()->goal.value->why_not, "there is no estimate yet");
}

}  // namespace
}  // namespace rigcal::testing::live_tracker_test
