// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "tests/server/store/contract/store_contract.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::store_activations_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::HasSubstr;

class StoreActivations : public ::rigcal::testing::StoreContract {
 protected:
  std::string Create(const std::string& rig) {
    Calibration calibration;
    calibration.rig = rig;
    calibration.session_ids = {"s-000001"};
    auto created = store().CreateCalibration(calibration);
    EXPECT_THAT(created, IsOk());
    created->state = CalibrationState::kSucceeded;
    created->result.emplace();
    created->result->target.given.marker_positions_m = {0, 0.13, 0.39};
    EXPECT_THAT(store().UpdateCalibration(*created), IsOk());
    return created->id;
  }
  absl::StatusOr<Activation> Activate(const std::string& rig, const std::string& id,
                                      const std::string& previous) {
    Activation activation;
    activation.rig = rig;
    activation.calibration_id = id;
    activation.version = 7;
    activation.previous_calibration_id = previous;
    activation.utc_ns = 1'700'000'000'000'000'000;
    activation.operator_name = "operator 'anna'";
    activation.reason = "bumped";
    activation.forced = activation.rollback = true;
    return store().AddActivation(activation);
  }
};

TEST_P(StoreActivations, CountsByRigAndKeepsEverything) {
  const std::string a = Create("left"), b = Create("left"), other = Create("right");
  ASSERT_OK_AND_ASSIGN(const Activation first, Activate("left", a, ""));
  EXPECT_EQ(first.number, 1u);
  ASSERT_OK_AND_ASSIGN(const Activation second, Activate("left", b, a));
  EXPECT_EQ(second.number, 2u);
  ASSERT_OK_AND_ASSIGN(const Activation right, Activate("right", other, ""));
  EXPECT_EQ(right.number, 1u);
  Reopen();
  ASSERT_OK_AND_ASSIGN(const auto history, store().ListActivations("left", 10));
  ASSERT_EQ(history.size(), 2u);
  EXPECT_EQ(history[0], second);
  EXPECT_EQ(history[1], first);
  ASSERT_OK_AND_ASSIGN(const auto latest, store().ListActivations("left", 1));
  ASSERT_EQ(latest.size(), 1u);
  EXPECT_EQ(latest[0], second);
}

TEST_P(StoreActivations, RefusesWhatAnotherHasOvertaken) {
  const std::string a = Create("left"), b = Create("left");
  ASSERT_THAT(Activate("left", a, ""), IsOk());
  EXPECT_THAT(Activate("left", b, ""), StatusIs(absl::StatusCode::kAborted, HasSubstr(a)));
  ASSERT_OK_AND_ASSIGN(const auto history, store().ListActivations("left", 10));
  EXPECT_EQ(history.size(), 1u);
}

TEST_P(StoreActivations, TheActiveCalibrationIsNotDeleted) {
  const std::string a = Create("left"), b = Create("left");
  ASSERT_THAT(Activate("left", a, ""), IsOk());
  EXPECT_THAT(store().DeleteCalibration(a),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("the active one of rig")));
  ASSERT_THAT(Activate("left", b, a), IsOk());
  EXPECT_THAT(store().DeleteCalibration(a), IsOk());
}

TEST_P(StoreActivations, RigsAreThoseOfCalibrationsAndSessions) {
  Create("left");
  Create("left");
  ASSERT_OK_AND_ASSIGN(const auto rigs, store().ListRigs());
  ASSERT_EQ(rigs.size(), 1u);
  EXPECT_EQ(rigs[0].name, "left");
  EXPECT_EQ(rigs[0].calibration_count, 2u);
}

RIGCAL_FOR_EVERY_STORE(StoreActivations);

}  // namespace
}  // namespace rigcal::server::store_activations_test
