// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/quality_gate.h"

#include <algorithm>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

namespace rigcal::server {
namespace {

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

void GradeCamera(const CalibratedCamera& camera, GradeBuilder* grade_builder) {
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
  const uint32_t markers = camera.residuals.outlier_count + camera.residuals.inlier.marker_count;
  grade_builder->Measure(
      name + "share of outliers",
      static_cast<double>(camera.residuals.outlier_count) / std::max(1u, markers),
      limits.outlier_share, 100, "%");
}

// What a finding means for the grade.
struct FindingEffect {
  FindingSeverity severity = FindingSeverity::kInfo;
  std::string reason;  // unless kInfo
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
      return {FindingSeverity::kError, absl::StrCat(who, " moved while it was recorded")};
    // What the solve has corrected is no fault of the calibration.
    case FindingKind::kWrongIntrinsics:
      if (camera && camera->intrinsics_refined) return {};
      return warning(absl::StrCat(who, " has wrong intrinsics (see findings)"));
    case FindingKind::kClockOffset:
      if (!camera || camera->time_offset_estimated) return {};
      return warning(absl::StrCat("the clock of ", who, " is off, and was kept as given"));
    case FindingKind::kRollingShutter:
      return warning(absl::StrCat(who, " has a rolling shutter (see findings)"));
    case FindingKind::kWrongWandLength:
      return warning("the wand is not as it was given (see findings)");
    case FindingKind::kNarrowBaseline:
      return warning(absl::StrCat(who, " sees the wand from the same direction as the others"));
    case FindingKind::kLoosePose:
      return warning(
          absl::StrFormat("%s: its position is known to %.0f mm only", who, finding.value));
    case FindingKind::kWeakLink:
      return warning(absl::StrCat(who, " hangs on few instants (see findings)"));
    case FindingKind::kPeriodicMotion:
      return warning(absl::StrFormat(
          "the motion repeats itself every %.2f s, and clocks may be off by as much",
          finding.value));
    case FindingKind::kFlippedLabels:
    case FindingKind::kEdgeCoverage:
    case FindingKind::kIntrinsicsKept:
    case FindingKind::kIntrinsicsRefined:
    case FindingKind::kTimeMatchCorrected:
    case FindingKind::kClockFoundByMotion:
    case FindingKind::kRestarted:
    case FindingKind::kNotEvaluated:
    case FindingKind::kUnspecified:
      return {};
  }
  return {};
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

}  // namespace

FindingSeverity SeverityOf(const CalibrationResult& result, const Finding& finding) {
  return EffectOf(result, finding).severity;
}

Quality GradeQuality(const CalibrationResult& result) {
  GradeBuilder grade_builder;
  double worst_px = 0;
  for (const CalibratedCamera& camera : result.cameras) {
    GradeCamera(camera, &grade_builder);
    if (camera.held_out) worst_px = std::max(worst_px, camera.held_out->mean_px);
  }
  EvaluateTarget(result.target, &grade_builder);
  for (const Finding& finding : result.findings) {
    FindingEffect effect = EffectOf(result, finding);
    if (effect.severity == FindingSeverity::kInfo) continue;
    grade_builder.Add(
        effect.severity == FindingSeverity::kError ? QualityGrade::kBad : QualityGrade::kUsable,
        std::move(effect.reason));
  }
  return std::move(grade_builder)
      .Result(absl::StrFormat("every camera's held-out mean error is at most %.2f px", worst_px));
}

}  // namespace rigcal::server
