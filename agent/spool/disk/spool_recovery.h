// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "agent/spool/disk/disk_stream.h"
#include "agent/spool/disk/file_system.h"
#include "agent/spool/disk/stream_ends.h"

namespace rigcal::agent {

inline constexpr char kCheckpointFile[] = "checkpoint";
inline constexpr char kNewCheckpointFile[] = "checkpoint.new";
// Takes space that a checkpoint needs when the disk is full.
inline constexpr char kReserveFile[] = "reserve";

// What an earlier run left in the folder of a disk spool.
struct RecoveredSpool {
  uint32_t last_stream_number = 0;
  uint64_t last_ordinal = 0;
  uint64_t bytes = 0;  // of all segments
  bool has_reserve = false;
  std::map<StreamKey, DiskStream> streams;
  std::vector<Segment> doomed;  // nothing in them is needed
  DropCounts dropped;           // of all streams, with what could not be assigned to one
};

// Reads the checkpoint, the header of each segment and the last segment of each stream. A stream
// without end gets one, marked as interrupted: where `ends` says, if it was captured in this run of
// the operating system; else behind its last row, and then its end counts as unknown. Damage is
// counted and logged; it is never an error. Errors: those of listing the folder and of syncing.
absl::StatusOr<RecoveredSpool> RecoverSpool(FileSystem& files, const std::string& folder,
                                            const StreamEnds& ends, uint64_t boot);

}  // namespace rigcal::agent
