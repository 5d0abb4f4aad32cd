// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "absl/status/statusor.h"
#include "rigcal/v1/ingest_service.pb.h"
#include "server/ingest/ingest.h"

namespace rigcal::server {

// One delivery each. INVALID_ARGUMENT names the field; also for a batch of more than `max_rows`.
absl::StatusOr<Delivery> ParseDelivery(const v1::ObservationBatch& proto, uint32_t max_rows);
absl::StatusOr<Delivery> ParseDelivery(const v1::EndOfCapture& proto);
absl::StatusOr<Delivery> ParseDelivery(const v1::CameraReport& proto);
// Both parts in one delivery; they must be of the same stream.
absl::StatusOr<Delivery> ParseDelivery(const v1::UploadBatchRequest& proto, uint32_t max_rows);

}  // namespace rigcal::server
