// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/session/session.h"
#include "common/session/stream_key.h"

namespace rigcal::server {

// The counts of a report under the names that the store keeps them by: "frames.lost",
// "detections.wand". Only those that the report has.
std::vector<std::pair<std::string_view, uint64_t>> NamedCounts(const CameraReport& report);
// The same of a spool: "spool.last_seq", "spool.rows", "spool.dropped.spool_full".
inline constexpr std::string_view kSpoolRows = "spool.rows";
std::vector<std::pair<std::string, uint64_t>> NamedCounts(const SpoolReport& report);
// The inverse. False: another name.
bool SetNamedCount(std::string_view name, uint64_t count, SpoolReport* report);
// The inverse; adds to the counts of `camera`. Ignores names of later versions.
void AddNamedCount(std::string_view name, uint64_t count, SessionCameraCounts* camera);

}  // namespace rigcal::server
