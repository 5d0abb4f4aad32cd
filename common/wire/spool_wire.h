// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "common/session/spool_report.h"
#include "common/session/stream_audit.h"
#include "rigcal/v1/spool.pb.h"

// What agents say about their spools, between messages and domain types. Texts that are too long
// are cut, and counts limited.
namespace rigcal::wire {

v1::SpoolReport ToProto(const SpoolReport& report);
// INVALID_ARGUMENT: more reasons than there can be; it begins with `field`.
absl::StatusOr<SpoolReport> FromProto(const v1::SpoolReport& proto, absl::string_view field);

v1::SpoolStatus ToProto(const SpoolStatus& status);
absl::StatusOr<SpoolStatus> FromProto(const v1::SpoolStatus& proto, absl::string_view field);

v1::StreamAudit ToProto(const StreamAudit& audit);

}  // namespace rigcal::wire
