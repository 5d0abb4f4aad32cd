// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "absl/status/status.h"
#include "common/session/stream_key.h"
#include "common/target/observation.h"
#include "server/ingest/ingest.h"
#include "server/store/store.h"

namespace rigcal::server {

inline constexpr size_t kMaxListedFaults = 16;

// What is wrong with the values of a batch.
struct BatchFaults {
  std::vector<RefusedRow> rows;          // all of them, by row; the first fault of each
  std::vector<ObservationFault> listed;  // the first kMaxListedFaults of them
};

// Checks the values of every row against its camera. A row with one of these faults is refused, the
// rest of the batch is kept:
//   implausible_time      the row's time is negative or beyond 2^62 ns
//   time_not_increasing   the row's time is before that of the row ahead (equal is not a fault
//                         here: association treats it)
//   not_finite            a value of a visible marker is NaN or infinite
//   far_outside_image     a centre lies more than one image size outside of the image
//   bad_covariance        not positive definite, an axis below 0.0001 px, or one longer than the
//                         image's diagonal
//   time_delta_too_large  a marker's time is more than 1 s from the row's
//   bad_label_confidence  not within 0 to 1
// Values of invisible markers are not looked at. Allocates nothing where nothing is wrong.
//
// Faults in protocol: INVALID_ARGUMENT that names the field (marker count not the target's, columns
// of wrong sizes, a mask bit beyond the markers, an unknown kind of centre, numbers out of range).
absl::Status ValidateBatch(const StreamContext& context, const ObservationBatch& batch,
                           BatchFaults* faults);

}  // namespace rigcal::server
