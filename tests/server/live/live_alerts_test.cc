// SPDX-License-Identifier: Apache-2.0
// Alerts from what cameras deliver: within ten seconds of waving, and without false ones.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/server/live/live_fixture.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing::live_alerts_test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

using LiveAlerts = LiveFixture;

TEST_F(LiveAlerts, NoneWhileAllIsWell) {
  StartWave({"left", "right"});
  Wave(30, {{"left", SeeWand}, {"right", SeeWand}});
  EXPECT_THAT(AlertTexts(), IsEmpty());
}

TEST_F(LiveAlerts, NoneWhileNobodyWaves) {
  StartWave({"left", "right"});
  Wave(30, {{"left", SeeNothing}, {"right", SeeNothing}});
  EXPECT_THAT(AlertTexts(), IsEmpty());
}

TEST_F(LiveAlerts, ACameraThatNeverSeesTheWand) {
  StartWave({"left", "right", "top"});
  Wave(5, {{"left", SeeWand}, {"right", SeeWand}, {"top", SeeNothing}});
  EXPECT_THAT(AlertTexts(), IsEmpty());
  Wave(4.9, {{"left", SeeWand}, {"right", SeeWand}, {"top", SeeNothing}});
  EXPECT_THAT(AlertTexts(), ElementsAre("error no_wand top"));
  EXPECT_THAT(alerts()[0].text, HasSubstr("top has not seen the wand"));
  const int64_t since = alerts()[0].since_utc_ns;
  // It sees it: the alert stays for a moment and goes for good.
  Wave(1, {{"left", SeeWand}, {"right", SeeWand}, {"top", SeeWand}});
  EXPECT_THAT(AlertTexts(), ElementsAre("error no_wand top"));
  EXPECT_EQ(alerts()[0].since_utc_ns, since);
  Wave(10, {{"left", SeeWand}, {"right", SeeWand}, {"top", SeeNothing}});
  EXPECT_THAT(AlertTexts(), IsEmpty());
}

TEST_F(LiveAlerts, AClockThatGoesBack) {
  StartWave({"left", "right"});
  Wave(3, {{"left", SeeWand}, {"right", SeeWand}});
  clock_epoch_["right"] = 1;
  clock_offset_s_["right"] = -50;
  Wave(0.2, {{"left", SeeWand}, {"right", SeeWand}});
  EXPECT_THAT(AlertTexts(), ElementsAre("warning clock_jumped right"));
  EXPECT_EQ(camera("right").clock.clock_epoch_count, 2u);
}

TEST_F(LiveAlerts, AClockOffByMoreThanIsSearched) {
  clock_offset_s_["top"] = -3;
  StartWave({"left", "right", "top"});
  Wave(9.5, {{"left", SeeWand}, {"right", SeeWand}, {"top", SeeWand}});
  EXPECT_THAT(AlertTexts(), ElementsAre("warning clock_off top"));
}

TEST_F(LiveAlerts, AClockThatIsFoundBySearchingIsNone) {
  clock_offset_s_["top"] = -0.8;
  StartWave({"left", "right", "top"});
  Wave(20, {{"left", SeeWand}, {"right", SeeWand}, {"top", SeeWand}});
  EXPECT_THAT(AlertTexts(), IsEmpty());
}

TEST_F(LiveAlerts, TwoWands) {
  StartWave({"left", "right"});
  int row_number = 0;
  const MakeRow see_two = [&](double time_s, Observation* row) {
    SeeWand(time_s, row);
    if (++row_number % 4 >= 2) return;
    for (MarkerObservation& marker : row->markers) marker.centre_px.x() += 400;
  };
  Wave(9.5, {{"left", SeeWand}, {"right", see_two}});
  EXPECT_THAT(AlertTexts(), ElementsAre("warning two_wands right"));
}

TEST_F(LiveAlerts, SingleOutliersAreNone) {
  StartWave({"left", "right"});
  int row_number = 0;
  const MakeRow outliers = [&](double time_s, Observation* row) {
    SeeWand(time_s, row);
    if (++row_number % 8 == 0) row->markers[1].centre_px = {1000, 1000};
  };
  Wave(20, {{"left", SeeWand}, {"right", outliers}});
  EXPECT_THAT(AlertTexts(), IsEmpty());
}

TEST_F(LiveAlerts, MarkersThatDoNotFitTheWand) {
  StartWave({"left", "right"});
  const MakeRow bent = [&](double time_s, Observation* row) {
    SeeWand(time_s, row);
    row->markers[1].centre_px.y() += 60;
  };
  Wave(9.5, {{"left", SeeWand}, {"right", bent}});
  EXPECT_THAT(AlertTexts(), ElementsAre("warning implausible_labels right"));
}

TEST_F(LiveAlerts, AnAgentThatIsLost) {
  const ConnectedAgent agent = StartWave({"left"});
  Wave(2, {{"left", SeeWand}});
  coordinator().DisconnectAgent(agent.registration);
  Pass(2);
  EXPECT_THAT(AlertTexts(), ElementsAre("error agent_lost left"));
}

TEST_F(LiveAlerts, ACameraThatSendsNothing) {
  StartWave({"left", "right"});
  Wave(5, {{"left", SeeWand}});
  EXPECT_THAT(AlertTexts(), ElementsAre("error no_data right"));
}

TEST_F(LiveAlerts, WhatIsRefusedDroppedAndWaits) {
  StartWave({"left"});
  Wave(5, {{"left", SeeWand}});
  CameraReport report;
  report.stream = {.session_id = "wave", .camera = "left", .stream_epoch = 1};
  report.spool = SpoolReport{
      .last_seq = 655,
      .acknowledged_seq = 255,
      .spooled_count = 400,
      .dropped = {{.camera = "", .reason = RefusalReason::kSpoolFull, .count = 7, .example = ""}}};
  Send("left", now_s_, 5, SeeWand, [&](server::Delivery* delivery) {
    delivery->report = report;
    delivery->refused_rows.push_back({.row = 1, .reason = RefusalReason::kNotFinite});
  });
  tracker_->Update();
  Wave(2, {{"left", SeeWand}});
  EXPECT_THAT(AlertTexts(), ElementsAre("error dropping left", "warning backlog_growing left",
                                        "warning refused left"));
  EXPECT_EQ(camera("left").backlog_count, 400u);
  EXPECT_EQ(camera("left").dropped_count, 8u);
}

// --durable-on standby: the spool frees rows once the standby has them.
TEST_F(LiveAlerts, WhatASpoolKeepsOfStoredRowsDoesNotWait) {
  StartWave({"left"});
  Wave(5, {{"left", SeeWand}});
  CameraReport report;
  report.stream = {.session_id = "wave", .camera = "left", .stream_epoch = 1};
  report.spool = SpoolReport{.last_seq = 258, .spooled_count = 258, .dropped = {}};
  Send("left", now_s_, 5, SeeWand, [&](server::Delivery* delivery) { delivery->report = report; });
  tracker_->Update();
  Wave(2, {{"left", SeeWand}});
  EXPECT_THAT(AlertTexts(), ElementsAre());
  EXPECT_EQ(camera("left").backlog_count, 3u);
}

TEST_F(LiveAlerts, AnEstimateThatFails) {
  StartWave({"left"});
  server::LiveEstimate estimate;
  estimate.session_id = "wave";
  estimate.state = server::EstimateState::kFailed;
  estimate.problem = "the views do not fit together";
  tracker_->SetEstimate(estimate);
  Wave(5, {{"left", SeeWand}});
  EXPECT_THAT(AlertTexts(), ElementsAre("warning estimate_failed"));
  EXPECT_THAT(alerts()[0].text, HasSubstr("do not fit together"));
}

}  // namespace
}  // namespace rigcal::testing::live_alerts_test
