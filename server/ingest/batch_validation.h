// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "common/camera/intrinsics.h"
#include "common/session/observation_batch.h"
#include "server/store/delivery.h"

namespace rigcal::server {

// The camera and target that a stream's values are checked against.
struct StreamContext {
  ImageSize image_size_px;
  int marker_count = 0;
};

// Checks the values of every row against its camera, and returns the rows to refuse, each with its
// first fault; the rest of the batch is kept:
//   implausible_time      the row's time is negative or beyond 2^62 ns
//   time_not_increasing   the row's time is before that of the previous row (equal is not a fault
//                         here: association treats it)
//   not_finite            a value of a visible marker is NaN or infinite
//   far_outside_image     a centre lies more than one image size outside of the image
//   bad_covariance        not positive definite, an axis below 0.0001 px, or one longer than the
//                         image's diagonal
//   time_delta_too_large  a marker's time is more than 1 s from the row's
//   bad_label_confidence  not within 0 to 1
// Values of invisible markers are not looked at. Allocates nothing where nothing is wrong.
//
// The batch has passed CheckShape. INVALID_ARGUMENT: its marker count is not the target's.
absl::StatusOr<std::vector<RefusedRow>> ValidateBatch(const StreamContext& context,
                                                      const ObservationBatch& batch);

}  // namespace rigcal::server
