// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "absl/status/statusor.h"
#include "common/session/stream_key.h"
#include "rigcal/v1/agent.pb.h"
#include "rigcal/v1/status.pb.h"
#include "server/ingest/ingest.h"
#include "server/session/agent_directory.h"
#include "server/session/agent_link.h"

namespace rigcal::server {

struct Hello {
  AgentRecord agent;
  std::vector<StreamKey> pending;
};

// FAILED_PRECONDITION: version. INVALID_ARGUMENT: names the field.
absl::StatusOr<Hello> ParseHello(const v1::AgentHello& proto);

// One delivery each. INVALID_ARGUMENT names the field; also for a batch of more than `max_rows`.
absl::StatusOr<Delivery> ParseDelivery(const v1::ObservationBatch& proto, uint32_t max_rows);
absl::StatusOr<Delivery> ParseDelivery(const v1::EndOfCapture& proto);
absl::StatusOr<Delivery> ParseDelivery(const v1::CameraReport& proto);
// Both parts in one delivery; they must be of the same stream.
absl::StatusOr<Delivery> ParseDelivery(const v1::UploadBatchRequest& proto, uint32_t max_rows);

v1::StreamPosition ToProto(const StreamPosition& position);
v1::StartCapture ToProto(const StartCaptureCommand& command);
v1::Agent ToProto(const AgentRecord& agent);

}  // namespace rigcal::server
