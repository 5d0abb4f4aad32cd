// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <mutex>
#include <optional>
#include <utility>
#include <vector>

#include "absl/container/flat_hash_map.h"
#include "common/session/observation_batch.h"
#include "common/session/stream_key.h"
#include "common/target/target.h"
#include "server/store/delivery.h"

namespace rigcal::server {

// A row, as far as the live state needs it: of a target with many markers, evenly chosen ones.
struct ThinnedRow {
  int64_t time_ns = 0;  // the camera's clock
  uint32_t clock_epoch = 0;
  uint32_t marker_count = 0;
  uint32_t visible_mask = 0;
  std::array<float, kMaxWandMarkers> x_px;  // of visible markers
  std::array<float, kMaxWandMarkers> y_px;
};

ThinnedRow ThinnedRowOf(const ObservationBatch& batch, size_t row);

// Says which rows of a stream are kept: at most about 60 a second.
class RowThinner {
 public:
  // Also keeps rows before the last one that was kept, of batches that come late.
  bool Keep(uint32_t clock_epoch, int64_t time_ns);

 private:
  bool any_ = false;  // the next two are of a row
  uint32_t last_epoch_ = 0;
  int64_t last_kept_ns_ = 0;  // the camera's clock
};

// What has become durable of one stream since it was last asked for.
struct Arrivals {
  using Time = std::chrono::steady_clock::time_point;

  Time last_time;              // of the newest delivery
  uint64_t stored_count = 0;   // rows
  uint64_t wand_count = 0;     // of them with a visible marker
  uint64_t refused_count = 0;  // by ingest
  uint64_t dropped_count = 0;  // numbers that will never come
  uint32_t durable_seq = 0;    // everything up to here is stored
  bool has_rows = false;
  int64_t newest_row_ns = 0;                                    // the camera's clock; with has_rows
  uint32_t clock_epoch = 0;                                     // of that row
  bool complete = false;                                        // as of the newest delivery
  std::vector<ThinnedRow> rows;                                 // oldest first
  std::vector<std::pair<uint32_t, ClockSample>> clock_samples;  // with their epochs
  std::vector<HostAlignment> host_alignments;
  std::optional<CameraReport> report;  // the newest
};

// Takes what ingest's writer has made durable, thinned by time; the rest is counted only. Bounded
// by stream: 128 rows, 64 samples and 64 alignments between two calls of Take, and 4096 streams.
// Thread-safe.
class ArrivalInbox {
 public:
  // Costs about a microsecond, and one or two nanoseconds a row.
  void Add(const Delivery& delivery, const AppendOutcome& outcome, Arrivals::Time now);
  // What has come since the last call, by stream.
  std::vector<std::pair<StreamKey, Arrivals>> Take();

 private:
  struct Entry {
    Arrivals arrivals;
    bool is_new = false;  // something came since the last Take
    RowThinner thinner;
  };
  std::mutex mutex_;
  absl::flat_hash_map<StreamKey, Entry> by_stream_;
};

}  // namespace rigcal::server
