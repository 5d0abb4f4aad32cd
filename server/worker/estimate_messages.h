// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/session/observation_batch.h"
#include "rigcal/worker/v1/estimate.pb.h"
#include "server/solve/running/running_estimate.h"
#include "server/worker/message_stream.h"

namespace rigcal::server {

// Writes the input of a running estimate for a worker, in the order Begin, AddRows, End. Errors:
// those of MessageWriter.
class EstimateInputWriter {
 public:
  explicit EstimateInputWriter(int descriptor) : writer_(descriptor) {}

  // `tracks` without rows.
  absl::Status Begin(const Target& target, const std::vector<CameraTrack>& tracks,
                     double data_share, const EstimateStart& start);
  absl::Status AddRows(size_t track, const ObservationBatch& batch);
  absl::Status End();

 private:
  MessageWriter writer_;
  worker::v1::EstimateInput message_;
};

// Reads what EstimateInputWriter wrote, to the end. DATA_LOSS: it was cut off, or is something
// else.
absl::StatusOr<RunningInput> ReadEstimateInput(int descriptor);

worker::v1::EstimateOutput ToProto(const RunningOutcome& outcome);
// INVALID_ARGUMENT: not what ToProto makes.
absl::StatusOr<RunningOutcome> FromProto(const worker::v1::EstimateOutput& proto);

}  // namespace rigcal::server
