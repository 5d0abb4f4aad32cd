// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/calibration/calibration.h"
#include "common/geometry/rigid_transform.h"
#include "common/simulation/world/simulated_world.h"
#include "server/solve/calibrate.h"

namespace rigcal::accuracy {

// A recording with what a perfect calibration of it would give.
struct DoctorPatient {
  server::CalibrationInput input;
  std::string camera;        // the one to disturb
  std::string other_camera;  // the second one, where two are
  // The true poses, in the frame of the camera with the lowest name.
  std::map<std::string, RigidTransform> cam_from_rig;
  std::set<std::string> known;  // "kind:camera" of what is found without a disturbance, and true
  // What was simulated; null: a recording.
  std::shared_ptr<const SimulatedWorld> world;
  double distance_m = 0;  // of the cameras from the middle of the waved volume, median
};

// One kind of disturbance, and which findings would name it.
struct Disturbance {
  std::string name;
  std::vector<FindingKind> causes;  // any of these is right; none: nothing is wrong
  std::string message;              // of a refusal that names the cause; empty: none does
  bool of_one_camera = true;        // and finding or message must name it
  bool of_clock = false;            // of that camera: an offset of it is no wrong cause
  std::function<void(uint32_t seed, DoctorPatient* patient)> apply;
  CalibrationOptions options = {};
  bool of_simulation = false;  // cannot be put into a recording
  bool all_causes = false;     // each of them must be named: several things are wrong
};

// The first one is the clean recording.
std::vector<Disturbance> AllDisturbances();

// A simulated rig of seed `seed`; INTERNAL or INVALID_ARGUMENT from the simulation.
absl::StatusOr<DoctorPatient> SimulatedPatient(uint32_t seed, int camera_count, double duration_s);
// The real recording; its ground truth is its own calibration. Errors of reading it, and of that.
absl::StatusOr<DoctorPatient> RecordedPatient();

// What a calibration with all defaults said.
struct Diagnosis {
  absl::Status status;
  QualityGrade grade = QualityGrade::kNotEvaluated;  // of a result
  bool named = false;                                // the right cause
  std::vector<std::string> wrong;                    // causes named that are not there
  std::set<FindingKind> kinds;                       // of the causes named
  double cpu_s = 0;                                  // of its thread
  double error_m = 0;    // of the camera positions, RMS, against ground truth
  double error_rel = 0;  // by the patient's distance
  double sigmas = 0;     // of the shape by its stated sigma, or of the scale by its own: the larger
  // Graded good with an error above 1 % of the distance, or above three stated sigmas.
  bool falsely_good = false;
  bool falsely_usable = false;    // graded usable with more than 1 %
  std::vector<std::string> text;  // findings or the message
};

Diagnosis Diagnose(const Disturbance& disturbance, const DoctorPatient& clean, uint32_t seed);

}  // namespace rigcal::accuracy
