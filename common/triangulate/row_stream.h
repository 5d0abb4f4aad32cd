// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/calibration/calibration.h"
#include "common/target/observation.h"
#include "common/triangulate/triangulate_rows.h"

namespace rigcal {

struct RowStreamOptions {
  TriangulationOptions triangulation;
  // Cameras that will deliver rows; empty: those of the calibration.
  std::vector<std::string> cameras;
  // Points are made for so much time at once, seconds: 0.1 to 5. What rows belong together is
  // decided on so many of them.
  double block_s = 0.5;
  // Nobody waits for a camera whose rows are so much behind those of another one, seconds.
  double max_delay_s = 2;
  size_t max_rows = 200'000;  // that wait

  // INVALID_ARGUMENT lists every fault.
  absl::Status Validate() const;
};

// Triangulates rows as they come, with what TriangulateRows does to all of them at once: a block of
// time when every camera is past it, with the rows around it, which say how the image moves. Memory
// is bounded. For one thread at a time.
class RowStream {
 public:
  // INVALID_ARGUMENT: options; a camera that the calibration does not have. FAILED_PRECONDITION:
  // the scale of the calibration is not known.
  static absl::StatusOr<RowStream> Create(CalibrationResult calibration, RowStreamOptions options);

  // Rows of one camera, ascending in time. Rows that are not after the last one, or whose time has
  // been triangulated already, are counted and left out. INVALID_ARGUMENT: no such camera, another
  // number of markers than before, more than kMaxStreamMarkers. RESOURCE_EXHAUSTED: more than
  // `max_rows` wait.
  absl::Status Add(const std::string& camera, const std::vector<Observation>& rows);
  // The points of the blocks that are complete since the last call; `end`: all that is left.
  absl::StatusOr<Triangulation> Take(bool end);

  uint64_t late_row_count() const { return late_row_count_; }
  size_t waiting_row_count() const;
  const CalibrationResult& calibration() const { return calibration_; }

 private:
  struct Track {
    size_t camera = 0;              // index in the calibration
    std::vector<Observation> rows;  // with some that have been triangulated: how the image moves
    int64_t last_ns = 0;            // rig time of the newest row that came; 0 rows: none came
    bool has_rows = false;
  };

  RowStream(CalibrationResult calibration, RowStreamOptions options);
  int64_t RigTimeOf(const Track& track, const Observation& row) const;
  // Rig time up to which every camera that is waited for has delivered.
  int64_t HorizonNs() const;
  double LongestPeriodS() const;
  void ForgetBefore(int64_t rig_time_ns);

  CalibrationResult calibration_;
  RowStreamOptions options_;
  std::map<std::string, Track> tracks_;
  size_t marker_count_ = 0;  // 0: no row came yet
  int64_t from_ns_;          // what is before is done
  uint64_t late_row_count_ = 0;
};

// Of one row of a stream.
inline constexpr size_t kMaxStreamMarkers = 256;

}  // namespace rigcal
