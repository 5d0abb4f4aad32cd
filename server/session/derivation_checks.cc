// SPDX-License-Identifier: Apache-2.0
#include "server/session/derivation_checks.h"

#include <algorithm>
#include <map>
#include <set>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/status/status_macros.h"

namespace rigcal::server {
namespace {

using SizesByCamera = std::map<std::string, ImageSize>;

SizesByCamera SizesOf(absl::Span<const Session> sessions) {
  SizesByCamera cameras;
  for (const Session& session : sessions) {
    for (const SessionCamera& camera : session.cameras) {
      cameras[camera.description.camera] = camera.description.image_size_px;
    }
  }
  return cameras;
}

bool IsNamed(const std::vector<std::string>& names, const std::string& name) {
  return std::ranges::find(names, name) != names.end();
}

absl::Status CheckKnown(const char* field, const std::vector<std::string>& names,
                        const SizesByCamera& cameras) {
  for (const std::string& name : names) {
    if (cameras.contains(name)) continue;
    std::vector<std::string> known;
    for (const auto& [camera, size] : cameras) known.push_back(camera);
    return absl::InvalidArgumentError(absl::StrCat("options.", field, ": camera '", name,
                                                   "' is in none of the sessions, which have ",
                                                   absl::StrJoin(known, ", ")));
  }
  return absl::OkStatus();
}

absl::Status CheckSize(const std::string& camera, const std::string& from, const ImageSize& size,
                       const SizesByCamera& cameras) {
  const auto found = cameras.find(camera);
  if (found == cameras.end() || found->second == size) return absl::OkStatus();
  return absl::FailedPreconditionError(
      absl::StrCat("camera ", camera, ": its intrinsics ", from, " are for images of ", size.width,
                   " x ", size.height, " pixels, and the sessions have ", found->second.width,
                   " x ", found->second.height, "; give those of the same resolution and crop"));
}

// A frame or scale takes rows of any two cameras of the parent.
absl::Status CheckFrameSessions(const Calibration& parent, const SizesByCamera& cameras) {
  if (cameras.empty()) return absl::OkStatus();
  std::vector<std::string> known, unknown;
  for (const auto& [camera, size] : cameras) {
    const bool has = std::ranges::find(parent.result->cameras, camera, &CalibratedCamera::camera) !=
                     parent.result->cameras.end();
    (has ? known : unknown).push_back(camera);
  }
  for (const CalibratedCamera& camera : parent.result->cameras) {
    RIGCAL_RETURN_IF_ERROR(CheckSize(camera.camera, absl::StrCat("in calibration ", parent.id),
                                     camera.image_size_px, cameras));
  }
  if (known.size() >= 2) return absl::OkStatus();
  return absl::FailedPreconditionError(
      absl::StrCat("the session has ", known.size(), " of the cameras of calibration ", parent.id,
                   ", and points need two",
                   unknown.empty() ? "" : "; not in it: ", absl::StrJoin(unknown, ", ")));
}

absl::Status CheckParent(const CalibrationOptions& options, const std::string& rig,
                         const Calibration& parent) {
  const std::string name = absl::StrCat("calibration ", parent.id, " cannot be derived from: ");
  if (parent.rig != rig) {
    return absl::FailedPreconditionError(
        absl::StrCat(name, "it is of rig '", parent.rig, "', the sessions are of rig '", rig, "'"));
  }
  if (parent.state != CalibrationState::kSucceeded || !parent.result) {
    return absl::FailedPreconditionError(absl::StrCat(name, WhyNoResult(parent.state)));
  }
  if (options.kind == SolveKind::kFull) return absl::OkStatus();
  if (parent.options.what_if) {
    return absl::FailedPreconditionError(absl::StrCat(name, "it is a what-if"));
  }
  if (parent.result->quality.grade == QualityGrade::kBad) {
    return absl::FailedPreconditionError(
        absl::StrCat(name, "it is graded bad",
                     parent.result->quality.reasons.empty()
                         ? ""
                         : absl::StrCat(" (", parent.result->quality.reasons.front(), ")")));
  }
  return absl::OkStatus();
}

// The cameras that are not solved need their images: by them the frame is found.
absl::Status CheckHeldCameras(const CalibrationOptions& options, const Calibration& parent,
                              const SizesByCamera& cameras) {
  std::vector<std::string> absent;
  for (const CalibratedCamera& camera : parent.result->cameras) {
    RIGCAL_RETURN_IF_ERROR(CheckSize(camera.camera, absl::StrCat("in calibration ", parent.id),
                                     camera.image_size_px, cameras));
    if (!cameras.contains(camera.camera)) absent.push_back(camera.camera);
  }
  if (!absent.empty()) {
    return absl::FailedPreconditionError(
        absl::StrCat("camera ", absl::StrJoin(absent, ", "), " of calibration ", parent.id,
                     " took no part in the sessions; record a few seconds with all of them"));
  }
  if (options.kind != SolveKind::kRepair) return absl::OkStatus();
  std::vector<std::string> unknown;
  for (const auto& [camera, size] : cameras) {
    const bool known = std::ranges::find(parent.result->cameras, camera,
                                         &CalibratedCamera::camera) != parent.result->cameras.end();
    if (!known && !IsNamed(options.only_cameras, camera)) unknown.push_back(camera);
  }
  if (unknown.empty()) return absl::OkStatus();
  return absl::FailedPreconditionError(
      absl::StrCat("camera ", absl::StrJoin(unknown, ", "), " is not in calibration ", parent.id,
                   ": name it, too, among the cameras to solve, and it joins the rig"));
}

}  // namespace

absl::Status CheckDerivation(const CalibrationOptions& options, absl::Span<const Session> sessions,
                             const Calibration* parent) {
  const SizesByCamera cameras = SizesOf(sessions);
  RIGCAL_RETURN_IF_ERROR(CheckKnown("only_cameras", options.only_cameras, cameras));
  RIGCAL_RETURN_IF_ERROR(CheckKnown("fixed_intrinsics", options.fixed_intrinsics, cameras));
  RIGCAL_RETURN_IF_ERROR(CheckKnown("without_cameras", options.without_cameras, cameras));
  for (const CameraIntrinsics& given : options.given_intrinsics) {
    RIGCAL_RETURN_IF_ERROR(CheckSize(given.camera, "as given", given.image_size_px, cameras));
  }
  if (parent == nullptr) return absl::OkStatus();
  const std::string& rig = sessions.empty() ? parent->rig : sessions.front().rig;
  RIGCAL_RETURN_IF_ERROR(CheckParent(options, rig, *parent));
  if (ChangesFrameOnly(options.kind)) return CheckFrameSessions(*parent, cameras);
  return options.kind == SolveKind::kFull ? absl::OkStatus()
                                          : CheckHeldCameras(options, *parent, cameras);
}

std::vector<std::string> HeldBy(const CalibrationOptions& options,
                                absl::Span<const Session> sessions, const Calibration* parent) {
  std::vector<std::string> held;
  if (options.kind == SolveKind::kOrigin) return {"everything but the frame"};
  if (options.kind == SolveKind::kScale) return {"everything but the scale"};
  const bool keeps_intrinsics =
      options.intrinsics == Estimate::kFixed ||
      (options.intrinsics == Estimate::kDefault && options.kind != SolveKind::kFull);
  // A refinement goes on with the lenses that its parent has refined.
  const auto is_refined_by_parent = [&](const std::string& camera) {
    if (options.kind != SolveKind::kRefine || options.intrinsics != Estimate::kDefault ||
        parent == nullptr || !parent->result) {
      return false;
    }
    const auto known =
        std::ranges::find(parent->result->cameras, camera, &CalibratedCamera::camera);
    return known != parent->result->cameras.end() && known->intrinsics_refined;
  };
  for (const auto& [camera, size] : SizesOf(sessions)) {
    if (IsNamed(options.without_cameras, camera)) continue;
    const bool stays = options.kind == SolveKind::kRepair && !IsNamed(options.only_cameras, camera);
    if (stays) held.push_back(absl::StrCat("pose of ", camera));
    if (stays || (keeps_intrinsics && !is_refined_by_parent(camera)) ||
        IsNamed(options.fixed_intrinsics, camera)) {
      held.push_back(absl::StrCat("intrinsics of ", camera));
    }
  }
  if (options.time_offsets == Estimate::kFixed) held.emplace_back("time offsets");
  if (options.marker_positions == Estimate::kFixed) held.emplace_back("marker positions");
  return held;
}

}  // namespace rigcal::server
