// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "agent/event_files/event_file.h"
#include "agent/event_files/event_file_writer.h"

namespace rigcal::agent {

struct ConversionOptions {
  std::string in;
  std::string out;                         // its ending names the format
  std::optional<SensorGeometry> geometry;  // if the file has none
  EventFileOptions plain;                  // how the file is to be read
  std::string layout = "compound";         // of HDF5: compound or events
  EventFormat raw = EventFormat::kEvt3;    // of RAW: kEvt3 or kEvt2
  bool force = false;                      // replace a file that is there
  EventsRead on_read;                      // may be null
};

struct ConversionSummary {
  uint64_t cd_events = 0, trigger_events = 0;  // read
  EventFaults faults;
  std::vector<Refusal> refused;  // lines that are not events
  WriterLosses losses;
};

// Reads a file of events and writes it in another format. The new file appears under its name when
// it is complete.
//
// ALREADY_EXISTS: `out` exists and force is false. INVALID_ARGUMENT, NOT_FOUND,
// FAILED_PRECONDITION: as OpenEventFile and CreateEventFileWriter. DATA_LOSS: reading or
// writing failed on the way.
absl::StatusOr<ConversionSummary> ConvertEventFile(const ConversionOptions& options);

}  // namespace rigcal::agent
