// SPDX-License-Identifier: Apache-2.0
#include "agent/spool/disk/disk_spool.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <fstream>
#include <utility>

#include "absl/strings/str_cat.h"
#include "agent/spool/disk/byte_format.h"
#include "agent/spool/disk/segment_format.h"
#include "agent/spool/disk/spool_recovery.h"
#include "common/failpoint/failpoint.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

constexpr uint64_t kMinSegmentBytes = uint64_t{16} << 10;

std::string StreamText(const StreamKey& key) {
  return absl::StrCat("stream ", key.stream_epoch, " of camera ", key.camera, " in session ",
                      key.session_id);
}

absl::Status IsNotOpen(const StreamKey& key) {
  return absl::NotFoundError(absl::StrCat(StreamText(key), " is not in the spool"));
}

}  // namespace

uint64_t BootNumber() {
  std::ifstream file("/proc/sys/kernel/random/boot_id");
  std::string id;
  if (!std::getline(file, id) || id.size() < 32) return 0;
  const std::string_view text(id);
  return uint64_t{SpoolChecksum(text)} << 32 | SpoolChecksum(text.substr(9));
}

DiskSpool::DiskSpool(DiskSpoolOptions options, FileSystem* files)
    : options_(std::move(options)),
      files_(*files),
      segment_bytes_(std::clamp(options_.limit_bytes / 16, kMinSegmentBytes, kMaxSegmentBytes)) {}

absl::StatusOr<std::unique_ptr<DiskSpool>> DiskSpool::Create(DiskSpoolOptions options,
                                                             FileSystem* files) {
  std::unique_ptr<DiskSpool> spool(new DiskSpool(std::move(options), files));
  RIGCAL_RETURN_IF_ERROR(spool->Recover());
  if (spool->options_.has_thread) {
    spool->thread_ = std::thread([raw = spool.get()] { raw->RunThread(); });
  } else {
    spool->Maintain();
  }
  return spool;
}

absl::Status DiskSpool::Recover() {
  RIGCAL_RETURN_IF_ERROR(files_.CreateFolder(options_.folder));
  RIGCAL_ASSIGN_OR_RETURN(folder_lock_, files_.Lock(PathOf("lock")));
  RIGCAL_ASSIGN_OR_RETURN(StreamEnds ends, StreamEnds::Open(files_, options_.folder));
  ends_.emplace(std::move(ends));
  RIGCAL_ASSIGN_OR_RETURN(RecoveredSpool found,
                          RecoverSpool(files_, options_.folder, *ends_, options_.boot));
  const std::lock_guard lock(mutex_);
  last_stream_number_ = found.last_stream_number;
  last_ordinal_ = found.last_ordinal;
  bytes_ = found.bytes;
  streams_ = std::move(found.streams);
  doomed_ = std::move(found.doomed);
  has_reserve_ = found.has_reserve;
  dropped_ = std::move(found.dropped);
  checkpoint_due_ = !streams_.empty() || !doomed_.empty();
  uint64_t rows = 0;
  for (const auto& [key, stream] : streams_) rows += stream.row_count;
  if (!streams_.empty()) {
    spdlog::info("spool {}: {} observations of {} streams of an earlier run are to be delivered",
                 options_.folder, rows, streams_.size());
  }
  return absl::OkStatus();
}

DiskSpool::~DiskSpool() {
  Shutdown();
  if (thread_.joinable()) {
    {
      const std::lock_guard lock(mutex_);
      ending_ = true;
      maintenance_due_.notify_all();
    }
    thread_.join();
  }
  {
    const std::lock_guard lock(mutex_);
    checkpoint_due_ = checkpoint_due_ || positions_changed_;
  }
  // Not after a failure in its construction.
  if (folder_lock_ != nullptr) Maintain();
}

absl::Status DiskSpool::Open(const StreamKey& key, int marker_count, uint32_t first_seq) {
  const std::lock_guard lock(mutex_);
  RIGCAL_RETURN_IF_ERROR(failed_);
  if (streams_.contains(key)) {
    return absl::AlreadyExistsError(absl::StrCat(StreamText(key), " is already in the spool"));
  }
  DiskStream& stream = streams_[key];
  stream.stream = key;
  stream.number = ++last_stream_number_;
  stream.marker_count = static_cast<uint32_t>(marker_count);
  stream.begin_seq = stream.first_seq = stream.end_seq = first_seq;
  stream.durable_seq = stream.synced_seq = first_seq - 1;
  stream.boot = options_.boot;
  checkpoint_due_ = true;
  const absl::Status status = ends_->Write(stream.number, stream.end_seq);
  // On a full disk the end stays unknown until the first observation is written.
  if (status.ok() || absl::IsResourceExhausted(status)) return absl::OkStatus();
  Fail(status);
  return failed_;
}

absl::StatusOr<uint32_t> DiskSpool::Append(const StreamKey& key, const Observation& observation,
                                           const std::vector<ClockSample>& clock_samples) {
  std::unique_lock lock(mutex_);
  bool is_row_dropped = false;
  while (true) {
    if (shut_down_) return absl::CancelledError("the agent shuts down");
    RIGCAL_RETURN_IF_ERROR(failed_);
    const auto found = streams_.find(key);
    if (found == streams_.end()) return IsNotOpen(key);
    DiskStream& stream = found->second;
    if (stream.end)
      return absl::FailedPreconditionError(absl::StrCat(StreamText(key), " has ended"));
    if (observation.markers.size() != stream.marker_count) {
      return absl::InvalidArgumentError(
          absl::StrCat("an observation has ", observation.markers.size(), " markers, but ",
                       StreamText(key), " has ", stream.marker_count));
    }
    const uint32_t seq = stream.end_seq;
    absl::Status status;
    if (!is_row_dropped) {
      scratch_.clear();
      EncodeRecord(seq, observation, clock_samples, &scratch_);
      status = HasRoomFor(stream, scratch_.size())
                   ? WriteRecord(stream, scratch_)
                   : absl::ResourceExhaustedError(
                         absl::StrCat("the spool ", options_.folder, " has reached its limit of ",
                                      options_.limit_bytes >> 20, " MiB (spool.limit_mb)"));
    }
    if (absl::IsResourceExhausted(status)) {
      NoteFull(std::string(status.message()));
      if (options_.full == SpoolFull::kDropOldest && doomed_.empty()) DropOldest();
      is_row_dropped = options_.full == SpoolFull::kDropOldest && doomed_.empty();
      if (!is_row_dropped) WaitForSpace(lock);
      continue;
    }
    if (!status.ok()) {
      Fail(status);
      return failed_;
    }
    ++stream.end_seq;
    if (!stream.segments.empty()) stream.segments.back().end_seq = stream.end_seq;
    if (is_row_dropped) {
      dropped_[RefusalReason::kSpoolFull] += stream.AddGap(seq, seq + 1, RefusalReason::kSpoolFull);
      // The next checkpoint has it too.
      ends_->Write(stream.number, stream.end_seq).IgnoreError();
      checkpoint_due_ = true;
    } else {
      ++stream.row_count;
      NoteRoom();
    }
    Failpoint("after_spool_append");
    if (options_.sync_interval.count() > 0 || is_row_dropped) return seq;
    status = stream.segments.back().file->Sync();
    if (status.ok() && std::exchange(folder_changed_, false)) {
      status = files_.SyncFolder(options_.folder);
    }
    if (!status.ok()) {
      Fail(status);
      return failed_;
    }
    stream.synced_seq = seq;
    return seq;
  }
}

absl::Status DiskSpool::WriteRecord(DiskStream& stream, std::string_view record) {
  if (NeedsRotation(stream, record.size())) RIGCAL_RETURN_IF_ERROR(Rotate(stream));
  Segment& segment = stream.segments.back();
  absl::Status status = segment.file->WriteAt(segment.bytes, record);
  if (status.ok()) status = ends_->Write(stream.number, stream.end_seq + 1);
  if (!status.ok()) {
    // Part of it may be there; the next record must begin where this one did.
    if (absl::Status cut = segment.file->Truncate(segment.bytes); !cut.ok()) {
      return absl::InternalError(
          absl::StrCat(std::string(status.message()), "; ", std::string(cut.message())));
    }
    return status;
  }
  segment.bytes += record.size();
  bytes_ += record.size();
  return absl::OkStatus();
}

absl::Status DiskSpool::Rotate(DiskStream& stream) {
  if (!stream.segments.empty() && stream.segments.back().file != nullptr) {
    closed_.push_back(std::exchange(stream.segments.back().file, nullptr));
  }
  const SegmentName name{
      .ordinal = ++last_ordinal_, .stream_number = stream.number, .first_seq = stream.end_seq};
  Segment segment{.ordinal = name.ordinal,
                  .first_seq = stream.end_seq,
                  .end_seq = stream.end_seq,
                  .bytes = 0,
                  .path = PathOf(FormatSegmentName(name)),
                  .file = nullptr};
  RIGCAL_ASSIGN_OR_RETURN(segment.file, files_.Create(segment.path));
  folder_changed_ = true;
  const std::string header = EncodeHeader({.stream_number = stream.number,
                                           .stream = stream.stream,
                                           .marker_count = stream.marker_count,
                                           .begin_seq = stream.begin_seq,
                                           .first_seq = stream.end_seq,
                                           .boot = stream.boot});
  if (absl::Status status = segment.file->WriteAt(0, header); !status.ok()) {
    const absl::Status removed = files_.Remove(segment.path);
    return removed.ok() ? status : removed;
  }
  segment.bytes = header.size();
  bytes_ += header.size();
  stream.segments.push_back(std::move(segment));
  // The row before may have been the last one of what is freed.
  Release(stream);
  Failpoint("segment_rotation");
  return absl::OkStatus();
}

absl::Status DiskSpool::Finish(const StreamKey& key, CameraReport report) {
  const std::lock_guard lock(mutex_);
  const auto found = streams_.find(key);
  if (found == streams_.end()) return IsNotOpen(key);
  DiskStream& stream = found->second;
  report.stream = key;
  report.observation_count = stream.end_seq - stream.begin_seq;
  stream.end =
      EndOfCapture{.stream = key, .last_seq = stream.end_seq - 1, .report = std::move(report)};
  if (!stream.segments.empty() && stream.segments.back().file != nullptr) {
    closed_.push_back(std::exchange(stream.segments.back().file, nullptr));
  }
  Release(stream);
  checkpoint_due_ = true;
  return absl::OkStatus();
}

absl::StatusOr<ObservationBatch> DiskSpool::Read(const StreamKey& key, uint32_t from_seq,
                                                 size_t max_rows) {
  const std::lock_guard lock(mutex_);
  const auto found = streams_.find(key);
  if (found == streams_.end()) return IsNotOpen(key);
  uint64_t newly_lost = 0;
  ObservationBatch batch = ReadStream(files_, found->second, from_seq, max_rows, &newly_lost);
  if (newly_lost > 0) {
    spdlog::error("camera {}: {} observations of session {} are lost: the spool is damaged",
                  key.camera, newly_lost, key.session_id);
    dropped_[RefusalReason::kSpoolDamaged] += newly_lost;
    checkpoint_due_ = true;
  }
  return batch;
}

void DiskSpool::Acknowledge(const StreamKey& key, uint32_t durable_seq) {
  const std::lock_guard lock(mutex_);
  const auto found = streams_.find(key);
  if (found == streams_.end()) return;
  DiskStream& stream = found->second;
  const uint32_t before = stream.durable_seq;
  stream.SetDurable(durable_seq);
  if (stream.durable_seq == before) return;
  positions_changed_ = true;
  Release(stream);
  if (full_) maintenance_due_.notify_all();
}

uint32_t DiskSpool::Discard(const StreamKey& key) {
  const std::lock_guard lock(mutex_);
  const auto found = streams_.find(key);
  if (found == streams_.end()) return 0;
  const uint64_t lost = found->second.row_count;
  for (Segment& segment : found->second.segments) Doom(std::move(segment));
  streams_.erase(found);
  checkpoint_due_ = true;
  space_changed_.notify_all();
  return static_cast<uint32_t>(lost);
}

std::optional<SpooledStream> DiskSpool::Find(const StreamKey& key) const {
  const std::lock_guard lock(mutex_);
  const auto found = streams_.find(key);
  if (found == streams_.end()) return std::nullopt;
  return found->second;
}

std::vector<SpooledStream> DiskSpool::Streams() const {
  const std::lock_guard lock(mutex_);
  std::vector<SpooledStream> list;
  for (const auto& [key, stream] : streams_) list.push_back(stream);
  return list;
}

SpoolStatus DiskSpool::Status() const {
  const std::lock_guard lock(mutex_);
  SpoolStatus status{.bytes = bytes_,
                     .limit_bytes = options_.limit_bytes,
                     .dropped = ListOf(dropped_),
                     .folder = options_.folder,
                     .problem = std::string(failed_.message())};
  for (const auto& [key, stream] : streams_) status.row_count += stream.row_count;
  if (full_ && status.problem.empty()) status.problem = "the spool is full";
  return status;
}

void DiskSpool::Shutdown() {
  const std::lock_guard lock(mutex_);
  shut_down_ = true;
  space_changed_.notify_all();
}

}  // namespace rigcal::agent
