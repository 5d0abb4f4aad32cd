// SPDX-License-Identifier: Apache-2.0
#include "server/live/arrivals.h"

#include <algorithm>
#include <utility>

namespace rigcal::server {
namespace {

// At most about 60 rows a second and camera.
constexpr int64_t kSpacingNs = 16'000'000;
constexpr size_t kMaxArrivedRows = 128;
constexpr size_t kMaxSamples = 64;
constexpr size_t kMaxNotedStreams = 4096;

}  // namespace

ThinnedRow ThinnedRowOf(const ObservationBatch& batch, size_t row) {
  ThinnedRow thinned;
  thinned.time_ns = batch.time_ns[row];
  thinned.clock_epoch = batch.clock_epoch;
  thinned.marker_count = std::min(batch.marker_count, uint32_t{kMaxWandMarkers});
  const size_t first = row * batch.marker_count;
  for (uint32_t m = 0; m < thinned.marker_count; ++m) {
    const uint32_t from = m * batch.marker_count / thinned.marker_count;
    thinned.visible_mask |= uint32_t{batch.IsVisible(row, from)} << m;
    thinned.x_px[m] = batch.x_px[first + from];
    thinned.y_px[m] = batch.y_px[first + from];
  }
  return thinned;
}

bool RowThinner::Keep(uint32_t clock_epoch, int64_t time_ns) {
  if (any_ && last_epoch_ == clock_epoch && time_ns >= last_kept_ns_ &&
      time_ns - last_kept_ns_ < kSpacingNs) {
    return false;
  }
  any_ = true;
  last_epoch_ = clock_epoch;
  last_kept_ns_ = time_ns;
  return true;
}

void ArrivalInbox::Add(const Delivery& delivery, const AppendOutcome& outcome, Arrivals::Time now) {
  const ObservationBatch& batch = delivery.batch;
  const size_t count = batch.rows();
  // What a stream had already comes first in a batch that has something new.
  const size_t stored = std::min<size_t>(outcome.stored_rows, count);
  const size_t first_new = count - std::min<size_t>(stored + outcome.refused_rows, count);
  const auto is_refused = [&](size_t row) {
    return !delivery.refused_rows.empty() &&
           std::ranges::find(delivery.refused_rows, row, &RefusedRow::row) !=
               delivery.refused_rows.end();
  };
  uint64_t wand_count = 0;
  for (size_t row = first_new; row < count; ++row) wand_count += batch.visible_mask[row] != 0;
  for (const RefusedRow& refused : delivery.refused_rows) {
    if (refused.row >= first_new && refused.row < count) {
      wand_count -= batch.visible_mask[refused.row] != 0;
    }
  }

  const std::lock_guard lock(mutex_);
  auto found = by_stream_.find(batch.stream);
  if (found == by_stream_.end()) {
    if (by_stream_.size() >= kMaxNotedStreams) {
      absl::erase_if(by_stream_, [](const auto& item) { return !item.second.is_new; });
      if (by_stream_.size() >= kMaxNotedStreams) return;
    }
    found = by_stream_.try_emplace(batch.stream).first;
  }
  Entry& entry = found->second;
  entry.is_new = true;
  Arrivals& arrivals = entry.arrivals;
  arrivals.last_time = now;
  arrivals.stored_count += stored;
  arrivals.wand_count += wand_count;
  arrivals.refused_count += outcome.refused_rows;
  arrivals.complete = outcome.complete;
  arrivals.durable_seq = std::max(arrivals.durable_seq, outcome.durable_seq);
  for (const DroppedRange& dropped : batch.dropped) arrivals.dropped_count += dropped.count;
  for (const ClockSample& sample : batch.clock_samples) {
    if (arrivals.clock_samples.size() == kMaxSamples) break;
    arrivals.clock_samples.emplace_back(batch.clock_epoch, sample);
  }
  for (const HostAlignment& alignment : batch.host_alignments) {
    if (arrivals.host_alignments.size() == kMaxSamples) break;
    arrivals.host_alignments.push_back(alignment);
  }
  if (delivery.report) arrivals.report = delivery.report;
  if (stored == 0) return;
  for (size_t row = first_new; row < count; ++row) {
    // The values of a refused one may be anything.
    if (is_refused(row) || !entry.thinner.Keep(batch.clock_epoch, batch.time_ns[row])) continue;
    if (arrivals.rows.size() < kMaxArrivedRows) arrivals.rows.push_back(ThinnedRowOf(batch, row));
  }
  if (!arrivals.has_rows || arrivals.clock_epoch != batch.clock_epoch ||
      batch.time_ns.back() > arrivals.newest_row_ns) {
    arrivals.newest_row_ns = batch.time_ns.back();
  }
  arrivals.has_rows = true;
  arrivals.clock_epoch = batch.clock_epoch;
}

std::vector<std::pair<StreamKey, Arrivals>> ArrivalInbox::Take() {
  std::vector<std::pair<StreamKey, Arrivals>> taken;
  const std::lock_guard lock(mutex_);
  for (auto& [stream, entry] : by_stream_) {
    if (!entry.is_new) continue;
    taken.emplace_back(stream, std::exchange(entry.arrivals, {}));
    entry.is_new = false;
  }
  return taken;
}

}  // namespace rigcal::server
