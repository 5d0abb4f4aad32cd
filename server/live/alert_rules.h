// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "server/live/alert_book.h"
#include "server/live/live_state.h"

namespace rigcal::server {

// Every kind of alert; docs/live.md explains them.
inline constexpr std::array<std::string_view, 18> kAlertKinds = {
    "agent_lost", "backlog_growing", "camera_moved", "clock_changed",   "clock_jumped",
    "clock_off",  "disk_low",        "dropping",     "estimate_failed", "implausible_labels",
    "lens_wrong", "no_data",         "no_wand",      "not_storing",     "rate_low",
    "refused",    "repair",          "two_wands"};

// What is known of a camera that takes part in a session that captures.
struct CameraFacts {
  std::string camera;
  std::string agent_id;  // empty: delivered by hand
  bool agent_connected = true;
  bool ended = false;          // it has delivered everything
  double silent_s = 0;         // since its last row, or since the start of the session
  double rate_hz = 0;          // over the last two seconds
  double usual_rate_hz = 0;    // the best so far; 0: not known
  double seconds_of_rows = 0;  // since its first row
  bool saw_wand = false;       // ever in this session
  double unseen_waving_s = 0;  // others saw the wand for so long, and it did not, since it last did
  double dark_share = 0;       // of its latest images, that are black or saturated
  double ambiguous_share = 0;  // of its latest images, in which several wands fit
  double jumping_share = 0;    // of its latest rows, in which the whole wand is somewhere else
  double implausible_share = 0;  // of its latest rows, in which the markers are no such wand
  uint64_t backlog_count = 0;
  bool backlog_grows = false;
  uint64_t dropped_lately = 0;  // in the last 10 s
  uint64_t refused_lately = 0;
  uint32_t clock_epoch_count = 1;
  std::string clock_jump;                    // what its samples show; empty: nothing
  std::optional<double> arrival_offset_s;    // how much later its rows come than others'
  std::optional<double> estimated_offset_s;  // by the running estimate
  bool lens_disagrees = false;               // of the running estimate
};

// What is known of a rig and the server.
struct RigFacts {
  bool capturing = false;
  EstimateState estimate = EstimateState::kWaiting;
  std::string estimate_problem = {};
  uint64_t disk_free_bytes = 0;
  uint64_t disk_reserve_bytes = 0;  // below this nothing is taken
  bool disk_known = false;
  std::string store_problem = {};  // why nothing is stored; empty: healthy
};

// What should be said of the camera and of the rig now. Thresholds are in docs/live.md.
std::vector<AlertCondition> CameraConditions(const CameraFacts& facts);
std::vector<AlertCondition> RigConditions(const RigFacts& facts);
// What the monitor has found. Of a rig that is not monitored: nothing.
std::vector<AlertCondition> MonitorConditions(const LiveMonitor& monitor);

}  // namespace rigcal::server
