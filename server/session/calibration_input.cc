// SPDX-License-Identifier: Apache-2.0
#include "server/session/calibration_input.h"

#include <algorithm>
#include <map>
#include <string_view>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/status/status_macros.h"

namespace rigcal::server {
namespace {

bool IsGiven(const CalibrationOptions& options, const std::string& camera) {
  return std::ranges::find(options.given_intrinsics, camera, &CameraIntrinsics::camera) !=
         options.given_intrinsics.end();
}

absl::Status CheckCamerasFit(const Session& session, const Session& other,
                             const CalibrationOptions& options) {
  for (const SessionCamera& camera : session.cameras) {
    const CameraDescription& own = camera.description;
    const SessionCamera* same = other.FindCamera(own.camera);
    if (same == nullptr) continue;
    if (own.image_size_px != same->description.image_size_px ||
        (own.intrinsics != same->description.intrinsics && !IsGiven(options, own.camera))) {
      return absl::FailedPreconditionError(absl::StrCat(
          "camera '", own.camera, "' has other intrinsics or another image size in ", "session '",
          session.id, "' than in session '", other.id, "'; calibrate them apart"));
    }
  }
  return absl::OkStatus();
}

absl::Status CheckLenses(const Session& session, const CalibrationOptions& options) {
  std::vector<std::string> without;
  for (const SessionCamera& camera : session.cameras) {
    const std::string& name = camera.description.camera;
    if (camera.description.intrinsics || IsGiven(options, name) ||
        std::ranges::find(options.without_cameras, name) != options.without_cameras.end()) {
      continue;
    }
    without.push_back(absl::StrCat("'", name, "'"));
  }
  if (without.empty()) return absl::OkStatus();
  const bool one = without.size() == 1;
  const std::string who =
      absl::StrCat(one ? "camera " : "cameras ", absl::StrJoin(without, ", "), " of session '",
                   session.id, "' ", one ? "has" : "have", " no lens (intrinsics)");
  if (session.target.board.empty()) {
    return absl::FailedPreconditionError(absl::StrCat(
        who, "; make ", one ? "one" : "them", " from a printed board (page Lens of the dashboard, ",
        "or `rigcal-agent intrinsics`), give ", one ? "its agent the file" : "the agents the files",
        " with calibration=FILE and record again; or calibrate with those of an earlier ",
        "calibration (--prior)"));
  }
  return absl::FailedPreconditionError(
      absl::StrCat(who, "; page Lens of the dashboard makes ", one ? "one" : "them",
                   " from this session, and `rigcal lens use ", session.id, "` calibrates with ",
                   one ? "it" : "them"));
}

uint32_t UsableRowCount(const StoredBatch& stored) {
  const auto refused = std::count(stored.refused_rows.begin(), stored.refused_rows.end(), true);
  return static_cast<uint32_t>(stored.batch.rows() - static_cast<size_t>(refused));
}

}  // namespace

absl::Status CheckSessionsFit(absl::Span<const Session> sessions,
                              const CalibrationOptions& options) {
  for (const Session& session : sessions) {
    if (session.state != SessionState::kFinished) {
      return absl::FailedPreconditionError(
          absl::StrCat("session '", session.id, "' has not finished; ",
                       session.state == SessionState::kCreated ? "start it and record a wave first"
                       : session.state == SessionState::kCapturing ? "stop it first"
                                                                   : "wait until it has drained"));
    }
    if (session.observations_delete_utc_ns != 0) {
      return absl::FailedPreconditionError(
          absl::StrCat("the observations of session '", session.id,
                       "' were deleted, by `rigcal session prune` or by the server's retention ",
                       "([retention] in its configuration); record again, or restore a backup"));
    }
    RIGCAL_RETURN_IF_ERROR(CheckLenses(session, options));
  }
  for (size_t i = 1; i < sessions.size(); ++i) {
    const Session& first = sessions.front();
    const Session& session = sessions[i];
    if (session.rig != first.rig) {
      return absl::FailedPreconditionError(absl::StrCat("sessions '", first.id, "' and '",
                                                        session.id, "' differ in their rig; ",
                                                        "calibrate them apart"));
    }
    // With every earlier one: a camera need not be in the first session.
    for (size_t k = 0; k < i; ++k) {
      RIGCAL_RETURN_IF_ERROR(CheckCamerasFit(session, sessions[k], options));
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<CalibrationPlan> PlanCalibration(const Store& store,
                                                absl::Span<const std::string> session_ids,
                                                RefusalCounter* refused) {
  CalibrationPlan plan;
  plan.session_ids.assign(session_ids.begin(), session_ids.end());
  for (const std::string& id : session_ids) {
    RIGCAL_ASSIGN_OR_RETURN(const Session session, store.GetSession(id));
    if (id == session_ids.front()) plan.target = session.target;
    if (session.target != plan.target) plan.other_targets[id] = session.target;
    std::map<std::string, CameraTrack> tracks;
    for (const SessionCamera& camera : session.cameras) {
      CameraTrack& track = tracks[camera.description.camera];
      track.session_id = id;
      track.camera = camera.description;
    }
    RIGCAL_ASSIGN_OR_RETURN(const std::vector<SessionCameraCounts> counts,
                            store.GetSessionCounts(id));
    std::map<std::string_view, const SessionCameraCounts*> by_camera;
    for (const SessionCameraCounts& camera : counts) {
      by_camera[camera.camera] = &camera;
      for (Refusal refusal : camera.refused) {
        // Counted below, as they are met.
        if (refusal.reason == RefusalReason::kDamagedRecord) continue;
        refusal.camera = camera.camera;
        refused->Add(refusal);
      }
    }
    for (auto& [camera, track] : tracks) {
      const auto found = by_camera.find(camera);
      const SessionCameraCounts* const known = found == by_camera.end() ? nullptr : found->second;
      plan.row_limits.push_back(known == nullptr ? 0 : known->observation_count);
      plan.shares.emplace_back(id, camera, known);
      plan.tracks.push_back(std::move(track));
    }
  }
  return plan;
}

absl::Status ReadCalibrationRows(
    const Store& store, CalibrationPlan* plan, size_t max_observations,
    const std::atomic<bool>& cancelled, RefusalCounter* refused,
    const std::function<absl::Status(size_t track, const ObservationBatch& batch)>& visit) {
  std::map<std::pair<std::string_view, std::string_view>, size_t> tracks;
  for (size_t t = 0; t < plan->tracks.size(); ++t) {
    tracks[{plan->tracks[t].session_id, plan->tracks[t].camera.camera}] = t;
  }
  size_t observation_count = 0;
  for (const std::string& id : plan->session_ids) {
    const auto take = [&](StoredBatch stored) -> absl::Status {
      if (cancelled) return absl::CancelledError("cancelled");
      const std::string camera = stored.batch.stream.camera;
      const auto track = tracks.find({id, camera});
      if (track != tracks.end()) plan->shares[track->second].Add(stored);
      if (stored.damaged_rows > 0) {
        refused->Add(camera, RefusalReason::kDamagedRecord, stored.damaged_rows, stored.damage);
        return absl::OkStatus();
      }
      if (stored.late) {
        refused->Add(camera, RefusalReason::kLate, UsableRowCount(stored),
                     absl::StrCat("arrived after session '", id, "' was finished"));
        return absl::OkStatus();
      }
      if (track == tracks.end()) {
        return absl::DataLossError(absl::StrCat("session '", id, "' holds observations of camera '",
                                                camera, "', which it does not have"));
      }
      observation_count += UsableRowCount(stored);
      if (observation_count > max_observations) {
        return absl::ResourceExhaustedError(absl::StrCat(
            "the sessions hold more than ", max_observations,
            " observations, which is the limit; "
            "use fewer sessions, or raise limits.max_calibration_observations on the server"));
      }
      for (const ObservationBatch& batch : AcceptedRows(std::move(stored))) {
        RIGCAL_RETURN_IF_ERROR(visit(track->second, batch));
      }
      return absl::OkStatus();
    };
    RIGCAL_RETURN_IF_ERROR(store.ReadObservations(id, "", take));
  }
  return absl::OkStatus();
}

absl::StatusOr<CalibrationInput> ReadCalibrationInput(
    const Store& store, absl::Span<const std::string> session_ids, size_t max_observations,
    const std::atomic<bool>& cancelled, RefusalCounter* refused, std::vector<RowShare>* shares) {
  RIGCAL_ASSIGN_OR_RETURN(CalibrationPlan plan, PlanCalibration(store, session_ids, refused));
  std::vector<CameraTrack> tracks = plan.tracks;
  RIGCAL_RETURN_IF_ERROR(
      ReadCalibrationRows(store, &plan, max_observations, cancelled, refused,
                          [&tracks](size_t track, const ObservationBatch& batch) {
                            AddRows(batch, &tracks[track]);
                            return absl::OkStatus();
                          }));
  if (shares != nullptr) *shares = std::move(plan.shares);
  return CalibrationInput{plan.target, std::move(tracks), refused->List(), plan.other_targets};
}

}  // namespace rigcal::server
