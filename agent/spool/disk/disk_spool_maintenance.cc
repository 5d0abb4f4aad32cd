// SPDX-License-Identifier: Apache-2.0
// The part of the disk spool that syncs, writes checkpoints and frees space.
#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "agent/spool/disk/checkpoint.h"
#include "agent/spool/disk/disk_spool.h"
#include "agent/spool/disk/segment_format.h"
#include "agent/spool/disk/spool_recovery.h"
#include "common/failpoint/failpoint.h"
#include "common/status/guarded.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

// Positions alone are worth a checkpoint this often: without one, rows are sent again.
constexpr std::chrono::seconds kCheckpointInterval{1};
constexpr std::chrono::milliseconds kMaintenanceInterval{200};
constexpr std::chrono::milliseconds kRoomCheckInterval{200};
constexpr size_t kReserveBytes = size_t{256} << 10;

}  // namespace

bool DiskSpool::NeedsRotation(const DiskStream& stream, size_t bytes) const {
  return stream.segments.empty() || stream.segments.back().file == nullptr ||
         stream.segments.back().bytes + bytes > segment_bytes_;
}

bool DiskSpool::HasRoomFor(const DiskStream& stream, size_t bytes) const {
  if (NeedsRotation(stream, bytes)) bytes += kMaxHeaderBytes;
  // An empty spool takes any observation: one that is too large alone must not wait forever.
  return bytes_ == 0 || bytes_ + bytes <= options_.limit_bytes;
}

void DiskSpool::NoteFull(const std::string& why) {
  if (std::exchange(full_, true)) return;
  spdlog::error("{}; {}", why,
                options_.full == SpoolFull::kBlock
                    ? "captures wait until the server has taken some of it (spool.full = block)"
                    : "the oldest observations are dropped (spool.full = drop_oldest)");
}

void DiskSpool::NoteRoom() {
  // Not at the edge: a spool that stays full would be logged again and again.
  if (!full_ || bytes_ > options_.limit_bytes / 10 * 9) return;
  full_ = false;
  spdlog::info("spool {}: there is room again", options_.folder);
}

void DiskSpool::DropOldest() {
  DiskStream* oldest = nullptr;
  for (auto& [key, stream] : streams_) {
    if (stream.segments.empty()) continue;
    if (oldest == nullptr || stream.segments.front().ordinal < oldest->segments.front().ordinal) {
      oldest = &stream;
    }
  }
  if (oldest == nullptr) return;
  Segment segment = std::move(oldest->segments.front());
  oldest->segments.pop_front();
  dropped_[RefusalReason::kSpoolFull] +=
      oldest->AddGap(segment.first_seq, segment.end_seq, RefusalReason::kSpoolFull);
  oldest->first_seq =
      oldest->segments.empty() ? oldest->end_seq : oldest->segments.front().first_seq;
  Doom(std::move(segment));
}

void DiskSpool::WaitForSpace(std::unique_lock<std::mutex>& lock) {
  // Segments that are still written to, and of which everything is acknowledged, take space too.
  for (auto& [key, stream] : streams_) {
    if (stream.segments.size() != 1 || stream.segments.back().end_seq > stream.durable_seq + 1 ||
        stream.segments.back().end_seq == stream.segments.back().first_seq) {
      continue;
    }
    Doom(std::move(stream.segments.back()));
    stream.segments.clear();
    stream.first_seq = stream.end_seq;
  }
  if (options_.has_thread) {
    maintenance_due_.notify_all();
    space_changed_.wait_for(lock, kRoomCheckInterval);
    return;
  }
  lock.unlock();
  Maintain();
  lock.lock();
}

void DiskSpool::Release(DiskStream& stream) {
  while (stream.segments.size() > (stream.end ? 0u : 1u)) {
    Segment& front = stream.segments.front();
    if (front.end_seq > stream.durable_seq + 1) break;
    Doom(std::move(front));
    stream.segments.pop_front();
  }
  stream.first_seq = stream.segments.empty() ? stream.end_seq : stream.segments.front().first_seq;
}

void DiskSpool::Doom(Segment segment) {
  segment.file.reset();
  // A file that is open for reading would keep its space on the disk.
  for (auto& [key, stream] : streams_) {
    if (stream.cursor.ordinal != segment.ordinal) continue;
    stream.cursor = {};
    stream.cursor_file.reset();
  }
  doomed_.push_back(std::move(segment));
}

void DiskSpool::Fail(const absl::Status& status) {
  if (failed_.ok()) {
    failed_ = absl::DataLossError(
        absl::StrCat("the spool accepts nothing any more: ", std::string(status.message()),
                     "; what it holds is still sent; see to the disk, then start the agent again"));
    spdlog::error("{}", std::string(failed_.message()));
  }
  space_changed_.notify_all();
}

void DiskSpool::Maintain() {
  const std::lock_guard maintenance(maintenance_mutex_);
  {
    const std::lock_guard lock(mutex_);
    if (!failed_.ok()) return;
  }
  // After what it throws nobody knows what is on the disk, as after a failed sync.
  const absl::Status status = Guarded("writing the spool", [this]() -> absl::Status {
    RIGCAL_RETURN_IF_ERROR(SyncSegments());
    return WriteCheckpoint();
  });
  if (status.ok()) return;
  const std::lock_guard lock(mutex_);
  Fail(status);
}

absl::Status DiskSpool::SyncSegments() {
  std::vector<std::shared_ptr<SpoolFile>> files;
  std::vector<std::pair<StreamKey, uint32_t>> synced;
  bool folder_changed = false;
  {
    const std::lock_guard lock(mutex_);
    files = std::exchange(closed_, {});
    for (const auto& [key, stream] : streams_) {
      if (stream.synced_seq + 1 == stream.end_seq) continue;
      synced.emplace_back(key, stream.end_seq - 1);
      if (!stream.segments.empty() && stream.segments.back().file != nullptr) {
        files.push_back(stream.segments.back().file);
      }
    }
    folder_changed = std::exchange(folder_changed_, false);
  }
  for (const auto& file : files) RIGCAL_RETURN_IF_ERROR(file->Sync());
  if (folder_changed) RIGCAL_RETURN_IF_ERROR(files_.SyncFolder(options_.folder));
  const std::lock_guard lock(mutex_);
  for (const auto& [key, seq] : synced) {
    const auto found = streams_.find(key);
    if (found == streams_.end()) continue;
    // A stream of this name may have been discarded and opened again.
    found->second.synced_seq =
        std::max(found->second.synced_seq, std::min(seq, found->second.end_seq - 1));
  }
  return absl::OkStatus();
}

absl::Status DiskSpool::WriteCheckpoint() {
  const auto now = std::chrono::steady_clock::now();
  std::string bytes;
  std::vector<Segment> doomed;
  {
    const std::lock_guard lock(mutex_);
    const bool is_due =
        checkpoint_due_ || !doomed_.empty() || (positions_changed_ && now >= next_checkpoint_);
    if (!is_due) return absl::OkStatus();
    SpoolCheckpoint checkpoint{
        .last_stream_number = last_stream_number_, .last_ordinal = last_ordinal_, .streams = {}};
    for (const auto& [key, stream] : streams_) checkpoint.streams.push_back(stream);
    bytes = EncodeCheckpoint(checkpoint);
    doomed = std::exchange(doomed_, {});
    checkpoint_due_ = positions_changed_ = false;
    next_checkpoint_ = now + kCheckpointInterval;
  }
  absl::Status status = ReplaceCheckpoint(bytes);
  if (absl::IsResourceExhausted(status) && std::exchange(has_reserve_, false)) {
    // A full disk must not keep segments from being deleted.
    RIGCAL_RETURN_IF_ERROR(files_.Remove(PathOf(kReserveFile)));
    status = ReplaceCheckpoint(bytes);
  }
  if (!status.ok()) {
    const std::lock_guard lock(mutex_);
    doomed_.insert(doomed_.end(), doomed.begin(), doomed.end());
    checkpoint_due_ = true;
    if (!absl::IsResourceExhausted(status)) return status;
    NoteFull(std::string(status.message()));
    return absl::OkStatus();
  }
  DeleteDoomed(std::move(doomed));
  return absl::OkStatus();
}

absl::Status DiskSpool::ReplaceCheckpoint(const std::string& bytes) {
  const std::string temporary = PathOf(kNewCheckpointFile);
  {
    RIGCAL_ASSIGN_OR_RETURN(const std::shared_ptr<SpoolFile> file, files_.Create(temporary));
    absl::Status status = file->WriteAt(0, bytes);
    if (status.ok()) status = file->Sync();
    if (!status.ok()) {
      const absl::Status removed = files_.Remove(temporary);
      return removed.ok() ? status : removed;
    }
  }
  Failpoint("checkpoint_rename");
  RIGCAL_RETURN_IF_ERROR(files_.Rename(temporary, PathOf(kCheckpointFile)));
  return files_.SyncFolder(options_.folder);
}

void DiskSpool::DeleteDoomed(std::vector<Segment> doomed) {
  uint64_t freed = 0;
  for (const Segment& segment : doomed) {
    const absl::Status status = files_.Remove(segment.path);
    if (!status.ok()) spdlog::warn("spool: {}", std::string(status.message()));
    freed += segment.bytes;
  }
  if (!has_reserve_) {
    const auto reserve = files_.Create(PathOf(kReserveFile));
    has_reserve_ = reserve.ok() && (*reserve)->WriteAt(0, std::string(kReserveBytes, '\0')).ok();
  }
  const std::lock_guard lock(mutex_);
  bytes_ -= std::min(bytes_, freed);
  if (freed == 0) return;
  NoteRoom();
  space_changed_.notify_all();
}

void DiskSpool::RunThread() {
  const std::chrono::milliseconds interval =
      options_.sync_interval.count() > 0 ? options_.sync_interval : kMaintenanceInterval;
  while (true) {
    {
      std::unique_lock lock(mutex_);
      if (ending_) return;
      maintenance_due_.wait_for(lock, interval);
    }
    Maintain();
  }
}

}  // namespace rigcal::agent
