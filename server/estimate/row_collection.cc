// SPDX-License-Identifier: Apache-2.0
#include "server/estimate/row_collection.h"

#include <algorithm>
#include <utility>

namespace rigcal::server {
namespace {

size_t WandRows(const ObservationBatch& batch) {
  return static_cast<size_t>(
      std::ranges::count_if(batch.visible_mask, [](uint32_t mask) { return mask != 0; }));
}

bool IsKept(int64_t slot, int level) { return (slot & ((int64_t{1} << level) - 1)) == 0; }

}  // namespace

void RowCollection::Add(const StreamKey& stream, const ObservationBatch& batch) {
  const std::lock_guard lock(mutex_);
  AddTo(&sessions_[stream.session_id], batch, {stream.camera, stream.session_id, true});
}

void RowCollection::AddEarlier(const std::string& session_id, const SessionCamera& camera,
                               const ObservationBatch& batch) {
  const std::lock_guard lock(mutex_);
  const Key key = {camera.description.camera, batch.stream.session_id, false};
  SessionRows& session = sessions_[session_id];
  session.cameras[key].description = camera.description;
  AddTo(&session, batch, key);
}

void RowCollection::AddTo(SessionRows* session, const ObservationBatch& batch, const Key& key) {
  Camera& camera = session->cameras[key];
  AddClocks(batch, &camera);
  const auto step_ns = static_cast<int64_t>(1e9 / options_.max_rate_hz);
  const int64_t offset_ns = camera.clock_offset_ns.value_or(0);
  for (size_t row = 0; row < batch.rows(); ++row) {
    if (batch.visible_mask[row] != 0) ++camera.seen_count;
    const int64_t time_ns = batch.time_ns[row];
    // A camera whose clock has jumped back goes on.
    const int64_t since_ns = time_ns - camera.last_time_ns;
    if (camera.has_rows && since_ns >= 0 && since_ns < step_ns) continue;
    camera.last_time_ns = time_ns;
    camera.has_rows = true;
    const int64_t common_ns = time_ns + offset_ns;
    const int64_t slot = common_ns / options_.slot_ns - (common_ns < 0 ? 1 : 0);
    if (IsKept(slot, session->level)) AddRow(batch, row, slot, &camera);
  }
  size_t row_count = 0;
  const std::string& name = std::get<0>(key);
  for (auto each = session->cameras.lower_bound({name, "", false});
       each != session->cameras.end() && std::get<0>(each->first) == name; ++each) {
    row_count += each->second.row_count;
  }
  if (row_count > options_.max_rows_per_camera) Thin(session);
}

void RowCollection::AddClocks(const ObservationBatch& batch, Camera* camera) const {
  if (batch.clock_samples.empty() && batch.host_alignments.empty()) return;
  const auto first = std::ranges::find_if(batch.clock_samples, &ClockSample::IsOfHost);
  if (!camera->clock_offset_ns && first != batch.clock_samples.end()) {
    camera->clock_offset_ns = first->host_utc_ns - first->device_ns;
  }
  auto found = std::ranges::find(camera->clocks, batch.clock_epoch, &ObservationBatch::clock_epoch);
  if (found == camera->clocks.end()) {
    ObservationBatch clock;
    clock.stream = batch.stream;
    clock.clock_epoch = batch.clock_epoch;
    camera->clocks.push_back(std::move(clock));
    found = camera->clocks.end() - 1;
  }
  const auto append = [this](const auto& from, auto* to) {
    to->insert(to->end(), from.begin(), from.end());
    if (to->size() <= options_.max_clock_samples) return;
    to->erase(to->begin(), to->end() - static_cast<std::ptrdiff_t>(options_.max_clock_samples));
  };
  append(batch.clock_samples, &found->clock_samples);
  append(batch.host_alignments, &found->host_alignments);
}

void RowCollection::AddRow(const ObservationBatch& batch, size_t row, int64_t slot,
                           Camera* camera) const {
  if (camera->slots.empty() || camera->slots.back().index != slot ||
      camera->slots.back().batch.clock_epoch != batch.clock_epoch) {
    Slot next;
    next.index = slot;
    next.batch.stream = batch.stream;
    next.batch.clock_epoch = batch.clock_epoch;
    next.batch.marker_count = batch.marker_count;
    camera->slots.push_back(std::move(next));
  }
  camera->slots.back().batch.Append(batch.Row(row));
  ++camera->row_count;
  camera->wand_count += batch.visible_mask[row] != 0 ? 1 : 0;
}

void RowCollection::Thin(SessionRows* session) const {
  ++session->level;
  for (auto& [key, camera] : session->cameras) {
    std::erase_if(camera.slots, [&](const Slot& slot) {
      if (IsKept(slot.index, session->level)) return false;
      camera.row_count -= slot.batch.rows();
      camera.wand_count -= WandRows(slot.batch);
      return true;
    });
  }
}

std::optional<RowCollection::Snapshot> RowCollection::Take(const std::string& session_id) const {
  const std::lock_guard lock(mutex_);
  const auto found = sessions_.find(session_id);
  if (found == sessions_.end()) return std::nullopt;
  Snapshot snapshot;
  size_t kept = 0;
  for (const auto& [key, camera] : found->second.cameras) {
    const auto& [name, source_id, is_new] = key;
    std::vector<Track>& tracks = snapshot.tracks;
    // Rows of one session are one track, from before a restart or not.
    if (tracks.empty() || tracks.back().camera != name || tracks.back().session_id != source_id) {
      tracks.push_back({.session_id = source_id, .camera = name, .description = {}, .rows = {}});
    }
    Track& track = tracks.back();
    if (source_id != session_id) track.description = camera.description;
    track.rows.insert(track.rows.end(), camera.clocks.begin(), camera.clocks.end());
    for (const Slot& slot : camera.slots) track.rows.push_back(slot.batch);
    kept += camera.wand_count;
    snapshot.seen_count += camera.seen_count;
  }
  if (snapshot.seen_count > 0) {
    snapshot.data_share = static_cast<double>(kept) / static_cast<double>(snapshot.seen_count);
  }
  return snapshot;
}

void RowCollection::Forget(const std::string& session_id) {
  const std::lock_guard lock(mutex_);
  sessions_.erase(session_id);
}

std::vector<std::string> RowCollection::Sessions() const {
  const std::lock_guard lock(mutex_);
  std::vector<std::string> ids;
  for (const auto& [id, session] : sessions_) ids.push_back(id);
  return ids;
}

}  // namespace rigcal::server
