// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "agent/event_files/plain_event_reader.h"

namespace rigcal::agent {

// Opens an HDF5 file of events. Known layouts:
//
//   /CD/events         compound x, y, p, t, and /EXT_TRIGGER/events compound p, t, id
//   /events            compound x, y, p, t
//   /events/x, y, p, t or xs, ys, ps, ts: one dataset each, of one length; with /t_offset
//                      (microseconds) added to whole-numbered times, as DSEC has it
//
// x, y: whole numbers; p: 0/1, -1/1 or bool; t: see TimeUnit. A value that is none of these makes
// its row unreadable. Triggers are merged in by time, or at the places that this project's writer
// noted. The geometry is that of an attribute of the file or its groups: geometry = "640x480",
// width and height, or sensor_resolution (two numbers, the larger is the width).
//
// NOT_FOUND, PERMISSION_DENIED: no such file, or not to be opened. INVALID_ARGUMENT: not HDF5 or
// damaged, none of these layouts, wrong types, lengths that differ, a filter that is not installed
// here, chunks too large to hold. Each names the file, the dataset, why and what to do.
absl::StatusOr<std::unique_ptr<PlainEventReader>> OpenHdf5Events(const std::string& path,
                                                                 const EventFileOptions& options);

}  // namespace rigcal::agent
