// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "tests/server/store/store_fixture.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::store_calibrations_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::_;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

class StoreCalibrations : public ::rigcal::testing::StoreFixture {
 protected:
  Calibration Create(const std::string& rig) {
    Calibration calibration;
    calibration.rig = rig;
    calibration.session_ids = {"s-000001"};
    auto created = store().CreateCalibration(calibration);
    EXPECT_THAT(created, IsOk());
    return created.ok() ? *created : calibration;
  }
};

TEST_F(StoreCalibrations, CountsIdsOverAllAndVersionsByRig) {
  EXPECT_EQ(Create("left").id, "c-000001");
  EXPECT_EQ(Create("right").version, 1u);
  Reopen();
  const Calibration third = Create("left");
  EXPECT_EQ(third.id, "c-000003");
  EXPECT_EQ(third.version, 2u);
  EXPECT_EQ(store().GetCalibration("c-000003")->version, 2u);
}

TEST_F(StoreCalibrations, KeepsProgressAndResult) {
  Calibration calibration = Create("rig");
  calibration.state = CalibrationState::kRunning;
  calibration.progress_fraction = 0.5;
  ASSERT_THAT(store().UpdateCalibration(calibration), IsOk());
  Reopen();
  // The runner decides what happens to an interrupted calibration.
  EXPECT_EQ(store().GetCalibration("c-000001")->state, CalibrationState::kRunning);
  EXPECT_EQ(store().GetCalibration("c-000001")->progress_fraction, 0.5);

  calibration.state = CalibrationState::kSucceeded;
  calibration.result.emplace();
  calibration.result->instant_count = 614;
  calibration.result->target.given.marker_positions_m = {0, 0.13, 0.39};
  ASSERT_THAT(store().UpdateCalibration(calibration), IsOk());
  ASSERT_OK_AND_ASSIGN(const Calibration read, store().GetCalibration("c-000001"));
  ASSERT_TRUE(read.result.has_value());
  EXPECT_EQ(read.result->instant_count, 614u);
}

TEST_F(StoreCalibrations, IsImmutableOnceItHasEnded) {
  for (const CalibrationState end : {CalibrationState::kSucceeded, CalibrationState::kFailed}) {
    Calibration calibration = Create("rig");
    calibration.state = end;
    if (end == CalibrationState::kSucceeded) {
      calibration.result.emplace();
      calibration.result->target.given.marker_positions_m = {0, 0.13, 0.39};
    }
    ASSERT_THAT(store().UpdateCalibration(calibration), IsOk());
    Calibration changed = calibration;
    changed.state = CalibrationState::kRunning;
    EXPECT_THAT(store().UpdateCalibration(changed),
                StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr(calibration.id)));
    EXPECT_EQ(store().GetCalibration(calibration.id)->state, end);
  }
}

TEST_F(StoreCalibrations, RefusesWhatItDoesNotHaveAndAnotherVersion) {
  EXPECT_THAT(store().GetCalibration("c-000007"),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("c-000007")));
  EXPECT_THAT(store().UpdateCalibration(Calibration{}), StatusIs(absl::StatusCode::kNotFound, _));
  Calibration calibration = Create("rig");
  calibration.version = 9;
  EXPECT_THAT(store().UpdateCalibration(calibration),
              StatusIs(absl::StatusCode::kInvalidArgument, _));
}

TEST_F(StoreCalibrations, ListsNewestFirstByRigInPages) {
  for (const char* rig : {"left", "right", "left", "left"}) Create(rig);
  const auto list = [this](const char* rig, int limit, const char* before) {
    std::vector<std::string> ids;
    const auto calibrations = store().ListCalibrations(rig, limit, before);
    for (const Calibration& calibration : *calibrations) ids.push_back(calibration.id);
    return ids;
  };
  EXPECT_THAT(list("", 10, ""), ElementsAre("c-000004", "c-000003", "c-000002", "c-000001"));
  EXPECT_THAT(list("left", 2, ""), ElementsAre("c-000004", "c-000003"));
  EXPECT_THAT(list("left", 2, "c-000003"), ElementsAre("c-000001"));
}

}  // namespace
}  // namespace rigcal::server::store_calibrations_test
