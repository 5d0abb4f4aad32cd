// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/calibration/calibration_options.h"
#include "common/calibration/calibration_record.h"
#include "common/session/observation_batch.h"
#include "common/status/refusal.h"
#include "rigcal/worker/v1/solve.pb.h"
#include "server/solve/calibrate.h"
#include "server/worker/message_stream.h"

namespace rigcal::server {

// Writes the input of a solve for a worker, in the order Begin, AddRows, End. Errors: those of
// MessageWriter.
class SolveInputWriter {
 public:
  explicit SolveInputWriter(int descriptor) : writer_(descriptor) {}

  // `tracks` without rows; `row_limits` by track: upper limits of the rows to follow.
  // `other_targets`: of the sessions whose target is another one. `parent`: see
  // CalibrationOptions; null for none.
  absl::Status Begin(const Target& target, const CalibrationOptions& options,
                     const std::vector<CameraTrack>& tracks,
                     const std::vector<uint64_t>& row_limits,
                     const std::map<std::string, Target>& other_targets = {},
                     const Calibration* parent = nullptr);
  // Rows that nobody refused.
  absl::Status AddRows(size_t track, const ObservationBatch& batch);
  absl::Status End(const std::vector<Refusal>& refused);

 private:
  MessageWriter writer_;
  worker::v1::SolveInput message_;
};

struct SolveInput {
  CalibrationInput input;
  CalibrationOptions options;
};

// Reads what SolveInputWriter wrote, to the end. DATA_LOSS: it was cut off, or is something else.
absl::StatusOr<SolveInput> ReadSolveInput(int descriptor);

}  // namespace rigcal::server
