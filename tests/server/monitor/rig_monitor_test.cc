// SPDX-License-Identifier: Apache-2.0
#include "server/monitor/rig_monitor.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <sstream>

#include "tests/server/monitor/ring_result.h"
#include "tests/server/session/runner_fixture.h"

namespace rigcal::testing::rig_monitor_test {
namespace {

using server::LiveMonitor;
using server::MonitorMode;
using server::MonitorRepairState;
using server::MonitorVerdict;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr int64_t kBeginUtcNs = 1'800'000'000'000'000'000;
constexpr double kTurnRad = 1e-3;

// A monitor whose looks are made by the test, over a real store, coordinator and runner; its time
// stands still until the test moves it.
class RigMonitorTest : public RunnerFixture {
 protected:
  void SetUp() override {
    options_.utc_now_ns = [this] { return now_utc_ns_; };
    runner_options_.utc_now_ns = options_.utc_now_ns;
    solver_.SetOutcome(RingResult());
    RunnerFixture::SetUp();
    audit_ = std::make_unique<server::AuditLog>(AuditFile());
    ASSERT_OK_AND_ASSIGN(settings_, server::MonitorSettings::Open(directory_.path() / "m.json"));
    monitor_ = std::make_unique<server::RigMonitor>(
        server::RigMonitorOptions{.utc_now_ns = options_.utc_now_ns},
        server::RigMonitorParts{
            .store = &faulty(),
            .coordinator = &coordinator(),
            .runner = &runner(),
            .settings = settings_.get(),
            .audit = audit_.get(),
            .look =
                [this](const server::SolveTask& task, const server::CalibrationHooks&) {
                  looks_.push_back(task.options);
                  server::CalibrationOutcome outcome{look_, {}};
                  if (look_.ok() && task.options.from_s < moved_at_s_) {
                    Finding finding;
                    finding.kind = FindingKind::kCameraMoved;
                    finding.camera = "c";
                    outcome.result->findings.push_back(finding);
                  }
                  return outcome;
                },
            .show =
                [this](const std::string& rig, LiveMonitor shown) {
                  EXPECT_EQ(rig, "rig");
                  shown_ = std::move(shown);
                }});
    FinishByHand("first", kCameras);
    const auto first = runner().CreateCalibration({"first"}, {});
    ASSERT_THAT(first, IsOk());
    first_ = first->id;
    ASSERT_EQ(AwaitEnd(first_).state, CalibrationState::kSucceeded);
    ASSERT_THAT(book().Activate(first_, {}), IsOk());
    Pass(10);
  }
  void TearDown() override {
    monitor_.reset();
    RunnerFixture::TearDown();
  }

  server::RigBook book() { return server::RigBook(&faulty(), options_.utc_now_ns); }
  std::filesystem::path AuditFile() const { return directory_.path() / "audit.jsonl"; }
  std::string AuditText() const {
    std::ifstream file(AuditFile());
    std::stringstream text;
    text << file.rdbuf();
    return text.str();
  }
  void Pass(double seconds) { now_utc_ns_ += static_cast<int64_t>(1e9 * seconds); }
  void Monitor(MonitorMode mode) {
    ASSERT_THAT(settings_->Set("rig", mode), IsOk());
    monitor_->Step();
  }
  // A session that captures with all cameras, each of which has seen the wand often enough.
  void BeginWave(const std::string& id) {
    StartByHand(id, kCameras);
    for (const std::string& camera : kCameras) Deliver({id, camera, 1}, 1, 30);
  }
  void EndWave(const std::string& id) {
    for (const std::string& camera : kCameras) DeliverEnd({id, camera, 1}, 30);
    AwaitFinished(id);
  }
  // Lets so many seconds pass in steps of a second, with a step of the monitor in each.
  void Wave(double seconds) {
    for (int i = 0; i < static_cast<int>(seconds); ++i) {
      Pass(1);
      monitor_->Step();
    }
  }
  void Turn(const std::string& camera) {
    CalibrationResult look = RingResult();
    TurnCamera(camera, kTurnRad, &look);
    look_ = look;
  }
  std::vector<std::string> CamerasWith(MonitorVerdict verdict) const {
    std::vector<std::string> names;
    for (const auto& camera : shown_.cameras) {
      if (camera.verdict == verdict) names.push_back(camera.camera);
    }
    return names;
  }
  std::string Active() {
    const auto state = book().GetRig("rig");
    EXPECT_THAT(state, IsOk());
    return state.ok() ? state->activation.calibration_id : "";
  }

  inline static const std::vector<std::string> kCameras = {"a", "b", "c", "d"};
  int64_t now_utc_ns_ = kBeginUtcNs;
  std::unique_ptr<server::AuditLog> audit_;
  std::unique_ptr<server::MonitorSettings> settings_;
  std::unique_ptr<server::RigMonitor> monitor_;
  absl::StatusOr<CalibrationResult> look_ = RingResult();
  double moved_at_s_ = -1;  // of the session: looks at rows of before see c move
  std::vector<CalibrationOptions> looks_;
  LiveMonitor shown_;
  std::string first_;
};

TEST_F(RigMonitorTest, LooksAtNothingUnlessItIsAskedTo) {
  BeginWave("wave");
  Wave(60);
  EndWave("wave");
  monitor_->Step();
  EXPECT_THAT(looks_, IsEmpty());
  // What finished before it was asked is not looked at.
  Pass(1);
  Monitor(MonitorMode::kWatch);
  EXPECT_THAT(looks_, IsEmpty());
  EXPECT_EQ(shown_.mode, MonitorMode::kWatch);
  EXPECT_EQ(shown_.calibration_id, first_);
  EXPECT_EQ(CamerasWith(MonitorVerdict::kUnknown).size(), 4u);
  Monitor(MonitorMode::kOff);
  EXPECT_EQ(shown_.mode, MonitorMode::kOff);
  EXPECT_THAT(shown_.cameras, IsEmpty());
}

TEST_F(RigMonitorTest, LooksEveryTenSecondsAtTheLastTwentyAndOnceAtTheEnd) {
  Monitor(MonitorMode::kWatch);
  BeginWave("wave");
  Wave(7);
  EXPECT_THAT(looks_, IsEmpty());
  Wave(35);
  ASSERT_EQ(looks_.size(), 4u);
  const double from_s[] = {0, 0, 8, 18};
  for (size_t i = 0; i < 4; ++i) {
    EXPECT_NEAR(looks_[i].from_s, from_s[i], 1e-6) << i;
    EXPECT_EQ(looks_[i].to_s, 0);
    EXPECT_TRUE(looks_[i].what_if);
    EXPECT_EQ(looks_[i].intrinsics, Estimate::kFixed);
    EXPECT_EQ(looks_[i].given_intrinsics.size(), 4u);
  }
  EXPECT_EQ(CamerasWith(MonitorVerdict::kGood).size(), 4u);
  EXPECT_EQ(shown_.session_id, "wave");
  EndWave("wave");
  monitor_->Step();
  EXPECT_EQ(looks_.size(), 5u);
  Wave(30);
  EXPECT_EQ(looks_.size(), 5u);
}

TEST_F(RigMonitorTest, SaysWhatHasMovedAndLeavesItAtThat) {
  Monitor(MonitorMode::kWatch);
  Turn("c");
  BeginWave("wave");
  Wave(9);
  EXPECT_THAT(CamerasWith(MonitorVerdict::kMoved), ElementsAre("c"));
  EndWave("wave");
  monitor_->Step();
  runner().WaitIdle();
  monitor_->Step();
  EXPECT_EQ(shown_.repair, MonitorRepairState::kNone);
  EXPECT_EQ(Active(), first_);
}

TEST_F(RigMonitorTest, RepairsWhatHasMovedAndActivatesAGoodRepair) {
  Monitor(MonitorMode::kRepair);
  Turn("c");
  BeginWave("wave");
  Wave(19);
  EXPECT_EQ(shown_.repair, MonitorRepairState::kNone);
  EndWave("wave");
  monitor_->Step();
  EXPECT_EQ(shown_.repair, MonitorRepairState::kSolving);
  const Calibration repair = AwaitEnd(shown_.repair_id);
  EXPECT_EQ(repair.options.kind, SolveKind::kRepair);
  EXPECT_EQ(repair.options.parent_id, first_);
  EXPECT_THAT(repair.options.only_cameras, ElementsAre("c"));
  EXPECT_EQ(repair.options.from_s, 0);
  EXPECT_EQ(repair.operator_name, "monitor");
  runner().WaitIdle();
  monitor_->Step();
  EXPECT_EQ(shown_.repair, MonitorRepairState::kActive) << shown_.repair_text;
  EXPECT_EQ(Active(), repair.id);
  EXPECT_EQ(shown_.calibration_id, repair.id);
  const auto history = book().History("rig");
  ASSERT_THAT(history, IsOk());
  EXPECT_EQ(history->front().operator_name, "monitor");
  EXPECT_EQ(history->front().reason, "monitor: c has moved");
  EXPECT_THAT(AuditText(), HasSubstr(repair.id + " repairs it and is the active one now"));
  // The same session is not looked at again.
  const size_t count = looks_.size();
  Wave(30);
  EXPECT_EQ(looks_.size(), count);
}

TEST_F(RigMonitorTest, ARepairIsOfWhatWasRecordedAfterTheMove) {
  Monitor(MonitorMode::kRepair);
  BeginWave("wave");
  Wave(19);
  ASSERT_EQ(CamerasWith(MonitorVerdict::kGood).size(), 4u);
  Turn("c");
  moved_at_s_ = 19;
  Wave(12);
  ASSERT_THAT(CamerasWith(MonitorVerdict::kMoved), ElementsAre("c"));
  const double seen_s = 28;  // the look that has found it
  Wave(9);
  // The next look begins behind it.
  EXPECT_NEAR(looks_.back().from_s, seen_s, 1e-6);
  EndWave("wave");
  monitor_->Step();
  ASSERT_EQ(shown_.repair, MonitorRepairState::kSolving) << shown_.repair_text;
  EXPECT_NEAR(AwaitEnd(shown_.repair_id).options.from_s, seen_s, 1e-6);
}

TEST_F(RigMonitorTest, TooLittleAfterTheMoveIsNotRepaired) {
  Monitor(MonitorMode::kRepair);
  BeginWave("wave");
  Wave(19);
  Turn("c");
  moved_at_s_ = 19;
  Wave(10);
  ASSERT_THAT(CamerasWith(MonitorVerdict::kMoved), ElementsAre("c"));
  EndWave("wave");
  monitor_->Step();
  EXPECT_EQ(shown_.repair, MonitorRepairState::kNotActive);
  EXPECT_THAT(shown_.repair_text, HasSubstr("too little was recorded after the move"));
  EXPECT_EQ(Active(), first_);
}

// A camera whose rows come late looks as if it had only just moved.
TEST_F(RigMonitorTest, AllRowsTellWhetherItMovedWithinTheSession) {
  Monitor(MonitorMode::kRepair);
  BeginWave("wave");
  Wave(19);
  Turn("c");
  Wave(10);
  EndWave("wave");
  monitor_->Step();
  EXPECT_EQ(looks_.back().from_s, 0);
  ASSERT_EQ(shown_.repair, MonitorRepairState::kSolving) << shown_.repair_text;
  EXPECT_EQ(AwaitEnd(shown_.repair_id).options.from_s, 0);
}

TEST_F(RigMonitorTest, ARepairThatIsNotGoodStaysInactive) {
  CalibrationResult usable = RingResult();
  usable.quality.grade = QualityGrade::kUsable;
  usable.quality.reasons = {"few views of c"};
  solver_.SetOutcome(usable);
  Monitor(MonitorMode::kRepair);
  Turn("c");
  BeginWave("wave");
  Wave(9);
  EndWave("wave");
  monitor_->Step();
  AwaitEnd(shown_.repair_id);
  runner().WaitIdle();
  monitor_->Step();
  EXPECT_EQ(shown_.repair, MonitorRepairState::kNotActive);
  EXPECT_THAT(shown_.repair_text, HasSubstr("few views of c"));
  EXPECT_EQ(Active(), first_);

  // Nor does one that fails.
  solver_.SetOutcome(absl::FailedPreconditionError("others have moved, too"));
  BeginWave("again");
  Wave(9);
  EndWave("again");
  monitor_->Step();
  AwaitEnd(shown_.repair_id);
  runner().WaitIdle();
  monitor_->Step();
  EXPECT_THAT(shown_.repair_text, HasSubstr("others have moved, too"));
  EXPECT_EQ(Active(), first_);
}

TEST_F(RigMonitorTest, AnActivationMeanwhileWins) {
  FinishByHand("other", kCameras);
  const auto other = runner().CreateCalibration({"other"}, {});
  ASSERT_THAT(other, IsOk());
  ASSERT_EQ(AwaitEnd(other->id).state, CalibrationState::kSucceeded);
  Pass(1);
  Monitor(MonitorMode::kRepair);
  Turn("c");
  BeginWave("wave");
  Wave(9);
  EndWave("wave");
  monitor_->Step();
  AwaitEnd(shown_.repair_id);
  runner().WaitIdle();
  ASSERT_THAT(book().Activate(other->id, {}), IsOk());
  monitor_->Step();
  EXPECT_EQ(shown_.repair, MonitorRepairState::kNotActive);
  EXPECT_THAT(shown_.repair_text, HasSubstr("is not the active one any more"));
  EXPECT_EQ(Active(), other->id);
  EXPECT_EQ(shown_.calibration_id, other->id);
}

TEST_F(RigMonitorTest, SaysWhyItCannotTell) {
  Monitor(MonitorMode::kWatch);
  look_ = absl::FailedPreconditionError("a and b share no instants");
  BeginWave("wave");
  Wave(9);
  EXPECT_THAT(shown_.problem, HasSubstr("a and b share no instants"));
  EXPECT_EQ(CamerasWith(MonitorVerdict::kUnknown).size(), 4u);
  look_ = RingResult();
  Wave(10);
  EXPECT_EQ(shown_.problem, "");
  EXPECT_EQ(CamerasWith(MonitorVerdict::kGood).size(), 4u);
}

TEST_F(RigMonitorTest, LeavesOutCamerasThatHaveNotSeenTheWand) {
  Monitor(MonitorMode::kWatch);
  StartByHand("wave", kCameras);
  for (const char* camera : {"a", "b", "d"}) Deliver({"wave", camera, 1}, 1, 30);
  Wave(9);
  ASSERT_EQ(looks_.size(), 1u);
  EXPECT_THAT(looks_[0].without_cameras, ElementsAre("c"));
}

TEST_F(RigMonitorTest, ClocksAreComparedWithinASession) {
  Monitor(MonitorMode::kWatch);
  BeginWave("wave");
  Wave(9);
  CalibrationResult drifted = RingResult();
  drifted.cameras[3].time_epoch_s += 10;
  drifted.cameras[3].time_offset_s += 0.002;
  look_ = drifted;
  Wave(10);
  EXPECT_TRUE(shown_.cameras[3].clock_changed);
  EXPECT_NEAR(shown_.cameras[3].clock_change_ppm, 200, 1e-6);
  EXPECT_FALSE(shown_.cameras[0].clock_changed);
  EndWave("wave");
  monitor_->Step();
  // In another session clocks may have been set anew.
  BeginWave("next");
  Wave(9);
  EXPECT_FALSE(shown_.cameras[3].clock_changed);
}

TEST(MonitorSettingsTest, AreKept) {
  const TemporaryDirectory folder;
  const std::filesystem::path file = folder.path() / "monitors.json";
  {
    ASSERT_OK_AND_ASSIGN(const auto settings, server::MonitorSettings::Open(file));
    EXPECT_EQ(settings->Of("rig"), MonitorMode::kOff);
    EXPECT_THAT(settings->Set("rig", MonitorMode::kRepair), IsOk());
    EXPECT_THAT(settings->Set("other", MonitorMode::kWatch), IsOk());
    EXPECT_THAT(settings->Set("other", MonitorMode::kOff), IsOk());
  }
  ASSERT_OK_AND_ASSIGN(const auto settings, server::MonitorSettings::Open(file));
  EXPECT_EQ(settings->Of("rig"), MonitorMode::kRepair);
  EXPECT_EQ(settings->All().size(), 1u);
  std::ofstream(file) << "{\"rigs\": {\"rig\": \"sometimes\"}}";
  EXPECT_THAT(server::MonitorSettings::Open(file),
              StatusIs(absl::StatusCode::kDataLoss, HasSubstr("unknown mode")));
}

}  // namespace
}  // namespace rigcal::testing::rig_monitor_test
