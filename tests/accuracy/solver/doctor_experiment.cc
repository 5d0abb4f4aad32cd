// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/solver/doctor_experiment.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "server/solve/evaluate/attached_point.h"
#include "tests/accuracy/thread_cpu.h"

namespace rigcal::accuracy {
namespace {

constexpr double kAcceptedShare = 0.01;
constexpr double kSigmas = 3;

// Facts and consequences, which name no cause.
bool IsSymptom(const Finding& finding) {
  switch (finding.kind) {
    case FindingKind::kClockFoundByMotion:
    case FindingKind::kEdgeCoverage:
    case FindingKind::kCameraAbsent:
    case FindingKind::kIntrinsicsKept:
    case FindingKind::kIntrinsicsRefined:
    case FindingKind::kRestarted:
    case FindingKind::kNotEvaluated:
    case FindingKind::kTimeMatchCorrected:
    case FindingKind::kOutliersInSpan:
    case FindingKind::kLoosePose:
    case FindingKind::kWeakLink:
    case FindingKind::kTooLittleData:
      return true;
    default:
      return finding.candidate;
  }
}

// What is graded: how far the worst camera is from its true place after the best rigid motion.
double FrameFreeErrorM(const DoctorPatient& truth, const CalibrationResult& result) {
  std::vector<RigidTransform> found, right;
  for (const CalibratedCamera& camera : result.cameras) {
    found.push_back(camera.cam_from_rig);
    right.push_back(truth.cam_from_rig.at(camera.camera));
  }
  const Eigen::Vector3d middle_m =
      result.wand_volume ? (0.5 * (result.wand_volume->min_m + result.wand_volume->max_m)).eval()
                         : Eigen::Vector3d(0, 0, truth.distance_m);
  return std::ranges::max(server::FrameFreeCentreDistances(found, right, middle_m));
}

// How far the cameras are from their true places, where they have any. The sigmas are those in the
// frame of the reference camera, and so are the errors they are compared with.
void MeasureErrors(const DoctorPatient& truth, const CalibrationResult& result,
                   Diagnosis* diagnosis) {
  const auto reference =
      std::ranges::find(result.cameras, result.reference_camera, &CalibratedCamera::camera);
  const RigidTransform true_from_rig = truth.cam_from_rig.at(reference->camera);
  std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>> places_m;  // found, true
  double sigma_m2 = 0, along_m2 = 0, true_m2 = 0;
  for (const CalibratedCamera& camera : result.cameras) {
    if (camera.camera == result.reference_camera) continue;
    const Eigen::Vector3d found_m =
        (camera.cam_from_rig * reference->cam_from_rig.Inverse()).SourceFromTargetTranslation();
    const Eigen::Vector3d true_m = (truth.cam_from_rig.at(camera.camera) * true_from_rig.Inverse())
                                       .SourceFromTargetTranslation();
    places_m.emplace_back(found_m, true_m);
    along_m2 += found_m.dot(true_m);
    true_m2 += true_m.squaredNorm();
    if (camera.uncertainty) sigma_m2 += camera.uncertainty->position_sigma_m.squaredNorm();
  }
  // The shape against its sigmas, the scale against its own.
  const double scale = along_m2 / true_m2;
  double shape_m2 = 0;
  for (const auto& [found_m, true_m] : places_m) {
    shape_m2 += (found_m - scale * true_m).squaredNorm();
  }
  diagnosis->error_m = FrameFreeErrorM(truth, result);
  diagnosis->error_rel = diagnosis->error_m / truth.distance_m;
  diagnosis->sigmas =
      std::max(std::sqrt(shape_m2 / sigma_m2), std::abs(scale - 1) / result.target.scale_sigma_rel);
  const bool far = !(diagnosis->error_rel <= kAcceptedShare);
  diagnosis->falsely_good =
      diagnosis->grade == QualityGrade::kGood && (far || !(diagnosis->sigmas <= kSigmas));
  diagnosis->falsely_usable = diagnosis->grade == QualityGrade::kUsable && far;
}

void ReadFindings(const Disturbance& disturbance, const DoctorPatient& patient,
                  const CalibrationResult& result, Diagnosis* diagnosis) {
  // In the real recording one clock is off already: with two of four, offsets against the median
  // clock change for all.
  const bool moved_median = !patient.known.empty();
  std::set<FindingKind> right_kinds;
  for (const Finding& finding : result.findings) {
    const bool disturbed = disturbance.all_causes
                               ? finding.camera.empty() || finding.camera == patient.camera ||
                                     finding.camera == patient.other_camera
                               : !disturbance.of_one_camera || finding.camera == patient.camera;
    const bool right = disturbed && std::ranges::count(disturbance.causes, finding.kind) > 0;
    const std::string name = absl::StrCat(std::string(NameOf(finding.kind)), ":", finding.camera);
    diagnosis->text.push_back(absl::StrFormat("%s %.4g %s%s: %s", name, finding.value, finding.unit,
                                              finding.candidate ? " (candidate)" : "",
                                              finding.advice));
    if (right) right_kinds.insert(finding.kind);
    // The mean of an offset that changes.
    const bool mean_offset = finding.kind == FindingKind::kClockOffset && disturbance.of_clock &&
                             (disturbed || moved_median);
    if (IsSymptom(finding) || patient.known.contains(name)) {
      if (right) diagnosis->kinds.insert(finding.kind);
      continue;
    }
    if (!mean_offset || right) diagnosis->kinds.insert(finding.kind);
    if (!right && !mean_offset) diagnosis->wrong.push_back(name);
  }
  const std::set<FindingKind> wanted(disturbance.causes.begin(), disturbance.causes.end());
  diagnosis->named = disturbance.all_causes ? right_kinds == wanted : !right_kinds.empty();
  for (const std::string& reason : result.quality.reasons) {
    diagnosis->text.push_back(absl::StrCat("quality: ", reason));
  }
}

}  // namespace

Diagnosis Diagnose(const Disturbance& disturbance, const DoctorPatient& clean, uint32_t seed) {
  DoctorPatient patient = clean;
  disturbance.apply(seed, &patient);
  Diagnosis diagnosis;
  const double begin_s = ThreadCpuS();
  const server::CalibrationOutcome outcome = server::Calibrate(patient.input, disturbance.options);
  diagnosis.status = outcome.result.status();
  diagnosis.cpu_s = ThreadCpuS() - begin_s;
  if (!diagnosis.status.ok()) {
    const std::string message(diagnosis.status.message());
    diagnosis.text.push_back(message);
    diagnosis.named = !disturbance.message.empty() &&
                      absl::StrContains(message, disturbance.message) &&
                      (!disturbance.of_one_camera || absl::StrContains(message, patient.camera));
    return diagnosis;
  }
  const CalibrationResult& result = *outcome.result;
  diagnosis.grade = result.quality.grade;
  diagnosis.text.push_back(absl::StrFormat("predicted %.3g mm of %.3g mm accepted",
                                           1e3 * result.quality.predicted_error_m,
                                           1e3 * result.quality.accepted_error_m));
  ReadFindings(disturbance, patient, result, &diagnosis);
  MeasureErrors(patient, result, &diagnosis);
  return diagnosis;
}

}  // namespace rigcal::accuracy
