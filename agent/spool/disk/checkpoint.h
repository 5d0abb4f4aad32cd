// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "agent/spool/disk/disk_stream.h"

namespace rigcal::agent {

// What the spool knows beside its segments: which streams there are, what is acknowledged or lost
// of each, and how it ended. One small file, replaced as a whole. Older ones are harmless: rows are
// sent again, and the server knows them.
struct SpoolCheckpoint {
  uint32_t last_stream_number = 0;  // given so far; a lower one that is not listed was discarded
  uint64_t last_ordinal = 0;        // of segments
  std::vector<DiskStream> streams;  // without segments and cursor
};

std::string EncodeCheckpoint(const SpoolCheckpoint& checkpoint);
// None: damaged.
std::optional<SpoolCheckpoint> DecodeCheckpoint(std::string_view bytes);

// Of a whole file; more is damage.
inline constexpr size_t kMaxCheckpointBytes = size_t{64} << 20;

}  // namespace rigcal::agent
