// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <utility>

#include "absl/status/status.h"
#include "common/session/observation_batch.h"
#include "common/session/session.h"
#include "server/live/coverage_grid.h"
#include "server/live/overlap_counter.h"
#include "server/live/row_spacing.h"
#include "server/store/store.h"

namespace rigcal::server {

// Which rows a session that captures has from before.
struct EarlierWaves {
  Session session;
  // Its own, stored before a restart of the server: the last number of each stream, by camera and
  // stream epoch.
  std::map<std::pair<std::string, uint32_t>, uint32_t> own_until = {};
  int64_t now_utc_ns = 0;
};

// What they count for. A camera of the session that has none of them has no coverage here.
struct EarlierCounts {
  std::string session_id;
  std::map<std::string, CoverageGrid> coverage;  // by camera
  OverlapCounter overlap{0};                     // in the order of the session's cameras
  std::map<std::string, RowSpacing> spacing;     // by camera, of its newest rows
};

// Gets rows of `camera`, which is that of the session they belong to, without refused ones.
using EarlierRowTap =
    std::function<void(const SessionCamera& camera, const ObservationBatch& batch)>;

// Reads the rows of all sessions that this one continues, directly or not, and its own. Those of a
// camera that has another image size or other intrinsics now are left out, and so are late ones;
// what cannot be read is left out too, with a line in the log. Common instants are counted where
// clocks have samples or a common time base. CANCELLED: `cancelled` has become true.
absl::StatusOr<EarlierCounts> ReadEarlierWaves(const Store& store, const EarlierWaves& waves,
                                               const std::atomic<bool>& cancelled,
                                               const EarlierRowTap& tap);

}  // namespace rigcal::server
