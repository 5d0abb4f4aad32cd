// SPDX-License-Identifier: Apache-2.0
#include "server/live/alert_rules.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <functional>
#include <regex>
#include <set>
#include <sstream>

namespace rigcal::testing::alert_rules_test {
namespace {

using server::AlertCondition;
using server::CameraFacts;
using server::RigFacts;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

std::vector<std::string> KindsOf(const std::vector<AlertCondition>& conditions) {
  std::vector<std::string> kinds;
  for (const AlertCondition& condition : conditions) {
    kinds.emplace_back(condition.kind);
    EXPECT_NE(std::ranges::find(server::kAlertKinds, condition.kind), server::kAlertKinds.end())
        << condition.kind;
    EXPECT_FALSE(condition.text.empty());
  }
  return kinds;
}

CameraFacts Good() {
  CameraFacts facts;
  facts.camera = "left";
  facts.agent_id = "pc";
  facts.rate_hz = 50;
  facts.usual_rate_hz = 50;
  facts.seconds_of_rows = 30;
  facts.saw_wand = true;
  return facts;
}

TEST(AlertRules, EachFaultHasItsKind) {
  EXPECT_THAT(KindsOf(CameraConditions(Good())), IsEmpty());
  const std::vector<std::pair<const char*, std::function<void(CameraFacts*)>>> faults = {
      {"agent_lost", [](CameraFacts* facts) { facts->agent_connected = false; }},
      {"no_data", [](CameraFacts* facts) { facts->silent_s = 4; }},
      {"rate_low", [](CameraFacts* facts) { facts->rate_hz = 20; }},
      {"backlog_growing", [](CameraFacts* facts) { facts->backlog_grows = true; }},
      {"dropping", [](CameraFacts* facts) { facts->dropped_lately = 1; }},
      {"refused", [](CameraFacts* facts) { facts->refused_lately = 1; }},
      {"no_wand", [](CameraFacts* facts) { facts->unseen_waving_s = 30; }},
      {"two_wands", [](CameraFacts* facts) { facts->ambiguous_share = 0.5; }},
      {"two_wands", [](CameraFacts* facts) { facts->jumping_share = 0.5; }},
      {"implausible_labels", [](CameraFacts* facts) { facts->implausible_share = 0.5; }},
      {"clock_jumped", [](CameraFacts* facts) { facts->clock_epoch_count = 2; }},
      {"clock_jumped", [](CameraFacts* facts) { facts->clock_jump = "it jumped"; }},
      {"clock_off", [](CameraFacts* facts) { facts->arrival_offset_s = -1.5; }},
      {"lens_wrong", [](CameraFacts* facts) { facts->lens_disagrees = true; }},
      {"clock_off", [](CameraFacts* facts) { facts->estimated_offset_s = 1.5; }}};
  for (const auto& [kind, add_fault] : faults) {
    CameraFacts facts = Good();
    add_fault(&facts);
    EXPECT_THAT(KindsOf(CameraConditions(facts)), ElementsAre(kind));
  }
}

TEST(AlertRules, ADarkCameraIsToldSo) {
  CameraFacts facts = Good();
  facts.saw_wand = false;
  facts.unseen_waving_s = 9;
  facts.dark_share = 0.9;
  const auto conditions = CameraConditions(facts);
  ASSERT_THAT(KindsOf(conditions), ElementsAre("no_wand"));
  EXPECT_THAT(conditions[0].text, ::testing::HasSubstr("lens cap"));
}

TEST(AlertRules, ACameraThatHasEndedMayBeSilent) {
  CameraFacts facts = Good();
  facts.ended = true;
  facts.silent_s = 100;
  facts.unseen_waving_s = 100;
  facts.agent_connected = false;
  EXPECT_THAT(KindsOf(CameraConditions(facts)), IsEmpty());
}

TEST(AlertRules, OfTheServer) {
  RigFacts facts;
  facts.capturing = true;
  facts.disk_known = true;
  facts.disk_free_bytes = uint64_t{100} << 30;
  facts.disk_reserve_bytes = uint64_t{1} << 30;
  EXPECT_THAT(KindsOf(RigConditions(facts)), IsEmpty());
  facts.disk_free_bytes = uint64_t{2} << 30;
  EXPECT_THAT(KindsOf(RigConditions(facts)), ElementsAre("disk_low"));
  facts.store_problem = "the disk is full";
  EXPECT_THAT(KindsOf(RigConditions(facts)), ElementsAre("not_storing"));
  facts = {};
  facts.capturing = true;
  facts.estimate = server::EstimateState::kFailed;
  EXPECT_THAT(KindsOf(RigConditions(facts)), ElementsAre("estimate_failed"));
}

TEST(AlertRules, TheMonitorSaysWhatHasMovedAndWhatBecameOfIt) {
  server::LiveMonitor monitor;
  monitor.problem = "fewer than two agree";
  monitor.repair_text = "it is graded bad";
  monitor.cameras.emplace_back().camera = "left";
  monitor.cameras[0].verdict = server::MonitorVerdict::kMoved;
  monitor.cameras[0].rotation_rad = 0.0026;
  monitor.calibration_id = "c-000001";
  monitor.session_id = "wave";
  EXPECT_THAT(MonitorConditions(monitor), IsEmpty());  // off
  monitor.mode = server::MonitorMode::kWatch;
  const auto conditions = MonitorConditions(monitor);
  EXPECT_THAT(KindsOf(conditions), ElementsAre("camera_moved"));
  EXPECT_EQ(conditions[0].camera, "left");
  EXPECT_NE(conditions[0].text.find("0.149 degrees"), std::string::npos) << conditions[0].text;
  EXPECT_NE(conditions[0].text.find("rigcal calibrate wave --only left --activate"),
            std::string::npos);
  monitor.cameras[0].verdict = server::MonitorVerdict::kGood;
  EXPECT_THAT(MonitorConditions(monitor), IsEmpty());
  monitor.cameras[0].clock_changed = true;
  monitor.repair = server::MonitorRepairState::kNotActive;
  EXPECT_THAT(KindsOf(MonitorConditions(monitor)), ElementsAre("clock_changed", "repair"));
  monitor.all_moved = true;
  EXPECT_THAT(KindsOf(MonitorConditions(monitor)),
              ElementsAre("camera_moved", "clock_changed", "repair"));
}

TEST(AlertRules, DocsExplainEachKind) {
  std::ifstream file(RIGCAL_SOURCE_DIR "/docs/live.md");
  std::stringstream text;
  text << file.rdbuf();
  ASSERT_FALSE(text.str().empty());
  // Rows of the table: | `kind` | ... |
  const std::regex row(R"(\n\| `([a-z_]+)` \|)");
  const std::string content = text.str();
  std::set<std::string> documented;
  for (std::sregex_iterator i(content.begin(), content.end(), row), end; i != end; ++i) {
    documented.insert((*i)[1]);
  }
  EXPECT_EQ(documented,
            std::set<std::string>(server::kAlertKinds.begin(), server::kAlertKinds.end()));
}

}  // namespace
}  // namespace rigcal::testing::alert_rules_test
