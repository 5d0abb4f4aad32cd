// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "common/session/observation_batch.h"
#include "common/session/session.h"
#include "common/status/refusal.h"
#include "server/session/incomplete_session.h"
#include "server/solve/calibrate.h"
#include "server/store/store.h"

namespace rigcal::server {

// Checks that these sessions may go into one calibration. FAILED_PRECONDITION names the session (or
// the two that differ) and the camera: not finished, another rig, other intrinsics or image size
// for the same camera, cameras without intrinsics. Those that the options give count instead, and
// cameras that they leave out need none.
absl::Status CheckSessionsFit(absl::Span<const Session> sessions,
                              const CalibrationOptions& options = {});

// What goes into a calibration, before any row has been read.
struct CalibrationPlan {
  std::vector<std::string> session_ids;
  Target target;                                // of the sessions that other_targets does not name
  std::map<std::string, Target> other_targets;  // by session
  std::vector<CameraTrack> tracks;              // by session, then by camera; no rows yet
  std::vector<uint64_t> row_limits;             // by track: upper limit of the rows to come
  std::vector<RowShare> shares;                 // by track: nothing is counted yet
};

// `refused` gets what agents and ingest refused; damaged rows are counted when they are read. The
// store's errors.
absl::StatusOr<CalibrationPlan> PlanCalibration(const Store& store,
                                                absl::Span<const std::string> session_ids,
                                                RefusalCounter* refused);

// Reads the rows of a plan, batch by batch: `visit` gets the index of the track and what was
// neither refused nor late. `refused` gets late rows as RefusalReason::kLate and damaged ones as
// kDamagedRecord; also when reading fails. The plan's shares get what was read.
//   CANCELLED           `cancelled` has become true
//   RESOURCE_EXHAUSTED  more than `max_observations`
// and the errors of the store and of `visit`.
absl::Status ReadCalibrationRows(
    const Store& store, CalibrationPlan* plan, size_t max_observations,
    const std::atomic<bool>& cancelled, RefusalCounter* refused,
    const std::function<absl::Status(size_t track, const ObservationBatch& batch)>& visit);

// The observations of the sessions as input of the solver, in memory. `shares`: null for none.
absl::StatusOr<CalibrationInput> ReadCalibrationInput(const Store& store,
                                                      absl::Span<const std::string> session_ids,
                                                      size_t max_observations,
                                                      const std::atomic<bool>& cancelled,
                                                      RefusalCounter* refused,
                                                      std::vector<RowShare>* shares = nullptr);

}  // namespace rigcal::server
