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
constexpr double kMaxWindowS = 1e6;

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

void CheckCameras(const char* name, const std::vector<std::string>& cameras, FaultList* faults) {
  for (const std::string& camera : cameras) faults->Add(ValidateName(name, camera));
}

const char* NameOf(SolveKind kind) {
  switch (kind) {
    case SolveKind::kRefine:
      return "a refinement";
    case SolveKind::kRepair:
      return "a repair";
    case SolveKind::kOrigin:
      return "a new origin";
    default:
      return "a new scale";
  }
}

// Frame and scale.
void CheckFrame(const CalibrationOptions& options, FaultList* faults) {
  if ((options.kind == SolveKind::kOrigin) != options.origin.has_value()) {
    faults->Add(options.origin ? "origin goes with KIND_ORIGIN"
                               : "origin is not set: say what the frame is made from");
  }
  if ((options.kind == SolveKind::kScale) != options.scale.has_value()) {
    faults->Add(options.scale ? "scale goes with KIND_SCALE"
                              : "scale is not set: say which lengths are known");
  }
  if (options.origin) faults->Add(options.origin->Validate());
  if (options.scale) faults->Add(options.scale->Validate());
  if (static_cast<uint8_t>(options.frame) > static_cast<uint8_t>(FrameChoice::kKeepIfPossible)) {
    faults->Add("frame is not known");
  }
  if (options.frame != FrameChoice::kDefault && options.kind != SolveKind::kFull) {
    faults->Add("frame is for a full solve: every other kind keeps that of its parent");
  }
}

void CheckDerivation(const CalibrationOptions& options, FaultList* faults) {
  if (options.kind != SolveKind::kFull && options.parent_id.empty()) {
    faults->Add("parent_id is empty: ", NameOf(options.kind),
                " needs the calibration that it derives from");
  }
  if ((options.kind == SolveKind::kRepair) == options.only_cameras.empty()) {
    faults->Add(options.only_cameras.empty()
                    ? "only_cameras is empty: a repair names the cameras to solve"
                    : "only_cameras goes with a repair");
  }
  CheckCameras("only_cameras", options.only_cameras, faults);
  CheckCameras("fixed_intrinsics", options.fixed_intrinsics, faults);
  CheckCameras("without_cameras", options.without_cameras, faults);
  for (const CameraIntrinsics& given : options.given_intrinsics) {
    const absl::Status status = ValidateName("given_intrinsics.camera", given.camera);
    faults->Add(status.ok() ? given.intrinsics.Validate(given.image_size_px) : status);
  }
}

void CheckWhatIf(const CalibrationOptions& options, FaultList* faults) {
  if (!(options.from_s >= 0 && options.from_s <= kMaxWindowS) ||
      !(options.to_s >= 0 && options.to_s <= kMaxWindowS) ||
      (options.to_s > 0 && !(options.to_s > options.from_s))) {
    faults->Add("from_s is ", options.from_s, " and to_s ", options.to_s,
                "; they are seconds, and to_s is 0 (the end) or after from_s");
  }
  if (options.assumed_target) faults->Add(options.assumed_target->Validate());
  if (options.what_if) return;
  const bool is_repair = options.kind == SolveKind::kRepair;
  for (const auto& [name, given] :
       {std::pair("without_cameras", !options.without_cameras.empty()),
        std::pair("without_sessions", !options.without_sessions.empty()),
        std::pair("from_s", options.from_s != 0 && !is_repair),
        std::pair("to_s", options.to_s != 0 && !is_repair),
        std::pair("assumed_target", options.assumed_target.has_value())}) {
    if (given) faults->Add(name, " is for a what-if: set what_if");
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
  if (static_cast<uint8_t>(kind) > static_cast<uint8_t>(SolveKind::kScale)) {
    faults.Add("kind is not known");
  }
  CheckDerivation(*this, &faults);
  CheckFrame(*this, &faults);
  CheckWhatIf(*this, &faults);
  return faults.Result("calibration options: ");
}

}  // namespace rigcal
