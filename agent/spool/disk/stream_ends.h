// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "agent/spool/disk/file_system.h"

namespace rigcal::agent {

// One past the last observation of each stream, in a small file beside the segments. Written after
// each observation and never synced: it survives the end of the process, and of another run of the
// operating system it says nothing. It is the proof that segments were not cut and none is missing
// at the end, for a capture that was running when the agent ended.
class StreamEnds {
 public:
  static constexpr char kFileName[] = "ends";

  // Opens the file in `folder`, or creates it. Errors of the file system.
  static absl::StatusOr<StreamEnds> Open(FileSystem& files, const std::string& folder);

  absl::Status Write(uint32_t stream_number, uint32_t end_seq);
  // None: nothing was written for this stream, or it is damaged.
  std::optional<uint32_t> Read(uint32_t stream_number) const;

 private:
  explicit StreamEnds(std::shared_ptr<SpoolFile> file) : file_(std::move(file)) {}

  std::shared_ptr<SpoolFile> file_;
};

}  // namespace rigcal::agent
