// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "agent/event_files/hdf5_column.h"
#include "agent/event_files/plain_event_reader.h"

namespace rigcal::agent {

struct Hdf5EventColumns {
  Hdf5Column x, y, p, t;
};

struct Hdf5TriggerColumns {
  Hdf5Column p, t, id;
  std::optional<Hdf5Column> events_before;  // the number of events before each
};

// Where the events of an HDF5 file are, and what it says about them; see hdf5_event_reader.h. Hold
// an Hdf5Lock around Open and the end.
struct Hdf5Layout {
  EventFileHeader header;
  Hdf5EventColumns events;
  std::optional<Hdf5TriggerColumns> triggers;
  int64_t time_offset_us = 0;  // to be added to times of whole numbers

  // INVALID_ARGUMENT: as OpenHdf5Events. `path` is for messages. The unit of times is not set.
  static absl::StatusOr<Hdf5Layout> Open(const std::string& path, hid_t file);
};

}  // namespace rigcal::agent
