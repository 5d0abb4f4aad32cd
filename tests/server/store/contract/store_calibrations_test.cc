// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <optional>
#include <string>
#include <vector>

#include "tests/server/store/contract/store_contract.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::store_calibrations_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::_;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

class StoreCalibrations : public ::rigcal::testing::StoreContract {
 protected:
  Calibration Create(const std::string& rig) {
    Calibration calibration;
    calibration.rig = rig;
    calibration.session_ids = {"s-000001"};
    auto created = store().CreateCalibration(calibration);
    EXPECT_THAT(created, IsOk());
    return created.ok() ? *created : calibration;
  }
  std::vector<std::string> Ids(const CalibrationFilter& filter, const ListPage& page) {
    const auto calibrations = store().ListCalibrations(filter, page);
    EXPECT_THAT(calibrations, IsOk());
    std::vector<std::string> ids;
    for (const auto& [calibration, position] : *calibrations) {
      ids.push_back(calibration.id);
      last_ = position;
    }
    return ids;
  }

  std::optional<RecordPosition> last_;  // of the last list
};

TEST_P(StoreCalibrations, CountsIdsOverAllAndVersionsByRig) {
  EXPECT_EQ(Create("left").id, "c-000001");
  EXPECT_EQ(Create("right").version, 1u);
  Reopen();
  const Calibration third = Create("left");
  EXPECT_EQ(third.id, "c-000003");
  EXPECT_EQ(third.version, 2u);
  EXPECT_EQ(store().GetCalibration("c-000003")->version, 2u);
}

TEST_P(StoreCalibrations, KeepsProgressAndResult) {
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

TEST_P(StoreCalibrations, IsImmutableOnceItHasEnded) {
  for (const CalibrationState end :
       {CalibrationState::kSucceeded, CalibrationState::kFailed, CalibrationState::kCancelled}) {
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

TEST_P(StoreCalibrations, RefusesWhatItDoesNotHaveAndAnotherVersion) {
  EXPECT_THAT(store().GetCalibration("c-000007"),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("c-000007")));
  EXPECT_THAT(store().UpdateCalibration(Calibration{}), StatusIs(absl::StatusCode::kNotFound, _));
  Calibration calibration = Create("rig");
  calibration.version = 9;
  EXPECT_THAT(store().UpdateCalibration(calibration),
              StatusIs(absl::StatusCode::kInvalidArgument, _));
}

TEST_P(StoreCalibrations, ListsNewestFirstByRigInPages) {
  for (const char* rig : {"left", "right", "left", "left"}) Create(rig);
  EXPECT_THAT(Ids({}, {.limit = 10}), ElementsAre("c-000004", "c-000003", "c-000002", "c-000001"));
  EXPECT_THAT(Ids({.rig = "left"}, {.limit = 2}), ElementsAre("c-000004", "c-000003"));
  ASSERT_TRUE(last_.has_value());
  EXPECT_THAT(Ids({.rig = "left"}, {.limit = 2, .after = last_}), ElementsAre("c-000001"));
  EXPECT_THAT(Ids({}, {.order = RecordOrder::kOldestFirst, .limit = 2}),
              ElementsAre("c-000001", "c-000002"));
  EXPECT_THAT(Ids({}, {.order = RecordOrder::kIdAscending, .limit = 2, .after = last_}),
              ElementsAre("c-000003", "c-000004"));
}

TEST_P(StoreCalibrations, ListsThoseOfASessionAndState) {
  Calibration both;
  both.rig = "rig";
  both.session_ids = {"s-000001", "s-000002"};
  ASSERT_THAT(store().CreateCalibration(both), IsOk());
  Calibration ended = Create("rig");
  ended.state = CalibrationState::kFailed;
  ASSERT_THAT(store().UpdateCalibration(ended), IsOk());
  EXPECT_THAT(Ids({.session_id = "s-000002"}, {.limit = 9}), ElementsAre("c-000001"));
  EXPECT_THAT(Ids({.session_id = "s-000001"}, {.limit = 9}), ElementsAre("c-000002", "c-000001"));
  EXPECT_THAT(Ids({.state = CalibrationState::kFailed, .session_id = "s-000001"}, {.limit = 9}),
              ElementsAre("c-000002"));
  EXPECT_THAT(Ids({.session_id = "s-000003"}, {.limit = 9}), ElementsAre());
}

TEST_P(StoreCalibrations, DeletesWhatHasEndedAndUsesItsIdNoMore) {
  Calibration calibration = Create("rig");
  EXPECT_THAT(store().DeleteCalibration("c-000001"),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("cancel it first")));
  calibration.state = CalibrationState::kFailed;
  ASSERT_THAT(store().UpdateCalibration(calibration), IsOk());
  ASSERT_THAT(store().DeleteCalibration("c-000001"), IsOk());
  EXPECT_THAT(store().GetCalibration("c-000001"), StatusIs(absl::StatusCode::kNotFound, _));
  EXPECT_THAT(store().DeleteCalibration("c-000001"), StatusIs(absl::StatusCode::kNotFound, _));
  EXPECT_THAT(Ids({.session_id = "s-000001"}, {.limit = 9}), ElementsAre());
  Reopen();
  const Calibration next = Create("rig");
  EXPECT_EQ(next.id, "c-000002");
  EXPECT_EQ(next.version, 2u);
}

RIGCAL_FOR_EVERY_STORE(StoreCalibrations);

}  // namespace
}  // namespace rigcal::server::store_calibrations_test
