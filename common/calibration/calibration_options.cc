// SPDX-License-Identifier: Apache-2.0
#include "common/calibration/calibration_options.h"

#include <cmath>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/camera/camera_id.h"

namespace rigcal {
namespace {

constexpr double kMaxSigmaPx = 100;
constexpr double kMaxAssociationToleranceS = 10;
constexpr double kMaxDistanceM = 10'000;

void CheckEstimate(const char* name, Estimate value, std::vector<std::string>* faults) {
  if (static_cast<uint8_t>(value) > static_cast<uint8_t>(Estimate::kAuto)) {
    faults->push_back(absl::StrCat(name, " is ", static_cast<int>(value),
                                   ", which is none of default, fixed, refined and auto"));
  }
}

void CheckRange(const char* name, double value, double high, const char* zero_means,
                std::vector<std::string>* faults) {
  if (!(value >= 0 && value <= high)) {
    faults->push_back(absl::StrCat(name, " is ", value, ", it must be 0 (", zero_means,
                                   ") or positive and at most ", high));
  }
}

void CheckDistance(const KnownDistance& known, std::vector<std::string>* faults) {
  for (const auto& [field, name] : {std::pair("known_distance.camera_a", &known.camera_a),
                                    std::pair("known_distance.camera_b", &known.camera_b)}) {
    const absl::Status status = ValidateName(field, *name);
    if (!status.ok()) faults->emplace_back(status.message());
  }
  if (known.camera_a == known.camera_b) {
    faults->push_back(absl::StrCat("known_distance names camera ", known.camera_a,
                                   " twice: a distance is between two cameras"));
  }
  if (!(known.distance_m > 0 && known.distance_m <= kMaxDistanceM)) {
    faults->push_back(absl::StrCat("known_distance.distance_m is ", known.distance_m,
                                   ", it must be positive and at most ", kMaxDistanceM));
  } else if (!(known.sigma_m >= 0 && known.sigma_m < known.distance_m)) {
    faults->push_back(absl::StrCat("known_distance.sigma_m is ", known.sigma_m,
                                   ", it must be 0 (2 mm) or positive and below the distance"));
  }
}

}  // namespace

absl::Status CalibrationOptions::Validate() const {
  std::vector<std::string> faults;
  if (!reference_camera.empty()) {
    const absl::Status name = ValidateName("reference_camera", reference_camera);
    if (!name.ok()) faults.emplace_back(name.message());
  }
  CheckEstimate("intrinsics", intrinsics, &faults);
  CheckEstimate("time_offsets", time_offsets, &faults);
  CheckEstimate("marker_positions", marker_positions, &faults);
  CheckRange("sigma_px", sigma_px, kMaxSigmaPx, "as observed", &faults);
  CheckRange("association_tolerance_s", association_tolerance_s, kMaxAssociationToleranceS,
             "from the cameras' periods", &faults);
  if (known_distance) CheckDistance(*known_distance, &faults);
  if (faults.empty()) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat("calibration options: ", absl::StrJoin(faults, "; ")));
}

}  // namespace rigcal
