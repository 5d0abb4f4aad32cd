// SPDX-License-Identifier: Apache-2.0
#include "server/solve/derivation.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "common/status/status_macros.h"
#include "server/solve/evaluate/pose_covariance.h"
#include "server/solve/evaluate/rig_difference.h"

namespace rigcal::server {
namespace {

bool Contains(const std::vector<std::string>& names, const std::string& name) {
  return std::ranges::find(names, name) != names.end();
}

std::vector<std::string> CamerasOf(const CalibrationInput& input) {
  std::set<std::string> names;
  for (const CameraTrack& track : input.tracks) names.insert(track.camera.camera);
  return {names.begin(), names.end()};
}

absl::Status CheckNamed(const char* what, const std::vector<std::string>& asked,
                        const std::vector<std::string>& known) {
  for (const std::string& name : asked) {
    if (Contains(known, name)) continue;
    return absl::InvalidArgumentError(
        absl::StrCat(what, " '", name, "' is none of ", absl::StrJoin(known, ", ")));
  }
  return absl::OkStatus();
}

absl::Status CheckNames(const CalibrationOptions& options, const CalibrationInput& input) {
  const std::vector<std::string> cameras = CamerasOf(input);
  std::set<std::string> sessions;
  for (const CameraTrack& track : input.tracks) sessions.insert(track.session_id);
  RIGCAL_RETURN_IF_ERROR(CheckNamed("camera", options.without_cameras, cameras));
  RIGCAL_RETURN_IF_ERROR(CheckNamed("camera", options.only_cameras, cameras));
  RIGCAL_RETURN_IF_ERROR(CheckNamed("camera", options.fixed_intrinsics, cameras));
  return CheckNamed("session", options.without_sessions, {sessions.begin(), sessions.end()});
}

// Rows outside of the window; seconds after the track's first row.
void CutTime(double from_s, double to_s, CameraTrack* track) {
  if (track->observations.empty() || (from_s <= 0 && to_s <= 0)) return;
  const int64_t first_ns =
      std::ranges::min_element(track->observations, {}, &Observation::time_ns)->time_ns;
  std::erase_if(track->observations, [&](const Observation& row) {
    const double at_s = 1e-9 * static_cast<double>(row.time_ns - first_ns);
    return at_s < from_s || (to_s > 0 && at_s >= to_s);
  });
}

absl::Status TakeIntrinsics(const std::string& from, const CameraIntrinsics& given,
                            CameraTrack* track) {
  const ImageSize &size = track->camera.image_size_px, &other = given.image_size_px;
  if (size != other) {
    return absl::FailedPreconditionError(absl::StrCat(
        "camera ", given.camera, ": its intrinsics ", from, " are for images of ", other.width,
        " x ", other.height, " pixels, and session '", track->session_id, "' has ", size.width,
        " x ", size.height, "; give those of the same resolution and crop"));
  }
  track->camera.intrinsics = given.intrinsics;
  return absl::OkStatus();
}

absl::Status TakeIntrinsics(const CalibrationOptions& options, CalibrationInput* input) {
  for (CameraTrack& track : input->tracks) {
    const std::string& name = track.camera.camera;
    if (options.kind != SolveKind::kFull) {
      const auto known = std::ranges::find(input->parent->cameras, name, &CalibratedCamera::camera);
      if (known != input->parent->cameras.end()) {
        RIGCAL_RETURN_IF_ERROR(TakeIntrinsics(absl::StrCat("in calibration ", options.parent_id),
                                              {name, known->image_size_px, known->intrinsics},
                                              &track));
      }
    }
    const auto given = std::ranges::find(options.given_intrinsics, name, &CameraIntrinsics::camera);
    if (given != options.given_intrinsics.end()) {
      RIGCAL_RETURN_IF_ERROR(TakeIntrinsics("as given", *given, &track));
    }
  }
  return absl::OkStatus();
}

// Of every wand with as many markers.
absl::Status AssumeTarget(const Target& assumed, CalibrationInput* input) {
  const auto take = [&assumed](Target* target) -> absl::Status {
    if (target->kind != assumed.kind || target->marker_count() != assumed.marker_count()) {
      return absl::FailedPreconditionError(absl::StrCat(
          "the assumed target has ", assumed.marker_count(), " markers, that of the sessions ",
          target->marker_count(), ": only its lengths can be assumed to be others"));
    }
    *target = assumed;
    return absl::OkStatus();
  };
  RIGCAL_RETURN_IF_ERROR(take(&input->target));
  for (auto& [session, target] : input->other_targets) RIGCAL_RETURN_IF_ERROR(take(&target));
  return absl::OkStatus();
}

}  // namespace

CalibrationOptions LookOptions(const CalibrationResult& active) {
  CalibrationOptions options;
  options.what_if = true;
  options.intrinsics = Estimate::kFixed;
  for (const CalibratedCamera& camera : active.cameras) {
    options.given_intrinsics.push_back({camera.camera, camera.image_size_px, camera.intrinsics});
  }
  return options;
}

absl::Status ApplyDerivation(const CalibrationOptions& options, CalibrationInput* input) {
  if (options.kind != SolveKind::kFull && !input->parent) {
    return absl::FailedPreconditionError(
        absl::StrCat("calibration ", options.parent_id, " has no result to derive from"));
  }
  RIGCAL_RETURN_IF_ERROR(CheckNames(options, *input));
  std::erase_if(input->tracks, [&options](const CameraTrack& track) {
    return Contains(options.without_cameras, track.camera.camera) ||
           Contains(options.without_sessions, track.session_id);
  });
  for (CameraTrack& track : input->tracks) CutTime(options.from_s, options.to_s, &track);
  if (options.assumed_target) RIGCAL_RETURN_IF_ERROR(AssumeTarget(*options.assumed_target, input));
  return TakeIntrinsics(options, input);
}

std::string ReferenceOf(const CalibrationOptions& options, const CalibrationInput& input) {
  if (options.kind == SolveKind::kFull || !input.parent) return options.reference_camera;
  const std::vector<std::string> cameras = CamerasOf(input);
  const auto is_held = [&](const std::string& name) {
    return Contains(cameras, name) && !Contains(options.only_cameras, name);
  };
  if (is_held(input.parent->reference_camera)) return input.parent->reference_camera;
  for (const CalibratedCamera& camera : input.parent->cameras) {
    if (is_held(camera.camera)) return camera.camera;
  }
  return options.reference_camera;
}

absl::Status CheckOthersStayed(const CalibrationOptions& options, const CalibrationResult& parent,
                               const CalibrationResult& now) {
  RIGCAL_ASSIGN_OR_RETURN(const RigDifference difference, CompareRigs(parent, now));
  const bool is_repair = options.kind == SolveKind::kRepair;
  const std::string what =
      is_repair ? absl::StrCat("no repair of camera ", absl::StrJoin(options.only_cameras, ", "))
                : std::string("no refinement");
  if (!difference.problem.empty()) {
    return absl::FailedPreconditionError(absl::StrCat(what, ": ", difference.problem));
  }
  std::vector<std::string> others;
  for (const CameraDifference& camera : difference.cameras) {
    if (camera.verdict != CameraDifference::Verdict::kMoved ||
        Contains(options.only_cameras, camera.camera)) {
      continue;
    }
    others.push_back(absl::StrFormat("%s by %.2f mm and %.4f degrees (%.0f sigma)", camera.camera,
                                     1e3 * camera.translation_m, camera.rotation_rad * 180 / M_PI,
                                     camera.sigmas));
  }
  if (others.empty()) return absl::OkStatus();
  if (!is_repair) {
    return absl::FailedPreconditionError(absl::StrCat(
        what, ": cameras have moved against calibration ", options.parent_id, ": ",
        absl::StrJoin(others, "; "), ". Solve them again with --only, or calibrate the whole rig"));
  }
  return absl::FailedPreconditionError(
      absl::StrCat(what, " alone: others have moved against calibration ", options.parent_id,
                   ", too: ", absl::StrJoin(others, "; "),
                   ". Name them, too, among the cameras to solve, or calibrate the "
                   "whole rig"));
}

absl::StatusOr<std::shared_ptr<const HeldRig>> HeldRigOf(const CalibrationOptions& options,
                                                         const CalibrationResult* parent,
                                                         const RigIndex& index) {
  if (options.kind != SolveKind::kRepair || parent == nullptr) return nullptr;
  RIGCAL_ASSIGN_OR_RETURN(RigPoses poses, PosesOf(*parent));
  auto held = std::make_shared<HeldRig>();
  std::vector<int> found;  // by camera of the index: in the parent, -1 for none
  int count = 0;
  for (const CameraDescription& camera : index.cameras) {
    const int own = Contains(options.only_cameras, camera.camera) ? -1 : poses.Find(camera.camera);
    found.push_back(own);
    if (own < 0 && !Contains(options.only_cameras, camera.camera)) {
      return absl::FailedPreconditionError(
          absl::StrCat("camera ", camera.camera, " is not in calibration ", options.parent_id,
                       ": name it, too, among the cameras to solve, and it joins the rig"));
    }
    count += own >= 0 ? 1 : 0;
  }
  if (count < 2) {
    return absl::FailedPreconditionError(
        absl::StrCat("only ", count,
                     " of the cameras would keep its place, and a repair needs two: calibrate "
                     "the whole rig instead"));
  }
  // In a frame of its own no pose is exact, and stays so.
  held->keeps_frame = parent->reference_camera.empty();
  if (const int fixed = poses.Find(options.reference_camera); fixed >= 0 && !held->keeps_frame) {
    HoldFixed(static_cast<size_t>(fixed), &poses);
  }
  const auto size = static_cast<Eigen::Index>(6 * found.size());
  held->covariance = Eigen::MatrixXd::Zero(size, size);
  for (size_t c = 0; c < found.size(); ++c) {
    if (found[c] < 0) {
      held->cam_from_rig.push_back(std::nullopt);
      continue;
    }
    held->cam_from_rig.push_back(poses.cam_from_rig[static_cast<size_t>(found[c])]);
    for (size_t d = 0; d < found.size(); ++d) {
      if (found[d] < 0) continue;
      held->covariance.block<6, 6>(static_cast<Eigen::Index>(6 * c),
                                   static_cast<Eigen::Index>(6 * d)) =
          poses.covariance.block<6, 6>(6 * found[c], 6 * found[d]);
    }
  }
  held->scale_sigma_rel = poses.scale_sigma_rel;
  return held;
}

}  // namespace rigcal::server
