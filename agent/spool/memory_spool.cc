// SPDX-License-Identifier: Apache-2.0
#include "agent/spool/memory_spool.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"

namespace rigcal::agent {
namespace {

constexpr size_t kChunkRows = 256;

size_t RowBytes(int marker_count) {
  constexpr size_t kPerRow = sizeof(int64_t) + sizeof(uint32_t);
  constexpr size_t kPerMarker = 6 * sizeof(float) + sizeof(int32_t) + sizeof(uint8_t);
  return kPerRow + kPerMarker * static_cast<size_t>(marker_count);
}

std::string Name(const StreamKey& key) {
  return absl::StrCat("stream ", key.stream_epoch, " of camera ", key.camera, " in session ",
                      key.session_id);
}

absl::Status NotOpen(const StreamKey& key) {
  return absl::NotFoundError(absl::StrCat(Name(key), " is not in the spool"));
}

}  // namespace

absl::Status MemorySpool::Open(const StreamKey& stream, int marker_count, uint32_t first_seq) {
  const std::lock_guard lock(mutex_);
  Stream opened;
  opened.stream = stream;
  opened.marker_count = marker_count;
  opened.begin_seq = opened.first_seq = opened.end_seq = first_seq;
  opened.durable_seq = opened.synced_seq = first_seq - 1;
  if (!streams_.try_emplace(stream, std::move(opened)).second) {
    return absl::AlreadyExistsError(absl::StrCat(Name(stream), " is already in the spool"));
  }
  return absl::OkStatus();
}

absl::StatusOr<uint32_t> MemorySpool::Append(const StreamKey& key, const Observation& observation,
                                             const std::vector<ClockSample>& clock_samples) {
  const size_t row_bytes = RowBytes(static_cast<int>(observation.markers.size()));
  std::unique_lock lock(mutex_);
  // An empty spool takes any observation: one that is too large alone must not wait forever.
  space_changed_.wait(lock, [&] {
    return shut_down_ || bytes_ == 0 || bytes_ + row_bytes <= limit_bytes_ ||
           !streams_.contains(key);
  });
  if (shut_down_) return absl::CancelledError("the agent shuts down");
  const auto found = streams_.find(key);
  if (found == streams_.end()) return NotOpen(key);
  Stream& stream = found->second;
  if (stream.end) return absl::FailedPreconditionError(absl::StrCat(Name(key), " has ended"));
  if (observation.markers.size() != static_cast<size_t>(stream.marker_count)) {
    return absl::InvalidArgumentError(absl::StrCat("an observation has ",
                                                   observation.markers.size(), " markers, but ",
                                                   Name(key), " has ", stream.marker_count));
  }
  if (stream.chunks.empty() || stream.chunks.back().rows() >= kChunkRows ||
      stream.chunks.back().clock_epoch != observation.clock_epoch) {
    ObservationBatch& chunk = stream.chunks.emplace_back();
    chunk.stream = key;
    chunk.first_seq = stream.end_seq;
    chunk.clock_epoch = observation.clock_epoch;
    chunk.marker_count = static_cast<uint32_t>(stream.marker_count);
  }
  stream.chunks.back().Append(observation);
  bytes_ += row_bytes;
  for (const ClockSample& sample : clock_samples) {
    stream.clock_samples.push_back({stream.end_seq, sample});
  }
  ++stream.row_count;
  stream.synced_seq = stream.end_seq;
  return stream.end_seq++;
}

absl::Status MemorySpool::Finish(const StreamKey& key, CameraReport report) {
  const std::lock_guard lock(mutex_);
  const auto found = streams_.find(key);
  if (found == streams_.end()) return NotOpen(key);
  Stream& stream = found->second;
  report.stream = key;
  report.observation_count = stream.end_seq - stream.begin_seq;
  stream.end =
      EndOfCapture{.stream = key, .last_seq = stream.end_seq - 1, .report = std::move(report)};
  return absl::OkStatus();
}

absl::StatusOr<ObservationBatch> MemorySpool::Read(const StreamKey& key, uint32_t from_seq,
                                                   size_t max_rows) {
  const std::lock_guard lock(mutex_);
  const auto found = streams_.find(key);
  if (found == streams_.end()) return NotOpen(key);
  const Stream& stream = found->second;
  ObservationBatch batch;
  batch.stream = key;
  batch.first_seq = std::max(from_seq, stream.first_seq);
  batch.marker_count = static_cast<uint32_t>(stream.marker_count);

  const auto chunk = std::upper_bound(
      stream.chunks.begin(), stream.chunks.end(), batch.first_seq,
      [](uint32_t seq, const ObservationBatch& candidate) { return seq < candidate.end_seq(); });
  if (chunk != stream.chunks.end()) {
    const size_t begin = batch.first_seq - chunk->first_seq;
    batch = chunk->Slice(begin, std::min(begin + max_rows, chunk->rows()));
  }
  for (const NumberedSample& numbered : stream.clock_samples) {
    if (numbered.seq >= batch.end_seq()) break;
    if (numbered.seq >= batch.first_seq) batch.clock_samples.push_back(numbered.sample);
  }
  if (from_seq < stream.first_seq) {
    batch.dropped.push_back({.first_seq = from_seq,
                             .count = stream.first_seq - from_seq,
                             .reason = RefusalReason::kSpoolFreed});
  }
  return batch;
}

void MemorySpool::Acknowledge(const StreamKey& key, uint32_t durable_seq) {
  const std::lock_guard lock(mutex_);
  const auto found = streams_.find(key);
  if (found == streams_.end()) return;
  Stream& stream = found->second;
  stream.durable_seq = std::max(stream.durable_seq, std::min(durable_seq, stream.end_seq - 1));
  stream.row_count = stream.end_seq - 1 - stream.durable_seq;
  while (!stream.chunks.empty() && stream.chunks.front().end_seq() <= stream.durable_seq + 1) {
    stream.first_seq = stream.chunks.front().end_seq();
    bytes_ -= stream.chunks.front().rows() * RowBytes(stream.marker_count);
    stream.chunks.pop_front();
  }
  while (!stream.clock_samples.empty() && stream.clock_samples.front().seq < stream.first_seq) {
    stream.clock_samples.pop_front();
  }
  space_changed_.notify_all();
}

uint32_t MemorySpool::Discard(const StreamKey& key) {
  const std::lock_guard lock(mutex_);
  const auto found = streams_.find(key);
  if (found == streams_.end()) return 0;
  const Stream& stream = found->second;
  const uint32_t lost = stream.end_seq - 1 - stream.durable_seq;
  for (const ObservationBatch& chunk : stream.chunks) {
    bytes_ -= chunk.rows() * RowBytes(stream.marker_count);
  }
  streams_.erase(found);
  space_changed_.notify_all();
  return lost;
}

std::optional<SpooledStream> MemorySpool::Find(const StreamKey& key) const {
  const std::lock_guard lock(mutex_);
  const auto found = streams_.find(key);
  if (found == streams_.end()) return std::nullopt;
  return found->second;
}

std::vector<SpooledStream> MemorySpool::Streams() const {
  const std::lock_guard lock(mutex_);
  std::vector<SpooledStream> list;
  for (const auto& [key, stream] : streams_) list.push_back(stream);
  return list;
}

SpoolStatus MemorySpool::Status() const {
  const std::lock_guard lock(mutex_);
  SpoolStatus status{.bytes = bytes_, .limit_bytes = limit_bytes_};
  for (const auto& [key, stream] : streams_) status.row_count += stream.row_count;
  return status;
}

void MemorySpool::Shutdown() {
  const std::lock_guard lock(mutex_);
  shut_down_ = true;
  space_changed_.notify_all();
}

size_t MemorySpool::bytes() const {
  const std::lock_guard lock(mutex_);
  return bytes_;
}

}  // namespace rigcal::agent
