// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "absl/status/statusor.h"
#include "common/session/agent.h"
#include "common/session/capture_command.h"
#include "rigcal/v1/agent_service.pb.h"
#include "rigcal/v1/ingest_service.pb.h"

namespace rigcal::wire {

// FAILED_PRECONDITION: the protocol version. INVALID_ARGUMENT names the field.
absl::StatusOr<AgentHello> FromProto(const v1::AgentHello& proto);
v1::Agent ToProto(const AgentRecord& agent);

v1::StreamPosition ToProto(const StreamPosition& position);
v1::StartCapture ToProto(const StartCaptureCommand& command);

}  // namespace rigcal::wire
