// SPDX-License-Identifier: Apache-2.0
#include "client/watch/live_text.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "client/output/text_table.h"

namespace rigcal::client::live_text_test {
namespace {

using ::testing::Each;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::ResultOf;
using ::testing::SizeIs;

v1::LiveState Wave() {
  v1::LiveState live;
  live.set_full(true);
  live.set_rig("rig");
  live.mutable_time()->set_seconds(1'800'000'031);
  v1::Session* session = live.mutable_session();
  session->set_id("wave");
  session->set_state(v1::Session::STATE_CAPTURING);
  session->mutable_start_time()->set_seconds(1'800'000'000);
  for (const char* name : {"left", "right"}) {
    v1::LiveCamera* camera = live.add_cameras();
    camera->set_camera(name);
    camera->set_state(v1::LiveCamera::STATE_CAPTURING);
    camera->set_observation_rate_hz(50);
    camera->set_wand_rate_hz(40);
    camera->mutable_coverage()->set_covered_share(0.62);
    camera->set_shared_instant_count(180);
    camera->set_shared_instant_goal(200);
    camera->mutable_clock()->set_time_offset_s(0.0032);
  }
  live.mutable_cameras(1)->set_shared_instant_count(12);
  v1::LiveEstimate* estimate = live.mutable_estimate();
  estimate->set_state(v1::LiveEstimate::STATE_READY);
  estimate->set_scale_known(true);
  estimate->mutable_volume()->set_p95_mm(0.618);
  estimate->mutable_volume()->set_scale_sigma_rel(0.0069);
  estimate->mutable_volume()->set_median_mm(0.3);
  estimate->mutable_volume()->set_worst_mm(1.2);
  estimate->add_advice()->set_text("low, between left and right, wand upright");
  v1::LiveAlert* alert = live.mutable_alerts()->add_alerts();
  alert->set_kind("no_wand");
  alert->set_severity(v1::LiveAlert::SEVERITY_ERROR);
  alert->set_camera("right");
  alert->set_text("right has not seen the wand");
  live.mutable_goal()->set_until_mm(0.5);
  live.mutable_goal()->set_why_not("the expected error is 0.62 mm, the goal 0.5 mm");
  return live;
}

std::string Text(const v1::LiveState& live, const LiveScreenOptions& options) {
  return absl::StrJoin(FormatLiveScreen(live, options), "\n");
}

TEST(LiveScreen, HasWhatMatters) {
  const std::string text = Text(Wave(), {.columns = 120, .rows = 40, .server = "127.0.0.1:7420"});
  EXPECT_THAT(text, HasSubstr("rig rig   session wave capturing, 31 s   127.0.0.1:7420"));
  EXPECT_THAT(text, HasSubstr("expected error  0.62 mm + 0.69 % of every length"));
  EXPECT_THAT(text, HasSubstr("goal 0.5 mm: goes on, the expected error is 0.62 mm"));
  EXPECT_THAT(text, HasSubstr("wave next: low, between left and right, wand upright"));
  EXPECT_THAT(text, HasSubstr("ERROR right has not seen the wand"));
  EXPECT_THAT(text, HasSubstr("worst camera: right (12 shared, 62% covered)"));
  EXPECT_THAT(text, HasSubstr("[######....] 62%"));
  EXPECT_THAT(text, HasSubstr("+3.2 ms"));
  EXPECT_THAT(text, HasSubstr("s: stop the session   q: leave"));
  EXPECT_THAT(text, Not(HasSubstr("OLD DATA")));
  EXPECT_THAT(text, Not(HasSubstr("\x1b")));
}

TEST(LiveScreen, SaysThatASessionHasFinished) {
  v1::LiveState live = Wave();
  live.mutable_session()->set_state(v1::Session::STATE_FINISHED);
  live.clear_goal();
  EXPECT_THAT(Text(live, {.columns = 200, .rows = 40}),
              HasSubstr("the last estimate of a session that has finished"));
  live.clear_estimate();
  const std::string results = "rigcal calibration list --session wave has its results";
  EXPECT_THAT(Text(live, {.columns = 200, .rows = 40}), HasSubstr(results));
  EXPECT_THAT(FormatLiveLine(live), HasSubstr(results));
  EXPECT_THAT(FormatLiveLine(live), Not(HasSubstr("of 2 cameras")));
}

TEST(LiveScreen, FitsTheTerminal) {
  v1::LiveState live = Wave();
  live.mutable_cameras(0)->set_camera(std::string(60, 'x'));
  for (const size_t columns : {1, 20, 40, 80}) {
    const auto lines = FormatLiveScreen(live, {.columns = columns, .rows = 8});
    EXPECT_THAT(lines, SizeIs(8));
    EXPECT_THAT(lines, Each(ResultOf(DisplayWidth, ::testing::Le(columns))));
  }
}

TEST(LiveScreen, SaysThatDataAreOld) {
  EXPECT_THAT(Text(Wave(), {.columns = 120, .age_s = 12, .problem = "no route"}),
              HasSubstr("OLD DATA: the server has not answered for 12 s (no route)"));
  EXPECT_THAT(Text(Wave(), {.columns = 120, .age_s = 5}), HasSubstr("OLD DATA: 5 s old"));
}

TEST(LiveScreen, ColoursComeWithWords) {
  const std::string text = Text(Wave(), {.columns = 120, .rows = 40, .colour = true});
  EXPECT_THAT(text, HasSubstr("\x1b[1;31mERROR right has not seen the wand\x1b[0m"));
}

TEST(LiveScreen, TextsOfOthersDoNotSteerTheTerminal) {
  v1::LiveState live = Wave();
  live.mutable_alerts()->mutable_alerts(0)->set_text("bad \x1b[2J\ntext");
  live.mutable_session()->set_id("\x1b]0;x\x07");
  EXPECT_THAT(Text(live, {.columns = 120}), Not(HasSubstr("\x1b")));
  EXPECT_THAT(FormatLiveLine(live), Not(HasSubstr("\x1b")));
}

TEST(LiveScreen, BearsAnEmptyState) {
  EXPECT_THAT(Text({}, {.columns = 80}), HasSubstr("no session"));
  EXPECT_THAT(FormatLiveLine({}), HasSubstr("no session; - mm; 0 of 0 cameras"));
}

TEST(LiveLine, HasItAllInOneLine) {
  EXPECT_EQ(FormatLiveLine(Wave()),
            "session wave capturing, 31 s; 0.62 mm + 0.69 % of every length (goal 0.5 mm: goes on, "
            "the expected error is 0.62 mm, the goal 0.5 mm); 2 of 2 cameras, 100 rows/s, 80 with "
            "wand; worst right (12 "
            "shared, 62% covered); wave next: low, between left and right, wand upright; error "
            "no_wand right");
}

TEST(LiveLine, SaysWhatIsMissing) {
  v1::LiveState live = Wave();
  live.clear_goal();
  live.clear_estimate();
  live.mutable_estimate()->set_state(v1::LiveEstimate::STATE_WAITING);
  v1::LivePairNeed* need = live.mutable_estimate()->add_needs();
  need->set_camera_a("left");
  need->set_camera_b("right");
  need->set_common_count(3);
  need->set_needed_count(20);
  EXPECT_THAT(FormatLiveLine(live),
              HasSubstr("- mm (left and right need more together: 3 of 20 instants)"));
}

TEST(LiveText, SaysWhatTheMonitorHasFound) {
  v1::LiveState live = Wave();
  EXPECT_THAT(FormatLiveLine(live), Not(HasSubstr("monitor")));
  v1::LiveMonitor& monitor = *live.mutable_monitor();
  monitor.set_mode(v1::MONITOR_MODE_WATCH);
  EXPECT_THAT(FormatLiveLine(live), HasSubstr("monitor: no active calibration"));
  monitor.set_calibration_id("c-000001");
  for (const char* name : {"a", "b", "c", "d"}) monitor.add_cameras()->set_camera(name);
  for (auto& camera : *monitor.mutable_cameras()) {
    camera.set_verdict(v1::LiveMonitoredCamera::VERDICT_GOOD);
  }
  monitor.mutable_cameras(1)->set_verdict(v1::LiveMonitoredCamera::VERDICT_MOVED);
  monitor.mutable_cameras(3)->set_verdict(v1::LiveMonitoredCamera::VERDICT_UNKNOWN);
  const char* const text =
      "monitor: 2 of 4 cameras where c-000001 has them, moved: b, cannot tell: d";
  EXPECT_THAT(FormatLiveLine(live), HasSubstr(text));
  EXPECT_THAT(Text(live, {.columns = 200, .rows = 30}), HasSubstr(text));
}

// Of a large rig what needs something is first, and few alerts take lines from the cameras.
TEST(FormatLiveScreen, ManyCamerasThatNeedSomethingAreFirst) {
  v1::LiveState live = Wave();
  const v1::LiveCamera sample = live.cameras(0);
  live.clear_cameras();
  live.mutable_alerts()->clear_alerts();
  for (int i = 0; i < 500; ++i) {
    v1::LiveCamera* camera = live.add_cameras();
    *camera = sample;
    camera->set_camera(absl::StrCat("cam_", i, "_"));
  }
  for (int i = 480; i < 490; ++i) {
    v1::LiveAlert* alert = live.mutable_alerts()->add_alerts();
    alert->set_kind("no_wand");
    alert->set_severity(v1::LiveAlert::SEVERITY_ERROR);
    alert->set_camera(absl::StrCat("cam_", i, "_"));
    alert->set_text(absl::StrCat("cam_", i, "_ has not seen the wand"));
  }
  live.mutable_cameras(470)->set_dropped_count(3);
  live.mutable_cameras(471)->set_state(v1::LiveCamera::STATE_OFFLINE);
  live.mutable_cameras(33)->set_shared_instant_count(1);
  const auto text = [&](bool all) {
    return absl::StrJoin(FormatLiveScreen(live, {.columns = 120, .rows = 40, .all = all}), "\n");
  };
  EXPECT_THAT(text(false), HasSubstr("488 good, 12 need something: cam_470_, cam_471_, cam_480_"));
  EXPECT_THAT(text(false), HasSubstr("and 4 more alerts"));
  EXPECT_THAT(text(false), HasSubstr("\ncam_489_ "));
  EXPECT_LT(text(false).find("\ncam_489_ "), text(false).find("\ncam_33_ "));
  EXPECT_LT(text(false).find("\ncam_33_ "), text(false).find("\ncam_0_ "));
  EXPECT_THAT(text(true), HasSubstr("cam_489_ has not seen the wand"));
  EXPECT_THAT(text(true), HasSubstr("\ncam_0_ "));
  EXPECT_THAT(text(true), Not(HasSubstr("\ncam_470_ ")));
  const std::string line = FormatLiveLine(live);
  EXPECT_THAT(line, HasSubstr("488 good, 12 need something"));
  EXPECT_THAT(line, Not(HasSubstr("cam_489_")));
}

}  // namespace
}  // namespace rigcal::client::live_text_test
