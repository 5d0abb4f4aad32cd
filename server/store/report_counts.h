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

// What a report counts, by the names the database keeps it under: "frames.lost",
// "detections.wand". Nothing of what the report does not speak of.
std::vector<std::pair<std::string_view, uint64_t>> NamedCounts(const CameraReport& report);
// The way back; adds to what is there. A name of a later version is left out.
void AddNamedCount(std::string_view name, uint64_t count, SessionCameraCounts* camera);

}  // namespace rigcal::server
