// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "rigcal/v1/replication_service.pb.h"
#include "server/replica/primary_link.h"
#include "server/store/replica.h"

namespace rigcal::server {

// Rows of one table as a message, with their checksum; and back. DATA_LOSS: the checksum differs.
v1::ReadRecordResponse ToMessage(ReplicaRows rows);
absl::StatusOr<ReplicaRows> RowsOf(v1::ReadRecordResponse message);

v1::StandbyPosition ToMessage(const StreamProgress& progress);
absl::StatusOr<StreamProgress> ProgressOf(const v1::StandbyPosition& message);

v1::ReplicaRecord ToMessage(const ReplicaRecord& record);
absl::StatusOr<ReplicaRecord> RecordOf(const v1::ReplicaRecord& message);

v1::ReplicaStream ToMessage(const ReplicaStream& stream);
ReplicaStream StreamOf(const v1::ReplicaStream& message);

v1::ReadRecordRequest::Kind ToMessage(ReplicaKind kind);
// INVALID_ARGUMENT: none that is known here.
absl::StatusOr<ReplicaKind> KindOf(v1::ReadRecordRequest::Kind kind);

}  // namespace rigcal::server
