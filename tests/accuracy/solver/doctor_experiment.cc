// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/solver/doctor_experiment.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <random>
#include <set>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/camera/camera_model.h"
#include "common/simulation/world/simulated_world.h"
#include "common/statistics/robust_statistics.h"
#include "common/status/status_macros.h"
#include "tests/accuracy/rig/simulated_tracks.h"
#include "tests/server/solve/recorded_input.h"
#include "tests/server/solve/simulated_input.h"
#include "tests/testing/recorded_data.h"

namespace rigcal::accuracy {
namespace {

constexpr double kAcceptedShare = 0.01;
constexpr double kSigmas = 3;

using Rows = std::vector<Observation>;

server::CameraTrack& TrackOf(DoctorPatient* patient) {
  return *std::ranges::find(patient->input.tracks, patient->camera,
                            [](const server::CameraTrack& track) { return track.camera.camera; });
}

// First stamp and length of the disturbed camera's rows.
std::pair<int64_t, double> SpanOf(const Rows& rows) {
  const auto [first, last] = std::ranges::minmax_element(rows, {}, &Observation::time_ns);
  return {first->time_ns, 1e-9 * static_cast<double>(last->time_ns - first->time_ns)};
}

// Seconds that are added to the stamp of a row `share` of the way through the recording.
void MoveStamps(const std::function<double(double share)>& added_s, DoctorPatient* patient) {
  Rows& rows = TrackOf(patient).observations;
  const auto [first_ns, span_s] = SpanOf(rows);
  for (Observation& row : rows) {
    const double share = 1e-9 * static_cast<double>(row.time_ns - first_ns) / span_s;
    row.time_ns += std::llround(1e9 * added_s(share));
  }
}

// Keeps `keep_s` in the middle of the recording.
void Crop(double keep_s, DoctorPatient* patient) {
  int64_t first_ns = 0, last_ns = 0;
  for (const server::CameraTrack& track : patient->input.tracks) {
    const auto [begin_ns, span_s] = SpanOf(track.observations);
    if (first_ns == 0 || begin_ns > first_ns) first_ns = begin_ns;
    last_ns = std::max<int64_t>(last_ns, begin_ns + std::llround(1e9 * span_s));
  }
  const int64_t middle_ns = first_ns + (last_ns - first_ns) / 2;
  const int64_t half_ns = std::llround(0.5e9 * keep_s);
  for (server::CameraTrack& track : patient->input.tracks) {
    std::erase_if(track.observations, [&](const Observation& row) {
      return row.time_ns < middle_ns - half_ns || row.time_ns > middle_ns + half_ns;
    });
  }
}

void ForEachCentre(server::CameraTrack* track,
                   const std::function<void(double share, MarkerObservation*)>& change) {
  const auto [first_ns, span_s] = SpanOf(track->observations);
  for (Observation& row : track->observations) {
    const double share = 1e-9 * static_cast<double>(row.time_ns - first_ns) / span_s;
    for (MarkerObservation& marker : row.markers) {
      if (marker.visible) change(share, &marker);
    }
  }
}

void AddNoise(uint32_t seed, double sigma_px, DoctorPatient* patient) {
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0, sigma_px);
  ForEachCentre(&TrackOf(patient), [&](double, MarkerObservation* marker) {
    marker->centre_px += Eigen::Vector2d(noise(random), noise(random));
  });
}

// Whatever is detected is none of the markers.
void Scatter(uint32_t seed, server::CameraTrack* track) {
  std::mt19937 random(seed);
  const ImageSize size = track->camera.image_size_px;
  std::uniform_real_distribution<double> x(0, size.width - 1), y(0, size.height - 1);
  ForEachCentre(track, [&](double, MarkerObservation* marker) {
    marker->centre_px = {x(random), y(random)};
  });
}

void Mirror(bool upside_down, DoctorPatient* patient) {
  server::CameraTrack& track = TrackOf(patient);
  const ImageSize size = track.camera.image_size_px;
  ForEachCentre(&track, [&](double, MarkerObservation* marker) {
    double& value = upside_down ? marker->centre_px.y() : marker->centre_px.x();
    value = (upside_down ? size.height : size.width) - 1 - value;
  });
}

// The camera turns about its y axis by `degrees` from `from` of the way on.
void Turn(double degrees, double from, DoctorPatient* patient) {
  server::CameraTrack& track = TrackOf(patient);
  const Intrinsics& intrinsics = *track.camera.intrinsics;
  const Eigen::AngleAxisd turn(degrees * M_PI / 180, Eigen::Vector3d::UnitY());
  ForEachCentre(&track, [&](double share, MarkerObservation* marker) {
    const auto ray = Undistort(intrinsics, marker->centre_px);
    if (share >= from && ray.ok()) {
      Project(intrinsics, turn * ray->homogeneous(), &marker->centre_px);
    }
  });
}

// The images of another moment at every row.
void Reverse(DoctorPatient* patient) {
  Rows& rows = TrackOf(patient).observations;
  for (size_t i = 0; i < rows.size() / 2; ++i) {
    std::swap(rows[i].markers, rows[rows.size() - 1 - i].markers);
  }
}

void ScaleStamps(double factor, server::CameraTrack* track) {
  for (Observation& row : track->observations) {
    row.time_ns = std::llround(factor * static_cast<double>(row.time_ns));
  }
}

void CountRows(server::CameraTrack* track) {
  int64_t number = 0;
  for (Observation& row : track->observations) row.time_ns = number++;
}

void ForEachTrack(DoctorPatient* patient, const std::function<void(server::CameraTrack*)>& change) {
  for (server::CameraTrack& track : patient->input.tracks) change(&track);
}

Disturbance OfClock(const std::string& name, std::vector<FindingKind> causes,
                    std::function<double(double share, double span_s)> added_s) {
  return {name, std::move(causes), "", true, true, [added_s](uint32_t, DoctorPatient* patient) {
            const double span_s = SpanOf(TrackOf(patient).observations).second;
            MoveStamps([&](double share) { return added_s(share, span_s); }, patient);
          }};
}

Disturbance OfUnits(const std::string& name, const std::string& unit, bool all,
                    const std::function<void(server::CameraTrack*)>& change) {
  return {name, {}, unit, true, false, [all, change](uint32_t, DoctorPatient* patient) {
            if (all) {
              ForEachTrack(patient, change);
            } else {
              change(&TrackOf(patient));
            }
          }};
}

Disturbance OfWand(const std::string& name, std::vector<double> positions_m) {
  return {name,
          {FindingKind::kWrongWandLength},
          "",
          false,
          false,
          [positions_m](uint32_t, DoctorPatient* patient) {
            patient->input.target.marker_positions_m = positions_m;
          }};
}

std::vector<Disturbance> ClockDisturbances() {
  const std::vector<FindingKind> jump = {FindingKind::kClockJump};
  const std::vector<FindingKind> drift = {FindingKind::kClockDrift};
  std::vector<Disturbance> list;
  for (const double jump_s : {0.008, 0.03, -0.1}) {
    list.push_back(OfClock(absl::StrFormat("clock jumps %.0f ms", 1e3 * jump_s), jump,
                           [jump_s](double share, double) { return share < 0.5 ? 0 : jump_s; }));
  }
  list.push_back(OfClock("clock jumps 30 ms late", jump,
                         [](double share, double) { return share < 0.8 ? 0 : 0.03; }));
  for (const double drift_s : {0.02, 0.05}) {
    list.push_back(OfClock(absl::StrFormat("quadratic drift %.0f ms", 1e3 * drift_s), drift,
                           [drift_s](double share, double) { return drift_s * share * share; }));
  }
  for (const double rate_ppm : {1000.0, 3228.0}) {
    // Which the solve estimates: nothing is wrong.
    list.push_back(OfClock(
        absl::StrFormat("clock %.0f ppm fast", rate_ppm), {},
        [rate_ppm](double share, double span_s) { return 1e-6 * rate_ppm * share * span_s; }));
  }
  return list;
}

std::vector<Disturbance> UnitDisturbances() {
  const auto scaled = [](double factor) {
    return [factor](server::CameraTrack* track) { ScaleStamps(factor, track); };
  };
  return {OfUnits("stamps in us, one", "microseconds", false, scaled(1e-3)),
          OfUnits("stamps in us, all", "microseconds", true, scaled(1e-3)),
          OfUnits("stamps in ms, one", "milliseconds", false, scaled(1e-6)),
          OfUnits("stamps in ms, all", "milliseconds", true, scaled(1e-6)),
          OfUnits("stamps in s, one", "seconds", false, scaled(1e-9)),
          OfUnits("row numbers, one", "row numbers", false, CountRows),
          OfUnits("row numbers, all", "row numbers", true, CountRows)};
}

std::vector<Disturbance> ImageDisturbances() {
  std::vector<Disturbance> list;
  for (const double sigma_px : {2.0, 5.0, 10.0}) {
    list.push_back(
        {absl::StrFormat("noise of %.0f px", sigma_px),
         {FindingKind::kNoisyCamera},
         "noise",
         true,
         false,
         [sigma_px](uint32_t seed, DoctorPatient* patient) { AddNoise(seed, sigma_px, patient); }});
  }
  list.push_back({"mirrored",
                  {FindingKind::kMirroredImage},
                  "mirrored",
                  true,
                  false,
                  [](uint32_t, DoctorPatient* patient) { Mirror(false, patient); }});
  list.push_back({"upside down",
                  {FindingKind::kMirroredImage},
                  "mirrored",
                  true,
                  false,
                  [](uint32_t, DoctorPatient* patient) { Mirror(true, patient); }});
  list.push_back({"one camera garbage",
                  {FindingKind::kInconsistentCamera},
                  "leave it out",
                  true,
                  false,
                  [](uint32_t seed, DoctorPatient* patient) { Scatter(seed, &TrackOf(patient)); }});
  list.push_back({"one camera reversed",
                  {FindingKind::kInconsistentCamera},
                  "leave it out",
                  true,
                  false,
                  [](uint32_t, DoctorPatient* patient) { Reverse(patient); }});
  list.push_back({"all garbage", {}, "", false, false, [](uint32_t seed, DoctorPatient* patient) {
                    ForEachTrack(patient,
                                 [&](server::CameraTrack* track) { Scatter(seed++, track); });
                  }});
  for (const double degrees : {0.4, 3.0}) {
    list.push_back({absl::StrFormat("turned %.1f degrees half-way", degrees),
                    {FindingKind::kCameraMoved},
                    "",
                    true,
                    false,
                    [degrees](uint32_t, DoctorPatient* patient) { Turn(degrees, 0.5, patient); }});
  }
  return list;
}

void Append(std::vector<Disturbance> from, std::vector<Disturbance>* to) {
  std::ranges::move(from, std::back_inserter(*to));
}

// Facts and consequences, which name no cause.
bool IsSymptom(const Finding& finding) {
  switch (finding.kind) {
    case FindingKind::kEdgeCoverage:
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

// How far the cameras are from their true places, where they have any.
void MeasureErrors(const DoctorPatient& truth, const CalibrationResult& result,
                   Diagnosis* diagnosis) {
  const auto reference =
      std::ranges::find(result.cameras, result.reference_camera, &CalibratedCamera::camera);
  const RigidTransform true_from_rig = truth.cam_from_rig.at(reference->camera);
  double square_m2 = 0, sigma_m2 = 0;
  int count = 0;
  for (const CalibratedCamera& camera : result.cameras) {
    if (camera.camera == result.reference_camera) continue;
    const Eigen::Vector3d found_m =
        (camera.cam_from_rig * reference->cam_from_rig.Inverse()).SourceFromTargetTranslation();
    const Eigen::Vector3d true_m = (truth.cam_from_rig.at(camera.camera) * true_from_rig.Inverse())
                                       .SourceFromTargetTranslation();
    square_m2 += (found_m - true_m).squaredNorm();
    if (camera.uncertainty) {
      sigma_m2 += camera.uncertainty->position_sigma_m.squaredNorm() +
                  std::pow(result.target.scale_sigma_rel, 2) * true_m.squaredNorm();
    }
    ++count;
  }
  diagnosis->error_m = std::sqrt(square_m2 / std::max(1, count));
  diagnosis->error_rel = diagnosis->error_m / truth.distance_m;
  diagnosis->sigmas = std::sqrt(square_m2 / sigma_m2);
  const bool far = !(diagnosis->error_rel <= kAcceptedShare);
  diagnosis->falsely_good =
      diagnosis->grade == QualityGrade::kGood && (far || !(diagnosis->sigmas <= kSigmas));
  diagnosis->falsely_usable = diagnosis->grade == QualityGrade::kUsable && far;
}

void ReadFindings(const Disturbance& disturbance, const DoctorPatient& patient,
                  const CalibrationResult& result, Diagnosis* diagnosis) {
  for (const Finding& finding : result.findings) {
    const bool right_camera = !disturbance.of_one_camera || finding.camera == patient.camera;
    const bool right = right_camera && std::ranges::count(disturbance.causes, finding.kind) > 0;
    const std::string name = absl::StrCat(std::string(NameOf(finding.kind)), ":", finding.camera);
    diagnosis->text.push_back(absl::StrFormat("%s %.4g %s%s: %s", name, finding.value, finding.unit,
                                              finding.candidate ? " (candidate)" : "",
                                              finding.advice));
    diagnosis->named |= right;
    // The mean of an offset that changes.
    const bool mean_offset = finding.kind == FindingKind::kClockOffset &&
                             finding.camera == patient.camera && disturbance.of_clock;
    if (!right && !mean_offset && !IsSymptom(finding) && !patient.known.contains(name)) {
      diagnosis->wrong.push_back(name);
    }
  }
  for (const std::string& reason : result.quality.reasons) {
    diagnosis->text.push_back(absl::StrCat("quality: ", reason));
  }
}

void FindDistance(const CalibrationResult& result, DoctorPatient* patient) {
  const Eigen::Vector3d middle_m = 0.5 * (result.wand_volume->min_m + result.wand_volume->max_m);
  std::vector<double> distances_m;
  for (const CalibratedCamera& camera : result.cameras) {
    distances_m.push_back((camera.cam_from_rig.SourceFromTargetTranslation() - middle_m).norm());
  }
  patient->distance_m = Median(distances_m);
}

}  // namespace

std::vector<Disturbance> AllDisturbances() {
  std::vector<Disturbance> list;
  list.push_back({"clean", {}, "", false, false, [](uint32_t, DoctorPatient*) {}});
  for (const double keep_s : {2.0, 4.0, 8.0}) {
    list.push_back({absl::StrFormat("%.0f s of data", keep_s),
                    {FindingKind::kTooLittleData},
                    "",
                    false,
                    false,
                    [keep_s](uint32_t, DoctorPatient* patient) { Crop(keep_s, patient); }});
  }
  list.push_back(OfWand("wand's end 10 mm off", {0, 0.13, 0.40}));
  list.push_back(OfWand("wand's end -10 mm off", {0, 0.13, 0.38}));
  list.push_back(OfWand("wand's middle 10 mm off", {0, 0.14, 0.39}));
  list.push_back(OfWand("wand's middle 5 mm off", {0, 0.135, 0.39}));
  Append(UnitDisturbances(), &list);
  Append(ClockDisturbances(), &list);
  Append(ImageDisturbances(), &list);
  return list;
}

absl::StatusOr<DoctorPatient> SimulatedPatient(uint32_t seed, int camera_count, double duration_s) {
  SimulationOptions options;
  options.seed = seed;
  options.camera_count = camera_count;
  options.duration_s = duration_s;
  RIGCAL_ASSIGN_OR_RETURN(const SimulatedWorld world,
                          SimulatedWorld::Create(options, server::WandTarget()));
  DoctorPatient patient;
  patient.input = server::InputOf(world);
  patient.camera = world.cameras()[2 % world.cameras().size()].description.camera;
  std::vector<double> distances_m;
  Eigen::Vector3d middle_m = Eigen::Vector3d::Zero();
  constexpr int kMoments = 200;
  for (int i = 0; i < kMoments; ++i) {
    middle_m += world.WandAt(duration_s * i / kMoments).origin_m / kMoments;
  }
  for (size_t c = 0; c < world.cameras().size(); ++c) {
    const SimulatedCamera& camera = world.cameras()[c];
    patient.cam_from_rig[camera.description.camera] = TruePose(world, static_cast<int>(c), 0);
    distances_m.push_back((camera.cam_from_rig.SourceFromTargetTranslation() - middle_m).norm());
  }
  patient.distance_m = Median(distances_m);
  return patient;
}

absl::StatusOr<DoctorPatient> RecordedPatient() {
  const auto data = testing::RecordedDataDirectory();
  if (!data) {
    return absl::NotFoundError(
        "no recordings: put them into ../shared/data or set RIGCAL_TEST_DATA");
  }
  DoctorPatient patient;
  RIGCAL_ASSIGN_OR_RETURN(patient.input, server::RecordedInput(*data));
  patient.camera = "frame_1";
  const server::CalibrationOutcome outcome = server::Calibrate(patient.input, {});
  RIGCAL_RETURN_IF_ERROR(outcome.result.status());
  for (const CalibratedCamera& camera : outcome.result->cameras) {
    patient.cam_from_rig[camera.camera] = camera.cam_from_rig;
  }
  for (const Finding& finding : outcome.result->findings) {
    patient.known.insert(absl::StrCat(std::string(NameOf(finding.kind)), ":", finding.camera));
  }
  FindDistance(*outcome.result, &patient);
  return patient;
}

Diagnosis Diagnose(const Disturbance& disturbance, const DoctorPatient& clean, uint32_t seed) {
  DoctorPatient patient = clean;
  disturbance.apply(seed, &patient);
  Diagnosis diagnosis;
  const server::CalibrationOutcome outcome = server::Calibrate(patient.input, {});
  diagnosis.status = outcome.result.status();
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
