// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/quality_gate.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "server/associate/copied_rows.h"

namespace rigcal::server {
namespace {

// Of the focal length: as wrong are the distances from the camera.
constexpr double kHeldFocalPercent = 1;
// Of the wand's shape: as much as its spans are wrong by without a word.
constexpr double kAllowedWandFaultMm = 2;
constexpr double kMuchFlickerMs = 1;
// Of the image: less than detectors err by, over the places that a camera saw.
constexpr double kSmallMovePx = 1;
// Of the image's width: a lens file so far off is of another lens, resolution or camera.
constexpr double kOtherLensShare = 0.02;

// Collects what speaks against each grade.
class GradeBuilder {
 public:
  // `what` reads "camera c: held-out error"; `scale` and `unit` are for people.
  void Measure(const std::string& what, double value, const QualityLimit& limit, double scale,
               const std::string& unit) {
    if (value <= limit.good) return;
    // NaN is bad, too.
    const bool usable = value <= limit.usable;
    const double passed = usable ? limit.good : limit.usable;
    Add(usable ? QualityGrade::kUsable : QualityGrade::kBad,
        absl::StrFormat("%s is %.3g %s, more than %.3g %s", what, scale * value, unit,
                        scale * passed, unit));
  }
  void Add(QualityGrade grade, std::string reason) {
    (grade == QualityGrade::kBad ? bad_ : usable_).push_back(std::move(reason));
  }
  Quality Result(std::string reason_for_good) && {
    if (!bad_.empty()) return {QualityGrade::kBad, std::move(bad_)};
    if (!usable_.empty()) return {QualityGrade::kUsable, std::move(usable_)};
    return {QualityGrade::kGood, {std::move(reason_for_good)}};
  }

 private:
  std::vector<std::string> bad_, usable_;
};

// Rows in which it sees something else were left out of the solve, and a finding says so.
bool OutliersAreNamed(const CalibrationResult& result, const std::string& camera) {
  return std::ranges::any_of(result.findings, [&camera](const Finding& finding) {
    return finding.camera == camera && (finding.kind == FindingKind::kOutliersInCamera ||
                                        finding.kind == FindingKind::kSecondWandSeen);
  });
}

void GradeCamera(const CalibrationResult& result, const CalibratedCamera& camera,
                 GradeBuilder* grade_builder) {
  const QualityLimits& limits = kQualityLimits;
  const std::string name = absl::StrCat("camera ", camera.camera, ": ");
  const bool held_out =
      camera.held_out && camera.held_out->marker_count >= limits.min_held_out_count;
  if (held_out) {
    grade_builder->Measure(name + "held-out mean error", camera.held_out->mean_px,
                           limits.held_out_mean_px, 1, "px");
  } else {
    grade_builder->Add(
        QualityGrade::kUsable,
        absl::StrCat(name, "too little of it could be held out to grade it (",
                     camera.held_out ? camera.held_out->marker_count : 0, " markers, ",
                     limits.min_held_out_count, " are needed); record longer"));
    grade_builder->Measure(name + "mean error", camera.residuals.inlier.mean_px,
                           limits.inlier_mean_px, 1, "px");
  }
  if (camera.leave_one_out && camera.leave_one_out->marker_count >= limits.min_held_out_count) {
    grade_builder->Measure(name + "mean error where the other cameras put the markers",
                           camera.leave_one_out->mean_px, limits.leave_one_out_mean_px, 1, "px");
  }
  if (OutliersAreNamed(result, camera.camera)) return;
  const uint32_t markers = camera.residuals.outlier_count + camera.residuals.inlier.marker_count;
  grade_builder->Measure(
      name + "share of outliers",
      static_cast<double>(camera.residuals.outlier_count) / std::max(1u, markers),
      limits.outlier_share, 100, "%");
}

// What a finding means for the grade.
struct FindingEffect {
  FindingSeverity severity = FindingSeverity::kInfo;
  std::string reason;  // empty: none beside those of the figures
};

FindingEffect EffectOf(const CalibrationResult& result, const Finding& finding) {
  const auto found = std::ranges::find(result.cameras, finding.camera, &CalibratedCamera::camera);
  const CalibratedCamera* camera = found == result.cameras.end() ? nullptr : &*found;
  const std::string who =
      finding.camera.empty() ? "the rig" : absl::StrCat("camera ", finding.camera);
  const auto warning = [](std::string reason) {
    return FindingEffect{FindingSeverity::kWarning, std::move(reason)};
  };
  switch (finding.kind) {
    case FindingKind::kCameraMoved:
      return {finding.value < kSmallMovePx ? FindingSeverity::kWarning : FindingSeverity::kError,
              absl::StrCat(who, " moved while it was recorded")};
    case FindingKind::kLensChanged:
      return {FindingSeverity::kError,
              absl::StrCat("the lens of ", who, " changed while it was recorded")};
    case FindingKind::kWandNotRigid:
      if (finding.value < kAllowedWandFaultMm) return {};
      return warning("the wand did not keep its shape (see findings)");
    // What the solve has corrected is no fault of the calibration.
    case FindingKind::kWrongIntrinsics:
      if (camera && camera->intrinsics_refined) {
        if (finding.value < kOtherLensShare * camera->image_size_px.width) return {};
        return warning(
            absl::StrCat(who, ": its lens file is of another lens or another resolution"));
      }
      return warning(absl::StrCat(who, " has wrong intrinsics (see findings)"));
    case FindingKind::kWrongLensModel:
      return warning(absl::StrCat(who, ": its lens is of another kind than was given"));
    case FindingKind::kClockOffset:
      if (!camera || camera->time_offset_estimated) return {};
      return warning(absl::StrCat("the clock of ", who, " is off, and was kept as given"));
    case FindingKind::kTooLittleData:
      return {FindingSeverity::kError, ""};  // the predicted error is the reason
    case FindingKind::kClockJump:
      if (camera && !camera->clock_course.empty()) return {};
      return warning(absl::StrCat("the clock of ", who, " jumped while it was recorded"));
    case FindingKind::kClockDrift:
      if (camera && (!camera->clock_course.empty() || finding.unit == "ppm")) return {};
      return warning(absl::StrCat("the clock of ", who, " ran at a rate that was not estimated"));
    case FindingKind::kOutliersInSpan:
      return warning(
          absl::StrCat(who, " disagrees with the others during a part of the recording"));
    case FindingKind::kIntrinsicsFromPrior:
      return {
          finding.value > kHeldFocalPercent ? FindingSeverity::kError : FindingSeverity::kWarning,
          absl::StrCat(who,
                       ": its intrinsics are what was given more than what the data say "
                       "(see findings)")};
    // Without a camera that was left out the calibration is not what was asked for.
    case FindingKind::kNoisyCamera:
      if (!camera) return warning(absl::StrCat(who, " was left out (see findings)"));
      return warning(absl::StrCat(who, " has much worse centres than the others"));
    case FindingKind::kMirroredImage:
      if (!camera) return warning(absl::StrCat(who, " was left out: its image is mirrored"));
      return {FindingSeverity::kError, absl::StrCat("the image of ", who, " is mirrored")};
    case FindingKind::kInconsistentCamera:
      if (!camera) return warning(absl::StrCat(who, " was left out: it agrees with no other one"));
      return {FindingSeverity::kError, absl::StrCat(who, " agrees with no other camera")};
    case FindingKind::kRollingShutter:
      if (camera && camera->line_delay_s != 0) return {};
      return warning(absl::StrCat(who, " has a rolling shutter (see findings)"));
    case FindingKind::kWrongWandLength:
      return warning("the wand is not as it was given (see findings)");
    case FindingKind::kWrongTargetShape:
      return warning("the target's points are not where they were given (see findings)");
    case FindingKind::kNarrowBaseline:
      return warning(absl::StrCat(who, " sees the wand from the same direction as the others"));
    case FindingKind::kLoosePose:
      return warning(
          absl::StrFormat("%s: its position is known to %.0f mm only", who, finding.value));
    case FindingKind::kWeakLink:
      // All that were left out are one reason (GradeLeftOut).
      if (!camera) return warning("");
      return warning(absl::StrCat(who, " hangs on few instants (see findings)"));
    case FindingKind::kPeriodicMotion:
      return warning(absl::StrFormat(
          "the motion repeats itself every %.2f s, and clocks may be off by as much",
          finding.value));
    case FindingKind::kStampsRepeat:
      return warning(absl::StrFormat("%s: %.0f %% of its rows have the stamp of the row before",
                                     who, finding.value));
    case FindingKind::kBursts:
      return warning(absl::StrCat(who, ": its rows are stamped in bursts"));
    case FindingKind::kViewsNotUsed:
      return {finding.severity, absl::StrFormat("%s: %.0f %% of its wand views are not used (see "
                                                "findings)",
                                                who, finding.value)};
    case FindingKind::kRowsCopied:
      // Whose the rows are that are left nobody knows.
      if (finding.value >= kWholeCopyPercent) {
        return {FindingSeverity::kError, absl::StrCat(who, " has the same rows as another camera")};
      }
      return warning(absl::StrFormat("%s: %.0f %% of its wand views are another camera's, too", who,
                                     finding.value));
    case FindingKind::kRowsFrozen:
      return warning(absl::StrFormat("%s: %.0f %% of its wand views are one frozen image", who,
                                     finding.value));
    case FindingKind::kStampsJitter:
      return warning(absl::StrFormat("%s: its time stamps scatter by %.1f ms", who, finding.value));
    case FindingKind::kOutliersInCamera:
      return warning(
          absl::StrFormat("%s: %.0f %% of its wand views show something else", who, finding.value));
    case FindingKind::kSecondWandSeen:
      return warning(
          absl::StrFormat("%s sees another wand in %.0f %% of its rows", who, finding.value));
    case FindingKind::kLightCodeContradicts:
      return warning(
          absl::StrCat(who, ": its readings of the wand's light code contradict others"));
    case FindingKind::kOtherWandSeen:
      return warning(absl::StrCat(who, " has seen another wand than most cameras"));
    case FindingKind::kLampFlickerContradicts:
      // Pixels answer later in less light, by a part of a millisecond: that says nothing yet.
      if (std::abs(finding.value) < kMuchFlickerMs) return {};
      return warning(absl::StrCat(who, ": the flicker of the lamps contradicts its clock"));
    case FindingKind::kClockByLightCode:
    case FindingKind::kWandClockWrong:
    case FindingKind::kRowsRepeated:
    case FindingKind::kMarkersAtOrigin:
    case FindingKind::kClockSteps:
    case FindingKind::kRowsOutOfOrder:
    case FindingKind::kFlippedLabels:
    case FindingKind::kEdgeCoverage:
    case FindingKind::kCameraAbsent:
    case FindingKind::kIntrinsicsKept:
    case FindingKind::kIntrinsicsRefined:
    case FindingKind::kTimeMatchCorrected:
    case FindingKind::kClockFoundByMotion:
    case FindingKind::kRestarted:
    case FindingKind::kNotEvaluated:
    // Graded by who reads the rows.
    case FindingKind::kIncompleteSession:
    case FindingKind::kUnspecified:
      return {};
  }
  return {};
}

// Refined intrinsics that are far from the given ones in most cameras: those were guessed, and the
// priors pull all of them in the same direction.
void EvaluateIntrinsics(const CalibrationResult& result, GradeBuilder* grade_builder) {
  const auto far = std::ranges::count_if(result.findings, [&result](const Finding& finding) {
    return finding.kind == FindingKind::kWrongIntrinsics && !finding.candidate &&
           std::ranges::any_of(result.cameras, [&finding](const CalibratedCamera& camera) {
             return camera.camera == finding.camera && camera.intrinsics_refined;
           });
  });
  if (2 * far <= static_cast<std::ptrdiff_t>(result.cameras.size())) return;
  grade_builder->Add(
      QualityGrade::kUsable,
      absl::StrFormat("the refined intrinsics of %d of %d cameras are far from the given ones, "
                      "which hold them still: if those were guessed, calibrate the lenses",
                      far, result.cameras.size()));
}

void EvaluateTarget(const CalibratedTarget& target, GradeBuilder* grade_builder) {
  const double whole_m = target.marker_positions_m.empty() ? 0 : target.marker_positions_m.back();
  if (!(whole_m > 0)) return;
  for (size_t s = 0; s < target.spans.size(); ++s) {
    const SpanError& span = target.spans[s];
    if (span.held_out_count < kQualityLimits.min_held_out_count) continue;
    grade_builder->Measure(
        absl::StrCat("held-out error of the wand's span ", s + 1, " against the wand's length"),
        span.held_out_error_rms_m / whole_m, kQualityLimits.length_error_rel, 100, "%");
  }
}

void EvaluatePrediction(const PredictedError& predicted, double unit_mm, const std::string& unit,
                        GradeBuilder* grade_builder) {
  if (!predicted.holds) {
    std::string why;
    if (predicted.instant_count < kMinPredictedInstants ||
        predicted.block_count < kMinPredictedBlocks) {
      why = absl::StrFormat("%d instants in %d blocks of 2 s; at least %d in %d are needed",
                            predicted.instant_count, predicted.block_count, kMinPredictedInstants,
                            kMinPredictedBlocks);
    } else if (predicted.scarcest_block_count < kMinCameraBlocks) {
      why = absl::StrFormat("camera %s sees the wand in %d blocks of 2 s; at least %d are needed",
                            predicted.scarcest_camera, predicted.scarcest_block_count,
                            kMinCameraBlocks);
    } else if (!std::isfinite(predicted.stated_m)) {
      why = "the data leave some of it open, so that no uncertainty is known";
    } else {
      why = absl::StrFormat("of 4 parts of the recording only %d could be solved by themselves",
                            predicted.fold_count);
    }
    grade_builder->Add(QualityGrade::kBad,
                       absl::StrCat("too little data to say how accurate it is (", why,
                                    "): record longer, and turn the wand"));
    return;
  }
  const QualityLimit limit = {kQualityLimits.predicted_error.good * predicted.accepted_m,
                              kQualityLimits.predicted_error.usable * predicted.accepted_m};
  grade_builder->Measure("the predicted error of the camera positions (one sigma)",
                         predicted.sigma_m, limit, unit_mm, unit);
}

void GradeFigures(const CalibrationResult& result, const std::optional<PredictedError>& predicted,
                  GradeBuilder* grade_builder) {
  for (const CalibratedCamera& camera : result.cameras) {
    GradeCamera(result, camera, grade_builder);
  }
  EvaluateTarget(result.target, grade_builder);
  if (!predicted) return;
  EvaluatePrediction(*predicted, result.scale_known ? 1e3 : 1,
                     result.scale_known ? "mm" : "units of length", grade_builder);
}

// Between the two points that are furthest apart.
double ExtentOf(const Target& target) {
  double extent_m = 0;
  for (const TargetPoint& a : target.points) {
    for (const TargetPoint& b : target.points) {
      extent_m = std::max(extent_m, std::hypot(a.x_m - b.x_m, a.y_m - b.y_m, a.z_m - b.z_m));
    }
  }
  return extent_m;
}

// The lengths of the target contradict each other, and the solution took a scale between them.
void EvaluateSpans(const CalibrationResult& result, const PredictedError& predicted,
                   const Finding& finding, GradeBuilder* grade_builder) {
  const Target& given = result.target.given;
  double length_m = 0;
  if (finding.kind == FindingKind::kWrongTargetShape) {
    length_m = ExtentOf(given);
  } else if (finding.kind == FindingKind::kWrongWandLength && given.marker_positions_m.size() > 1) {
    length_m = given.marker_positions_m.back();
  }
  if (!(length_m > 0)) return;
  const double scale_rel = 1e-3 * std::abs(finding.value) / length_m;
  grade_builder->Measure("the error of the scale that the target's lengths leave open",
                         scale_rel * predicted.distance_m,
                         {predicted.accepted_m, predicted.accepted_m}, 1e3, "mm");
}

// Cameras that nothing connects with those of the result.
void GradeLeftOut(const CalibrationResult& result, GradeBuilder* grade_builder) {
  std::set<std::string> left_out;
  for (const Finding& finding : result.findings) {
    if (finding.kind == FindingKind::kWeakLink && !finding.camera.empty() &&
        std::ranges::count(result.cameras, finding.camera, &CalibratedCamera::camera) == 0) {
      left_out.insert(finding.camera);
    }
  }
  if (left_out.empty()) return;
  grade_builder->Add(
      QualityGrade::kUsable,
      absl::StrFormat("only %d of %d cameras are calibrated: nothing connects the others with them "
                      "(see findings)",
                      result.cameras.size(), result.cameras.size() + left_out.size()));
}

}  // namespace

FindingSeverity SeverityOf(const CalibrationResult& result, const Finding& finding) {
  return EffectOf(result, finding).severity;
}

bool IsBadByFigures(const CalibrationResult& result,
                    const std::optional<PredictedError>& predicted) {
  GradeBuilder grade_builder;
  GradeFigures(result, predicted, &grade_builder);
  return std::move(grade_builder).Result("").grade == QualityGrade::kBad;
}

Quality GradeQuality(const CalibrationResult& result,
                     const std::optional<PredictedError>& predicted) {
  GradeBuilder grade_builder;
  double worst_px = 0;
  for (const CalibratedCamera& camera : result.cameras) {
    if (camera.held_out) worst_px = std::max(worst_px, camera.held_out->mean_px);
  }
  // Causes first: figures are what they lead to.
  GradeLeftOut(result, &grade_builder);
  for (const Finding& finding : result.findings) {
    if (finding.candidate) continue;
    FindingEffect effect = EffectOf(result, finding);
    if (effect.severity == FindingSeverity::kInfo || effect.reason.empty()) continue;
    grade_builder.Add(
        effect.severity == FindingSeverity::kError ? QualityGrade::kBad : QualityGrade::kUsable,
        std::move(effect.reason));
  }
  GradeFigures(result, predicted, &grade_builder);
  EvaluateIntrinsics(result, &grade_builder);
  for (const Finding& finding : result.findings) {
    if (predicted && !finding.candidate) EvaluateSpans(result, *predicted, finding, &grade_builder);
  }
  Quality quality = std::move(grade_builder)
                        .Result(absl::StrFormat(
                            "every camera's held-out mean error is at most %.2f px", worst_px));
  if (predicted && std::isfinite(predicted->sigma_m)) {
    quality.predicted_error_m = predicted->holds ? predicted->sigma_m : 0;
    quality.accepted_error_m = predicted->accepted_m;
  }
  return quality;
}

}  // namespace rigcal::server
