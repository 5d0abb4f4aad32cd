// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "agent/event_files/hdf5_layout.h"
#include "agent/event_files/plain_event_reader.h"

namespace rigcal::agent {

// Makes events and triggers of rows of an HDF5 file's columns, with times in microseconds; a row
// whose values make none becomes PlainEvent::kUnreadable. Hold an Hdf5Lock around everything, the
// end included. One thread at a time.
class Hdf5RowReader {
 public:
  // The layout's times are of `unit`, which is not kAuto.
  Hdf5RowReader(Hdf5Layout layout, TimeUnit unit);

  // Replaces `events` by `count` rows from `first`, which must be there. DATA_LOSS: they cannot be
  // read.
  absl::Status ReadEvents(uint64_t first, size_t count, std::vector<PlainEvent>* events);
  // Likewise, of a layout with triggers. `events_before`: the number of events before
  // each; empty if the file does not have it.
  absl::Status ReadTriggers(uint64_t first, size_t count, std::vector<PlainEvent>* triggers,
                            std::vector<int64_t>* events_before);

 private:
  // As Prophesee's own files have it, and this project's.
  struct NarrowRow {
    uint16_t x, y;
    int16_t p;
    int64_t t;
  };

  bool IsNarrow() const;
  absl::Status ReadTimes(const Hdf5Column& column, uint64_t first, size_t count);
  void SetTime(size_t index, PlainEvent* event) const;

  Hdf5Layout layout_;
  TimeUnit time_unit_;
  Hdf5Handle narrow_type_;  // none: rows are not narrow
  std::vector<int32_t> x_, y_, p_;
  std::vector<int64_t> whole_times_;
  std::vector<double> fractional_times_;
  std::vector<NarrowRow> narrow_rows_;
};

}  // namespace rigcal::agent
