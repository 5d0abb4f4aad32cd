// SPDX-License-Identifier: Apache-2.0
#include "common/calibration/calibration_options.h"

#include <utility>

#include "common/status/fault_list.h"
#include "common/status/validate_name.h"

namespace rigcal {
namespace {

constexpr double kMaxSigmaPx = 100;
constexpr double kMaxAssociationToleranceS = 10;
constexpr double kMaxDistanceM = 10'000;
constexpr double kMaxAcceptM = 1'000;

void CheckEstimate(const char* name, Estimate value, FaultList* faults) {
  if (static_cast<uint8_t>(value) > static_cast<uint8_t>(Estimate::kAuto)) {
    faults->Add(name, " is ", static_cast<int>(value),
                ", which is none of default, fixed, refined and auto");
  }
}

void CheckRange(const char* name, double value, double high, const char* zero_means,
                FaultList* faults) {
  if (!(value >= 0 && value <= high)) {
    faults->Add(name, " is ", value, ", it must be 0 (", zero_means, ") or positive and at most ",
                high);
  }
}

void CheckDistance(const KnownDistance& known, FaultList* faults) {
  for (const auto& [field, name] : {std::pair("known_distance.camera_a", &known.camera_a),
                                    std::pair("known_distance.camera_b", &known.camera_b)}) {
    faults->Add(ValidateName(field, *name));
  }
  if (known.camera_a == known.camera_b) {
    faults->Add("known_distance names camera ", known.camera_a,
                " twice: a distance is between two cameras");
  }
  if (!(known.distance_m > 0 && known.distance_m <= kMaxDistanceM)) {
    faults->Add("known_distance.distance_m is ", known.distance_m,
                ", it must be positive and at most ", kMaxDistanceM);
  } else if (!(known.sigma_m >= 0 && known.sigma_m < known.distance_m)) {
    faults->Add("known_distance.sigma_m is ", known.sigma_m,
                ", it must be 0 (2 mm) or positive and below the distance");
  }
}

}  // namespace

absl::Status CalibrationOptions::Validate() const {
  FaultList faults;
  if (!reference_camera.empty()) {
    faults.Add(ValidateName("reference_camera", reference_camera));
  }
  CheckEstimate("intrinsics", intrinsics, &faults);
  CheckEstimate("time_offsets", time_offsets, &faults);
  CheckEstimate("marker_positions", marker_positions, &faults);
  if (static_cast<uint8_t>(trajectory) > static_cast<uint8_t>(TrajectoryChoice::kSpline)) {
    faults.Add("trajectory is not known");
  }
  CheckRange("sigma_px", sigma_px, kMaxSigmaPx, "as observed", &faults);
  CheckRange("association_tolerance_s", association_tolerance_s, kMaxAssociationToleranceS,
             "from the cameras' periods", &faults);
  CheckRange("accept_m", accept_m, kMaxAcceptM, "1 % of the cameras' distance", &faults);
  if (known_distance) CheckDistance(*known_distance, &faults);
  return faults.Result("calibration options: ");
}

}  // namespace rigcal
