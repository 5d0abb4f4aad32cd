// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/quality_gate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

namespace rigcal::server::quality_gate_test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

CalibrationResult Sound() {
  CalibrationResult result;
  for (const char* name : {"a", "b"}) {
    CalibratedCamera camera;
    camera.camera = name;
    camera.residuals.inlier = {0.35, 0.4, 0.3, 0.8, 990};
    camera.residuals.outlier_count = 10;
    camera.held_out = ErrorFigures{0.4, 0.5, 0.35, 0.9, 990};
    camera.leave_one_out = ErrorFigures{0.6, 0.7, 0.5, 1.2, 900};
    camera.time_offset_estimated = true;
    result.cameras.push_back(camera);
  }
  result.target.marker_positions_m = {0, 0.13, 0.39};
  result.target.spans = {{0.13, 0, 0.0005, 900, 0.0005, 900}, {0.26, 0, 0.0005, 900, 0.0005, 900}};
  return result;
}

TEST(QualityGate, SoundOneIsGoodAndSaysWhy) {
  const Quality quality = GradeQuality(Sound());
  EXPECT_EQ(quality.grade, QualityGrade::kGood);
  EXPECT_THAT(quality.reasons, ElementsAre(HasSubstr("0.40 px")));
}

// 10 mm are accepted.
PredictedError Predicted(double sigma_m) {
  PredictedError predicted;
  predicted.sigma_m = sigma_m;
  predicted.accepted_m = 0.01;
  predicted.distance_m = 3;
  predicted.instant_count = 500;
  predicted.block_count = 20;
  predicted.holds = true;
  return predicted;
}

TEST(QualityGate, PredictedErrorLimitsTheGrade) {
  CalibrationResult result = Sound();
  result.scale_known = true;
  EXPECT_EQ(GradeQuality(result, Predicted(0.0049)).grade, QualityGrade::kGood);
  EXPECT_EQ(GradeQuality(result, Predicted(0.0051)).grade, QualityGrade::kUsable);
  const Quality bad = GradeQuality(result, Predicted(0.0101));
  EXPECT_EQ(bad.grade, QualityGrade::kBad);
  EXPECT_THAT(bad.reasons, ElementsAre(HasSubstr("10.1 mm, more than 10 mm")));
  EXPECT_EQ(bad.predicted_error_m, 0.0101);
  EXPECT_EQ(bad.accepted_error_m, 0.01);
  EXPECT_TRUE(IsBadByFigures(result, Predicted(0.0101)));
  EXPECT_FALSE(IsBadByFigures(result, Predicted(0.0099)));
}

TEST(QualityGate, WhatCannotBePredictedIsBadWhateverItsSigma) {
  PredictedError predicted = Predicted(0.001);
  predicted.holds = false;
  predicted.instant_count = 20;
  predicted.block_count = 1;
  const Quality quality = GradeQuality(Sound(), predicted);
  EXPECT_EQ(quality.grade, QualityGrade::kBad);
  EXPECT_THAT(quality.reasons, ElementsAre(HasSubstr("20 instants in 1 blocks of 2 s")));
  EXPECT_EQ(quality.predicted_error_m, 0);
}

TEST(QualityGate, SpansThatContradictEachOtherByMoreThanIsAcceptedAreBad) {
  CalibrationResult result = Sound();
  result.target.given.marker_positions_m = {0, 0.13, 0.39};
  result.findings.push_back({FindingKind::kWrongWandLength, "", 5, "mm", ""});
  EXPECT_EQ(GradeQuality(result, Predicted(0.001)).grade, QualityGrade::kBad);
  result.findings[0].value = 1;  // 0.26 % of 3 m
  EXPECT_EQ(GradeQuality(result, Predicted(0.001)).grade, QualityGrade::kUsable);
  // A candidate is no reason.
  result.findings[0].candidate = true;
  EXPECT_EQ(GradeQuality(result, Predicted(0.001)).grade, QualityGrade::kGood);
}

TEST(QualityGate, EachFigureHasTwoLimits) {
  const QualityLimits& limits = kQualityLimits;
  const auto grade = [](const auto& change) {
    CalibrationResult result = Sound();
    change(result);
    return GradeQuality(result);
  };
  const auto held_out = [&](double px) {
    return grade([px](CalibrationResult& r) { r.cameras[1].held_out->mean_px = px; });
  };
  EXPECT_EQ(held_out(limits.held_out_mean_px.good).grade, QualityGrade::kGood);
  EXPECT_EQ(held_out(limits.held_out_mean_px.good + 0.01).grade, QualityGrade::kUsable);
  EXPECT_EQ(held_out(limits.held_out_mean_px.usable + 0.01).grade, QualityGrade::kBad);
  EXPECT_EQ(held_out(NAN).grade, QualityGrade::kBad);
  EXPECT_EQ(held_out(std::numeric_limits<double>::infinity()).grade, QualityGrade::kBad);
  EXPECT_THAT(held_out(5).reasons, ElementsAre(HasSubstr("camera b: held-out")));

  const auto left_out = [&](double px) {
    return grade([px](CalibrationResult& r) { r.cameras[0].leave_one_out->mean_px = px; }).grade;
  };
  EXPECT_EQ(left_out(limits.leave_one_out_mean_px.good + 0.01), QualityGrade::kUsable);
  EXPECT_EQ(left_out(limits.leave_one_out_mean_px.usable + 0.01), QualityGrade::kBad);

  const auto outliers = [&](uint32_t count) {
    return grade([count](CalibrationResult& r) {
             r.cameras[0].residuals.outlier_count = count;
             r.cameras[0].residuals.inlier.marker_count = 1000 - count;
           })
        .grade;
  };
  EXPECT_EQ(outliers(100), QualityGrade::kGood);
  EXPECT_EQ(outliers(101), QualityGrade::kUsable);
  EXPECT_EQ(outliers(351), QualityGrade::kBad);

  const auto length = [&](double rel) {
    return grade(
               [rel](CalibrationResult& r) { r.target.spans[1].held_out_error_rms_m = rel * 0.39; })
        .grade;
  };
  EXPECT_EQ(length(limits.length_error_rel.good + 1e-4), QualityGrade::kUsable);
  EXPECT_EQ(length(limits.length_error_rel.usable + 1e-4), QualityGrade::kBad);
}

TEST(QualityGate, WithoutHeldOutDataAtMostUsable) {
  CalibrationResult result = Sound();
  result.cameras[0].held_out.reset();
  Quality quality = GradeQuality(result);
  EXPECT_EQ(quality.grade, QualityGrade::kUsable);
  EXPECT_THAT(quality.reasons, ElementsAre(HasSubstr("camera a: too little")));
  result.cameras[0].residuals.inlier.mean_px = 1.6;
  EXPECT_EQ(GradeQuality(result).grade, QualityGrade::kBad);
}

TEST(QualityGate, FindingsCount) {
  const auto with = [](FindingKind kind, bool estimated = true, double value = 1) {
    CalibrationResult result = Sound();
    result.cameras[0].time_offset_estimated = estimated;
    result.findings.push_back({kind, "a", value, "", ""});
    return GradeQuality(result).grade;
  };
  EXPECT_EQ(with(FindingKind::kCameraMoved), QualityGrade::kBad);
  EXPECT_EQ(with(FindingKind::kCameraMoved, true, 0.9), QualityGrade::kUsable);
  for (const FindingKind kind :
       {FindingKind::kWrongIntrinsics, FindingKind::kRollingShutter, FindingKind::kWrongWandLength,
        FindingKind::kWeakLink, FindingKind::kNarrowBaseline, FindingKind::kLoosePose}) {
    EXPECT_EQ(with(kind), QualityGrade::kUsable) << kind;
  }
  // Taken out by the solve, or not.
  EXPECT_EQ(with(FindingKind::kClockOffset), QualityGrade::kGood);
  EXPECT_EQ(with(FindingKind::kClockOffset, false), QualityGrade::kUsable);
  CalibrationResult refined = Sound();
  refined.cameras[0].intrinsics_refined = true;
  refined.cameras[0].image_size_px = {1920, 1200};
  refined.findings.push_back({FindingKind::kWrongIntrinsics, "a", 30, "px", ""});
  EXPECT_EQ(GradeQuality(refined).grade, QualityGrade::kGood);
  refined.findings[0].value = 60;
  EXPECT_THAT(GradeQuality(refined).reasons, ElementsAre(HasSubstr("of another lens")));
  for (const FindingKind kind :
       {FindingKind::kIntrinsicsKept, FindingKind::kEdgeCoverage, FindingKind::kFlippedLabels}) {
    EXPECT_EQ(with(kind), QualityGrade::kGood) << kind;
  }
}

TEST(QualityGate, WithoutACameraThatWasLeftOutAtMostUsable) {
  for (const FindingKind kind :
       {FindingKind::kInconsistentCamera, FindingKind::kMirroredImage, FindingKind::kNoisyCamera}) {
    CalibrationResult result = Sound();
    result.findings.push_back({kind, "gone", 100, "px", ""});
    const Quality quality = GradeQuality(result);
    EXPECT_EQ(quality.grade, QualityGrade::kUsable);
    EXPECT_THAT(quality.reasons, ElementsAre(HasSubstr("camera gone was left out")));
  }
}

TEST(QualityGate, NamesCausesBeforeFigures) {
  CalibrationResult result = Sound();
  result.cameras[0].held_out->mean_px = 10;
  result.findings.push_back({FindingKind::kCameraMoved, "a", 20, "px", ""});
  EXPECT_THAT(GradeQuality(result).reasons,
              ElementsAre(HasSubstr("moved"), HasSubstr("held-out mean error")));
}

}  // namespace
}  // namespace rigcal::server::quality_gate_test
