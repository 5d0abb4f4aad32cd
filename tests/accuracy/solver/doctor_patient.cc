// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/solver/doctor_patient.h"

#include <algorithm>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/statistics/robust_statistics.h"
#include "common/status/status_macros.h"
#include "tests/accuracy/rig/simulated_tracks.h"
#include "tests/accuracy/solver/recording.h"
#include "tests/server/solve/simulated_input.h"

namespace rigcal::accuracy {
namespace {

void FindDistance(const CalibrationResult& result, DoctorPatient* patient) {
  const Eigen::Vector3d middle_m = 0.5 * (result.wand_volume->min_m + result.wand_volume->max_m);
  std::vector<double> distances_m;
  for (const CalibratedCamera& camera : result.cameras) {
    distances_m.push_back((camera.cam_from_rig.SourceFromTargetTranslation() - middle_m).norm());
  }
  patient->distance_m = Median(distances_m);
}

}  // namespace

server::CameraTrack& TrackOf(DoctorPatient* patient) {
  return *std::ranges::find(patient->input.tracks, patient->camera,
                            [](const server::CameraTrack& track) { return track.camera.camera; });
}

std::pair<int64_t, double> SpanOf(const std::vector<Observation>& rows) {
  const auto [first, last] = std::ranges::minmax_element(rows, {}, &Observation::time_ns);
  return {first->time_ns, 1e-9 * static_cast<double>(last->time_ns - first->time_ns)};
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

absl::StatusOr<DoctorPatient> SimulatedPatient(uint32_t seed, int camera_count, double duration_s) {
  SimulationOptions options;
  options.seed = seed;
  options.camera_count = camera_count;
  options.duration_s = duration_s;
  RIGCAL_ASSIGN_OR_RETURN(const SimulatedWorld world,
                          SimulatedWorld::Create(options, server::WandTarget()));
  DoctorPatient patient;
  patient.world = std::make_shared<const SimulatedWorld>(world);
  patient.input = server::InputOf(world);
  patient.camera = world.cameras()[2 % world.cameras().size()].description.camera;
  patient.other_camera = world.cameras()[1].description.camera;
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
  DoctorPatient patient;
  RIGCAL_ASSIGN_OR_RETURN(patient.input, WandRecording());
  patient.camera = "frame_1";
  patient.other_camera = "frame_2";
  const server::CalibrationOutcome outcome = server::Calibrate(patient.input, {});
  RIGCAL_RETURN_IF_ERROR(outcome.result.status());
  for (const CalibratedCamera& camera : outcome.result->cameras) {
    patient.cam_from_rig[camera.camera] = camera.cam_from_rig;
  }
  CalibrationOptions kept;
  kept.intrinsics = Estimate::kFixed;
  for (const CalibrationOptions& options : {CalibrationOptions{}, kept}) {
    const server::CalibrationOutcome known = server::Calibrate(patient.input, options);
    RIGCAL_RETURN_IF_ERROR(known.result.status());
    for (const Finding& finding : known.result->findings) {
      patient.known.insert(absl::StrCat(std::string(NameOf(finding.kind)), ":", finding.camera));
    }
  }
  FindDistance(*outcome.result, &patient);
  return patient;
}

}  // namespace rigcal::accuracy
