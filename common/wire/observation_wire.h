// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "absl/status/statusor.h"
#include "common/session/observation_batch.h"
#include "common/session/stream_key.h"
#include "rigcal/v1/ingest_service.pb.h"
#include "rigcal/v1/observation.pb.h"
#include "rigcal/v1/refusal.pb.h"

namespace rigcal::wire {

// FromProto checks form, not values: missing ids, unknown enum values, and whatever CheckShape
// finds are INVALID_ARGUMENT with the field's path. Values (NaN, far outside) pass through.
absl::StatusOr<ObservationBatch> FromProto(const v1::ObservationBatch& proto);
void ToProto(const ObservationBatch& batch, v1::ObservationBatch* proto);

v1::StreamKey ToProto(const StreamKey& stream);
absl::StatusOr<StreamKey> FromProto(const v1::StreamKey& proto);
v1::CameraReport ToProto(const CameraReport& report);
absl::StatusOr<CameraReport> FromProto(const v1::CameraReport& proto);
v1::EndOfCapture ToProto(const EndOfCapture& end);
absl::StatusOr<EndOfCapture> FromProto(const v1::EndOfCapture& proto);
v1::BatchAck ToProto(const BatchAck& ack);
absl::StatusOr<BatchAck> FromProto(const v1::BatchAck& proto);
v1::FrameCounts ToProto(const FrameCounts& counts);
FrameCounts FromProto(const v1::FrameCounts& proto);
v1::DetectionCounts ToProto(const DetectionCounts& counts);
DetectionCounts FromProto(const v1::DetectionCounts& proto);
v1::RefusalCount ToProto(const Refusal& refusal);
Refusal FromProto(const v1::RefusalCount& proto);
// A reason that is not known here, as of a newer release, becomes kUnspecified.
RefusalReason FromProto(v1::RefusalReason proto);
v1::RefusalReason ToProto(RefusalReason reason);

}  // namespace rigcal::wire
