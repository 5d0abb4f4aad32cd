// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "agent/spool/disk/disk_spool.h"
#include "tests/agent/spool/disk/model_file_system.h"
#include "tests/agent/uplink/scripted_source.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::agent {

// Row `seq` of a test stream was taken at seq * 1000 ns.
inline constexpr int64_t kRowNs = 1000;

inline DiskSpoolOptions ModelOptions() {
  DiskSpoolOptions options;
  options.folder = "/model";
  options.limit_bytes = uint64_t{1} << 20;  // segments of 64 KiB, some 1 000 rows of one marker
  options.boot = 7;
  options.has_thread = false;
  return options;
}

inline std::unique_ptr<DiskSpool> OpenSpool(ModelFileSystem& files,
                                            DiskSpoolOptions options = ModelOptions()) {
  auto spool = DiskSpool::Create(std::move(options), &files);
  EXPECT_TRUE(spool.ok()) << spool.status();
  return spool.ok() ? *std::move(spool) : nullptr;
}

// As if its process was killed.
inline void Kill(std::unique_ptr<DiskSpool>& spool, ModelFileSystem& files) {
  files.Freeze();
  spool.reset();
  files.Thaw();
}

inline void AppendRows(DiskSpool& spool, const StreamKey& stream, uint32_t first, uint32_t last) {
  for (uint32_t seq = first; seq <= last; ++seq) {
    const auto given = spool.Append(stream, MakeObservation(seq * kRowNs), {});
    ASSERT_TRUE(given.ok()) << given.status();
    ASSERT_EQ(*given, seq);
  }
}

// Everything that is sent of a stream from `from` on: what the server would have.
struct ReadStreamRows {
  std::set<uint32_t> rows;
  std::map<uint32_t, RefusalReason> dropped;  // by number
  uint32_t end_seq = 1;
};

inline ReadStreamRows ReadRows(ObservationSpool& spool, const StreamKey& stream, uint32_t from) {
  ReadStreamRows result;
  result.end_seq = from;
  // More than any test has: reading must not go round in circles.
  for (int calls = 0; calls < 100'000; ++calls) {
    const auto batch = spool.Read(stream, result.end_seq, 100);
    if (!batch.ok()) return result;
    EXPECT_TRUE(CheckShape(*batch).ok()) << CheckShape(*batch);
    if (batch->rows() == 0 && batch->dropped.empty()) return result;
    for (const DroppedRange& range : batch->dropped) {
      EXPECT_EQ(range.first_seq, result.end_seq);
      for (uint32_t i = 0; i < range.count; ++i) {
        result.dropped[range.first_seq + i] = range.reason;
      }
      result.end_seq = range.first_seq + range.count;
    }
    EXPECT_EQ(batch->first_seq, result.end_seq);
    for (size_t row = 0; row < batch->rows(); ++row) {
      const uint32_t seq = batch->first_seq + static_cast<uint32_t>(row);
      EXPECT_EQ(batch->time_ns[row], seq * kRowNs);
      EXPECT_TRUE(result.rows.insert(seq).second) << seq << " twice";
    }
    result.end_seq = batch->end_seq();
  }
  ADD_FAILURE() << "reading does not come to an end";
  return result;
}

}  // namespace rigcal::agent
