// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "agent/spool/disk/disk_stream.h"
#include "agent/spool/disk/file_system.h"
#include "agent/spool/disk/stream_ends.h"
#include "agent/spool/observation_spool.h"

namespace rigcal::agent {

// What Append does when the spool is full.
enum class SpoolFull : uint8_t {
  kBlock,       // waits, and so does the source: frames are lost at the camera, and counted there
  kDropOldest,  // the oldest segment of all streams is dropped; its rows are counted
};

struct DiskSpoolOptions {
  std::string folder;                           // made where it is missing; for this spool alone
  uint64_t limit_bytes = uint64_t{2048} << 20;  // of segments
  SpoolFull full = SpoolFull::kBlock;
  // Rows are synced to the disk this often; 0: each before Append returns. What the operating
  // system has (all of it survives the end of the process) and the disk has not is lost when the
  // power fails.
  std::chrono::milliseconds sync_interval{200};
  uint64_t boot = 0;  // of this run of the operating system: BootNumber()
  // False: no thread; Maintain must be called. For tests.
  bool has_thread = true;
};

// A number for this run of the operating system; 0: not known.
uint64_t BootNumber();

// A spool on the disk: what it holds is delivered after a restart. Each stream has segment files of
// its own (segment_format.h), and one checkpoint (checkpoint.h) says what of them is acknowledged.
// A segment is deleted only once a checkpoint that passes it is durable. When it is opened, headers
// and the last segment of each stream are read, nothing else. Of each stream a few rows that were
// read ahead are held in memory, no more.
//
// Damaged records, and rows dropped when it was full, are counted, and told to the server as
// dropped ranges. A stream whose capture was running when the agent ended gets its end behind its
// last row; stream_ends.h says when that is known to be its end. After a failed write or sync
// nothing is accepted any more until the spool is opened again: what is on the disk then is not
// known, and trying again would not tell. A full disk is no failure: it is treated as a full spool.
class DiskSpool final : public ObservationSpool {
 public:
  // ALREADY_EXISTS: another agent uses the folder.  Errors of the file system, naming the file.
  // `files` outlives the spool.
  static absl::StatusOr<std::unique_ptr<DiskSpool>> Create(DiskSpoolOptions options,
                                                           FileSystem* files = &RealFileSystem());
  ~DiskSpool() override;

  absl::Status Open(const StreamKey& stream, int marker_count, uint32_t first_seq) override;
  absl::StatusOr<uint32_t> Append(const StreamKey& stream, const Observation& observation,
                                  const std::vector<ClockSample>& clock_samples) override;
  absl::Status Finish(const StreamKey& stream, CameraReport report) override;
  absl::StatusOr<ObservationBatch> Read(const StreamKey& stream, uint32_t from_seq,
                                        size_t max_rows) override;
  void Acknowledge(const StreamKey& stream, uint32_t durable_seq) override;
  uint32_t Discard(const StreamKey& stream) override;
  std::optional<SpooledStream> Find(const StreamKey& stream) const override;
  std::vector<SpooledStream> Streams() const override;
  SpoolStatus Status() const override;
  bool survives_restart() const override { return true; }
  void Shutdown() override;

  // Syncs what was appended, writes a checkpoint where one is due, and deletes what it passes. The
  // spool's own thread calls it.
  void Maintain();

 private:
  DiskSpool(DiskSpoolOptions options, FileSystem* files);

  // Reads what an earlier run left.
  absl::Status Recover();

  // With mutex_ held.
  absl::Status WriteRecord(DiskStream& stream, std::string_view record);
  absl::Status Rotate(DiskStream& stream);
  void DropOldest();
  // Waits until something may have changed about the space; may give up mutex_ meanwhile.
  void WaitForSpace(std::unique_lock<std::mutex>& lock);
  bool NeedsRotation(const DiskStream& stream, size_t bytes) const;
  bool HasRoomFor(const DiskStream& stream, size_t bytes) const;
  // Each logs the change once.
  void NoteFull(const std::string& why);
  void NoteRoom();
  // Segments at the front of a stream that are acknowledged or lost are to be deleted.
  void Release(DiskStream& stream);
  void Doom(Segment segment);
  void Fail(const absl::Status& status);

  // Parts of Maintain, with maintenance_mutex_ held and mutex_ not.
  absl::Status SyncSegments();
  absl::Status WriteCheckpoint();
  absl::Status ReplaceCheckpoint(const std::string& bytes);
  void DeleteDoomed(std::vector<Segment> doomed);
  void RunThread();

  std::string PathOf(const std::string& name) const { return options_.folder + "/" + name; }

  const DiskSpoolOptions options_;
  FileSystem& files_;
  const uint64_t segment_bytes_;
  std::shared_ptr<void> folder_lock_;
  std::optional<StreamEnds> ends_;  // once Recover has opened it

  std::mutex maintenance_mutex_;  // taken before mutex_
  mutable std::mutex mutex_;
  std::condition_variable space_changed_;
  std::condition_variable maintenance_due_;
  std::map<StreamKey, DiskStream> streams_;
  uint32_t last_stream_number_ = 0;
  uint64_t last_ordinal_ = 0;
  uint64_t bytes_ = 0;           // of segments, those in doomed_ included
  std::vector<Segment> doomed_;  // to be deleted once a checkpoint has passed them
  std::vector<std::shared_ptr<SpoolFile>> closed_;  // full segments that are not synced yet
  bool folder_changed_ = false;                     // not synced yet
  bool checkpoint_due_ = false;                     // soon
  bool positions_changed_ = false;                  // in the next regular checkpoint
  std::chrono::steady_clock::time_point next_checkpoint_{};
  bool has_reserve_ = false;  // a file that is deleted when there is no room for a checkpoint
  bool full_ = false;
  absl::Status failed_;
  DropCounts dropped_;
  std::string scratch_;  // kept for its capacity
  bool shut_down_ = false;
  bool ending_ = false;
  std::thread thread_;
};

}  // namespace rigcal::agent
