// SPDX-License-Identifier: Apache-2.0
#include "server/monitor/look_result.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/server/monitor/ring_result.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing::look_result_test {
namespace {

using server::CompareClocks;
using server::LiveMonitor;
using server::MonitorVerdict;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr double kTurnRad = 1e-3;

CalibrationResult Later(double seconds) {
  CalibrationResult now = RingResult();
  for (CalibratedCamera& camera : now.cameras) camera.time_epoch_s += seconds;
  return now;
}

TEST(CompareClocks, ToldAreStepsAndDriftsOfOneClockOnly) {
  const CalibrationResult first = RingResult();
  CalibrationResult now = Later(20);
  for (const auto& [camera, change] : CompareClocks(first, now)) {
    EXPECT_FALSE(change.changed) << camera;
    EXPECT_EQ(change.change_s, 0) << camera;
  }
  // What all clocks have in common says nothing.
  for (CalibratedCamera& camera : now.cameras) camera.time_offset_s += 0.5;
  now.cameras[2].time_offset_s += 0.001;
  const auto changes = CompareClocks(first, now);
  ASSERT_EQ(changes.size(), 4u);
  EXPECT_TRUE(changes.at("c").changed);
  EXPECT_NEAR(changes.at("c").change_s, 0.001, 1e-12);
  EXPECT_NEAR(changes.at("c").ppm, 50, 1e-6);
  for (const char* camera : {"a", "b", "d"}) EXPECT_FALSE(changes.at(camera).changed);
  // Too small to matter, though many sigmas.
  now.cameras[2].time_offset_s -= 0.00085;
  EXPECT_FALSE(CompareClocks(first, now).at("c").changed);
  // Large, but not known.
  now.cameras[2].time_offset_s += 0.00085;
  now.cameras[2].uncertainty->time_offset_sigma_s = 3e-4;
  EXPECT_FALSE(CompareClocks(first, now).at("c").changed);
}

TEST(CompareClocks, AKnownRateIsNoChange) {
  CalibrationResult first = RingResult();
  first.cameras[1].time_rate_ppm = 100;
  CalibrationResult now = Later(20);
  now.cameras[1].time_offset_s = 0.002;
  EXPECT_FALSE(CompareClocks(first, now).at("b").changed);
  now.cameras[1].time_offset_s = 0.004;
  EXPECT_TRUE(CompareClocks(first, now).at("b").changed);
}

TEST(CompareClocks, LeavesOutOtherClocks) {
  const CalibrationResult first = RingResult();
  CalibrationResult now = Later(20);
  now.cameras[0].clock_id = "another";
  now.cameras[1].time_offset_estimated = false;
  EXPECT_EQ(CompareClocks(first, now).size(), 2u);
  now.cameras[2].uncertainty.reset();
  EXPECT_TRUE(CompareClocks(first, now).empty());
}

server::RigDifference DifferenceOf(const CalibrationResult& now) {
  const auto difference = server::CompareRigs(RingResult(), now);
  EXPECT_THAT(difference, IsOk());
  return *difference;
}

MonitorVerdict VerdictOf(const LiveMonitor& monitor, const std::string& name) {
  for (const auto& camera : monitor.cameras) {
    if (camera.camera == name) return camera.verdict;
  }
  return MonitorVerdict::kUnknown;
}

TEST(TakeVerdicts, AreKeptWhereALookCannotTell) {
  LiveMonitor monitor;
  CalibrationResult moved = RingResult();
  TurnCamera("c", kTurnRad, &moved);
  TakeVerdicts(DifferenceOf(moved), {}, 1000, &monitor);
  EXPECT_EQ(VerdictOf(monitor, "c"), MonitorVerdict::kMoved);
  EXPECT_NEAR(monitor.cameras[2].rotation_rad, kTurnRad, 0.1 * kTurnRad);
  for (const char* camera : {"a", "b", "d"}) {
    EXPECT_EQ(VerdictOf(monitor, camera), MonitorVerdict::kGood) << camera;
  }
  EXPECT_EQ(monitor.problem, "");
  EXPECT_FALSE(monitor.all_moved);

  server::RigDifference hidden = DifferenceOf(RingResult());
  for (auto& camera : hidden.cameras) camera.verdict = server::CameraDifference::Verdict::kUnknown;
  TakeVerdicts(hidden, {}, 2000, &monitor);
  EXPECT_EQ(VerdictOf(monitor, "c"), MonitorVerdict::kMoved);
  EXPECT_EQ(monitor.cameras[2].time_utc_ns, 1000);

  TakeVerdicts(DifferenceOf(RingResult()), {}, 3000, &monitor);
  EXPECT_EQ(VerdictOf(monitor, "c"), MonitorVerdict::kGood);
  EXPECT_EQ(monitor.cameras[2].time_utc_ns, 3000);
}

TEST(TakeVerdicts, OfAMoveWithinTheLookOnlyThatCameraIsNamed) {
  CalibrationResult now = RingResult();
  TurnCamera("c", kTurnRad, &now);
  LiveMonitor monitor;
  // The finding names d, which has dragged c along.
  TakeVerdicts(DifferenceOf(now), {"d"}, 1000, &monitor);
  EXPECT_EQ(VerdictOf(monitor, "d"), MonitorVerdict::kMoved);
  EXPECT_EQ(VerdictOf(monitor, "c"), MonitorVerdict::kUnknown);
  EXPECT_THAT(monitor.problem, HasSubstr("d has moved while"));
}

TEST(TakeVerdicts, SaysWhenNobodyCanTell) {
  CalibrationResult now = RingResult();
  for (const char* camera : {"b", "c", "d"}) {
    TurnCamera(camera, camera[0] * kTurnRad / 20, &now);
  }
  LiveMonitor monitor;
  TakeVerdicts(DifferenceOf(now), {}, 1000, &monitor);
  EXPECT_TRUE(monitor.all_moved);
  EXPECT_THAT(monitor.problem, HasSubstr("which of them kept their places cannot be told"));
}

TEST(MovedWithin, IsWhatTheFindingsSay) {
  CalibrationResult look = RingResult();
  Finding finding;
  finding.kind = FindingKind::kCameraMoved;
  finding.camera = "b";
  look.findings.push_back(finding);
  finding.camera = "c";
  finding.candidate = true;
  look.findings.push_back(finding);
  EXPECT_THAT(server::MovedWithin(look), ElementsAre("b"));
}

}  // namespace
}  // namespace rigcal::testing::look_result_test
