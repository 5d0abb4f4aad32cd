// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "tests/accuracy/solver/doctor_experiment.h"
#include "tests/testing/recorded_data.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::accuracy::doctor_test {
namespace {

using ::rigcal::testing::IsOk;
using ::testing::IsEmpty;

constexpr uint32_t kFirstSeed = 2000;  // not those of the table

Diagnosis DiagnoseSimulated(const std::string& name, uint32_t seed) {
  for (const Disturbance& disturbance : AllDisturbances()) {
    if (disturbance.name != name) continue;
    const auto patient = SimulatedPatient(seed, 5, 30);
    EXPECT_THAT(patient, IsOk());
    return Diagnose(disturbance, *patient, seed);
  }
  ADD_FAILURE() << "no disturbance " << name;
  return {};
}

TEST(DoctorTest, NamesDifferAndTheFirstOneIsClean) {
  const auto all = AllDisturbances();
  EXPECT_EQ(all.front().name, "clean");
  for (size_t i = 0; i < all.size(); ++i) {
    for (size_t j = 0; j < i; ++j) EXPECT_NE(all[i].name, all[j].name);
  }
}

TEST(DoctorTest, CleanRecordingsRaiseNoAlarm) {
  for (uint32_t seed = kFirstSeed; seed < kFirstSeed + 2; ++seed) {
    const Diagnosis diagnosis = DiagnoseSimulated("clean", seed);
    EXPECT_THAT(diagnosis.status, IsOk());
    EXPECT_THAT(diagnosis.wrong, IsEmpty());
    EXPECT_NE(diagnosis.grade, QualityGrade::kBad);
    EXPECT_FALSE(diagnosis.falsely_good);
    EXPECT_LT(diagnosis.error_rel, 0.01);
  }
}

TEST(DoctorTest, ClockThatJumpedIsNamedAndFollowedAndNothingElse) {
  const Diagnosis clean = DiagnoseSimulated("clean", kFirstSeed);
  const Diagnosis diagnosis = DiagnoseSimulated("clock jumps 30 ms late", kFirstSeed);
  EXPECT_TRUE(diagnosis.named);
  EXPECT_THAT(diagnosis.wrong, IsEmpty());
  EXPECT_EQ(diagnosis.grade, QualityGrade::kGood);
  EXPECT_LT(diagnosis.error_m, 1.5 * clean.error_m);
}

// A clock seemed to drift, once the move was taken out, and before it.
TEST(DoctorTest, CameraThatMovedAndIsBackHasNoClockThatDrifts) {
  for (const Disturbance& disturbance : AllDisturbances()) {
    if (disturbance.name != "shifted 20 mm and back") continue;
    const auto patient = SimulatedPatient(1, 6, 40);
    ASSERT_THAT(patient, IsOk());
    const Diagnosis diagnosis = Diagnose(disturbance, *patient, 1);
    EXPECT_TRUE(diagnosis.kinds.contains(FindingKind::kCameraMoved));
    EXPECT_FALSE(diagnosis.kinds.contains(FindingKind::kClockDrift));
  }
}

TEST(DoctorTest, TurnOfATenthOfADegreeIsNamedAndNothingElse) {
  const Diagnosis diagnosis = DiagnoseSimulated("turned 0.10 degrees half-way", kFirstSeed);
  EXPECT_TRUE(diagnosis.named);
  EXPECT_THAT(diagnosis.wrong, IsEmpty());
  EXPECT_EQ(diagnosis.grade, QualityGrade::kBad);
}

// Alternatives compete on the same rows: a zoom moves the image much as a step towards the wand
// does, a slow move as one at once.
TEST(DoctorTest, WhatChangedInACameraIsNamedAndNothingElse) {
  for (const std::string name :
       {"zoomed 1 % half-way", "zoomed 1 % and back", "sinking 0.3 degrees",
        "shifted 20 mm half-way", "shaking 0.2 degrees"}) {
    const Diagnosis diagnosis = DiagnoseSimulated(name, kFirstSeed);
    EXPECT_TRUE(diagnosis.named) << name;
    EXPECT_THAT(diagnosis.wrong, IsEmpty()) << name;
    EXPECT_EQ(diagnosis.grade, QualityGrade::kBad) << name;
  }
}

TEST(DoctorTest, MoveOfTheRealRecordingIsNamed) {
  RIGCAL_REQUIRE_RECORDED_DATA(folder);
  const auto patient = RecordedPatient();
  ASSERT_THAT(patient, IsOk());
  for (const Disturbance& disturbance : MoveDisturbances()) {
    const Diagnosis diagnosis = Diagnose(disturbance, *patient, kFirstSeed);
    // 20 mm along the optical axis and half a percent of zoom cannot be told from each other there.
    if (disturbance.name != "shifted 20 mm ahead half-way") {
      EXPECT_TRUE(diagnosis.named) << disturbance.name;
    }
    EXPECT_EQ(diagnosis.grade, QualityGrade::kBad) << disturbance.name;
  }
}

TEST(DoctorTest, WandsThatDoNotKeepTheirShapeAreNamedAndNothingElse) {
  for (const Disturbance& disturbance : WandDisturbances()) {
    const Diagnosis diagnosis = DiagnoseSimulated(disturbance.name, kFirstSeed);
    EXPECT_TRUE(diagnosis.named) << disturbance.name;
    EXPECT_THAT(diagnosis.wrong, IsEmpty()) << disturbance.name;
    EXPECT_NE(diagnosis.grade, QualityGrade::kGood) << disturbance.name;
  }
}

TEST(DoctorTest, CameraThatSpoilsTheOthersIsLeftOut) {
  const Diagnosis diagnosis = DiagnoseSimulated("one camera reversed", kFirstSeed);
  EXPECT_THAT(diagnosis.status, IsOk());
  EXPECT_TRUE(diagnosis.named);
  EXPECT_LT(diagnosis.error_rel, 0.01);
}

// 130 degrees: the data say that these are no Brown-Conrady lenses, and which ones they are.
TEST(DoctorTest, FisheyesDescribedAsBrownConradyAreNamedAndMended) {
  const Diagnosis diagnosis = DiagnoseSimulated("fisheye as Brown-Conrady, all", kFirstSeed);
  EXPECT_TRUE(diagnosis.named);
  EXPECT_THAT(diagnosis.wrong, IsEmpty());
  EXPECT_NE(diagnosis.grade, QualityGrade::kGood);
  EXPECT_LT(diagnosis.error_rel, 0.005);
}

TEST(DoctorTest, FisheyesDescribedAsSuchRaiseNoAlarm) {
  const Diagnosis diagnosis = DiagnoseSimulated("clean with fisheyes", kFirstSeed);
  EXPECT_THAT(diagnosis.status, IsOk());
  EXPECT_THAT(diagnosis.wrong, IsEmpty());
  EXPECT_FALSE(diagnosis.falsely_good);
}

TEST(DoctorTest, WrongSpacingIsNamedAndNotUsable) {
  const Diagnosis diagnosis = DiagnoseSimulated("wand's end 10 mm off", kFirstSeed);
  EXPECT_TRUE(diagnosis.named);
  EXPECT_EQ(diagnosis.grade, QualityGrade::kBad);
  EXPECT_GT(diagnosis.error_rel, 0.01);
}

TEST(DoctorTest, ACopiedFileIsNamedAndBad) {
  const Diagnosis diagnosis = DiagnoseSimulated("file copied", kFirstSeed);
  EXPECT_TRUE(diagnosis.named);
  EXPECT_THAT(diagnosis.wrong, IsEmpty());
  EXPECT_EQ(diagnosis.grade, QualityGrade::kBad);
}

TEST(DoctorTest, ADetectorThatIsOftenWrongIsNamedAndTheRestIsUsable) {
  const Diagnosis diagnosis = DiagnoseSimulated("30 % outliers", kFirstSeed);
  EXPECT_TRUE(diagnosis.named);
  EXPECT_THAT(diagnosis.wrong, IsEmpty());
  EXPECT_EQ(diagnosis.grade, QualityGrade::kUsable);
  EXPECT_LT(diagnosis.error_rel, 0.001);
}

TEST(DoctorTest, ASecondWandIsNamedAndTheRestIsUsable) {
  const Diagnosis diagnosis = DiagnoseSimulated("second wand in 30 % of two", kFirstSeed);
  EXPECT_TRUE(diagnosis.named);
  EXPECT_THAT(diagnosis.wrong, IsEmpty());
  EXPECT_EQ(diagnosis.grade, QualityGrade::kUsable);
  EXPECT_LT(diagnosis.error_rel, 0.001);
}

TEST(DoctorTest, StampsOfArrivalAreNoRollingShutter) {
  const Diagnosis diagnosis = DiagnoseSimulated("stamps 20 ms late, one", kFirstSeed);
  EXPECT_TRUE(diagnosis.named);
  EXPECT_FALSE(diagnosis.kinds.contains(FindingKind::kRollingShutter));
  EXPECT_THAT(diagnosis.wrong, IsEmpty());
}

}  // namespace
}  // namespace rigcal::accuracy::doctor_test
