// SPDX-License-Identifier: Apache-2.0
#include "server/session/calibration_input.h"

#include <algorithm>
#include <map>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"

namespace rigcal::server {
namespace {

absl::Status CheckCamerasFit(const Session& session, const Session& other) {
  for (const SessionCamera& camera : session.cameras) {
    const CameraDescription& own = camera.description;
    const SessionCamera* same = other.FindCamera(own.camera);
    if (same == nullptr) continue;
    if (own.image_size_px != same->description.image_size_px ||
        own.intrinsics != same->description.intrinsics) {
      return absl::FailedPreconditionError(absl::StrCat(
          "camera '", own.camera, "' has other intrinsics or another image size in ", "session '",
          session.id, "' than in session '", other.id, "'; calibrate them apart"));
    }
  }
  return absl::OkStatus();
}

// Adds the accepted rows of a stored batch to their camera's track; returns how many.
size_t AddRows(const StoredBatch& stored, CameraTrack* track) {
  const ObservationBatch& batch = stored.batch;
  size_t added = 0;
  for (size_t row = 0; row < batch.rows(); ++row) {
    if (!stored.refused_rows.empty() && stored.refused_rows[row]) continue;
    track->observations.push_back(batch.Row(row));
    ++added;
  }
  for (const ClockSample& sample : batch.clock_samples) {
    track->clock_samples.push_back({batch.clock_epoch, sample});
  }
  track->host_alignments.insert(track->host_alignments.end(), batch.host_alignments.begin(),
                                batch.host_alignments.end());
  return added;
}

uint32_t UsableRowCount(const StoredBatch& stored) {
  const auto refused = std::count(stored.refused_rows.begin(), stored.refused_rows.end(), true);
  return static_cast<uint32_t>(stored.batch.rows() - static_cast<size_t>(refused));
}

}  // namespace

absl::Status CheckSessionsFit(absl::Span<const Session> sessions) {
  for (const Session& session : sessions) {
    if (session.state != SessionState::kFinished) {
      return absl::FailedPreconditionError(
          absl::StrCat("session '", session.id, "' has not finished; ",
                       session.state == SessionState::kCreated ? "start it and record a wave first"
                       : session.state == SessionState::kCapturing ? "stop it first"
                                                                   : "wait until it has drained"));
    }
    for (const SessionCamera& camera : session.cameras) {
      if (camera.description.intrinsics) continue;
      return absl::FailedPreconditionError(
          absl::StrCat("camera '", camera.description.camera, "' of session '", session.id,
                       "' has no intrinsics; give its agent a calibration file and record again"));
    }
  }
  for (size_t i = 1; i < sessions.size(); ++i) {
    const Session& first = sessions.front();
    const Session& session = sessions[i];
    const char* different = session.rig != first.rig         ? "rig"
                            : session.target != first.target ? "target"
                                                             : nullptr;
    if (different != nullptr) {
      return absl::FailedPreconditionError(absl::StrCat("sessions '", first.id, "' and '",
                                                        session.id, "' differ in their ", different,
                                                        "; calibrate them apart"));
    }
    // With every earlier one: a camera need not be in the first session.
    for (size_t k = 0; k < i; ++k) RIGCAL_RETURN_IF_ERROR(CheckCamerasFit(session, sessions[k]));
  }
  return absl::OkStatus();
}

absl::StatusOr<CalibrationInput> ReadCalibrationInput(const Store& store,
                                                      absl::Span<const std::string> session_ids,
                                                      size_t max_observations,
                                                      const std::atomic<bool>& cancelled,
                                                      RefusalCounter* refused) {
  CalibrationInput input;
  size_t observation_count = 0;
  for (const std::string& id : session_ids) {
    RIGCAL_ASSIGN_OR_RETURN(const Session session, store.GetSession(id));
    input.target = session.target;
    std::map<std::string, CameraTrack> tracks;
    for (const SessionCamera& camera : session.cameras) {
      CameraTrack& track = tracks[camera.description.camera];
      track.session_id = id;
      track.camera = camera.description;
    }
    RIGCAL_ASSIGN_OR_RETURN(const std::vector<SessionCameraCounts> counts,
                            store.GetSessionCounts(id));
    for (const SessionCameraCounts& camera : counts) {
      for (Refusal refusal : camera.refused) {
        refusal.camera = camera.camera;
        refused->Add(refusal);
      }
    }
    RIGCAL_RETURN_IF_ERROR(store.ReadObservations(id, "", [&](StoredBatch stored) -> absl::Status {
      if (cancelled) return absl::CancelledError("cancelled");
      if (stored.late) {
        refused->Add(stored.batch.stream.camera, RefusalReason::kLate, UsableRowCount(stored),
                     absl::StrCat("arrived after session '", id, "' was finished"));
        return absl::OkStatus();
      }
      const auto track = tracks.find(stored.batch.stream.camera);
      if (track == tracks.end()) {
        return absl::DataLossError(absl::StrCat("session '", id, "' holds observations of camera '",
                                                stored.batch.stream.camera,
                                                "', which it does not have"));
      }
      observation_count += AddRows(stored, &track->second);
      if (observation_count > max_observations) {
        return absl::ResourceExhaustedError(absl::StrCat(
            "the sessions hold more than ", max_observations,
            " observations, which is the limit; "
            "use fewer sessions, or raise limits.max_calibration_observations on the server"));
      }
      return absl::OkStatus();
    }));
    for (auto& [camera, track] : tracks) input.tracks.push_back(std::move(track));
  }
  input.refused = refused->List();
  return input;
}

}  // namespace rigcal::server
