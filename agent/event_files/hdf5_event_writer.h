// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "agent/event_files/event_file_writer.h"

namespace rigcal::agent {

enum class Hdf5EventLayout : uint8_t {
  kCompound,  // /CD/events and /EXT_TRIGGER/events
  kColumns,   // /events/x, y, p, t; no triggers
};

// Writes an HDF5 file as OpenHdf5Events reads it, compressed with HDF5's own filters (shuffle,
// deflate). Prophesee's tools do not open it: they decode every chunk with their own codec.
// /EXT_TRIGGER/cd_events_before keeps the number of events before each trigger, so
// that the order of the stream is kept. Attributes of the file: geometry, width, height and the
// fields.
//
// FAILED_PRECONDITION: the file cannot be created.
absl::StatusOr<std::unique_ptr<PlainEventWriter>> CreateHdf5EventWriter(const std::string& path,
                                                                        const PlainFileFront& front,
                                                                        Hdf5EventLayout layout);

}  // namespace rigcal::agent
