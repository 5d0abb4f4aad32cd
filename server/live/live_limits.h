// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <string>

#include "server/live/live_state.h"

namespace rigcal::server {

// The trails of so many cameras fit an answer that comes several times a second; of more cameras
// none is sent.
inline constexpr size_t kMaxCamerasWithTrails = 64;
// The same for the instants of each pair.
inline constexpr size_t kMaxCamerasInOverlap = 256;

// Cuts off what is beyond the limits of live.proto, and long texts, so that an answer stays below
// 1 MiB. A text is never cut in the middle of a UTF-8 character. Of a history the newest figures
// stay; a grid that does not fit goes as a whole, and the volume's figures stay.
void LimitEstimate(LiveEstimate* estimate);
void LimitAgent(LiveAgent* agent);
void LimitMonitor(LiveMonitor* monitor);
void LimitAlertText(std::string* text);

}  // namespace rigcal::server
