// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "agent/event/event.h"
#include "agent/event/event_decoder.h"
#include "agent/event_files/plain_event_reader.h"
#include "common/status/refusal.h"

namespace rigcal::agent {

// Facts that a file of events states itself.
struct EventFileHeader {
  EventFormat format = EventFormat::kEvt3;
  bool halves_swapped = false;             // EVT 2.1 as an IMX636 sends it
  std::string format_name;                 // "EVT3", "HDF5", "CSV"
  std::string layout;                      // of HDF5 and CSV: dataset or columns
  TimeUnit time_unit = TimeUnit::kAuto;    // of HDF5 and CSV, never kAuto there
  std::optional<SensorGeometry> geometry;  // none: not stated
  uint64_t byte_count = 0;                 // of RAW: the events begin here
  std::map<std::string, std::string> fields;
};

// A file of events, read in blocks as a stream of words; in bounded memory, however large the file.
// One thread at a time.
class EventFile {
 public:
  virtual ~EventFile() = default;

  virtual const EventFileHeader& header() const = 0;
  virtual uint64_t byte_count() const = 0;  // of the whole file on disk
  // Of the next piece in the stream of words: of RAW in the file, of others from its first event.
  virtual uint64_t byte_offset() const = 0;
  // The next piece of at most `max_bytes`, which must be a multiple of 16: whole words, except at
  // the end of a truncated RAW file. Empty: the end. Valid until the next call. DATA_LOSS: reading
  // failed; the message has the place.
  virtual absl::StatusOr<std::span<const uint8_t>> Next(size_t max_bytes) = 0;
  // Place of a word of the last piece, for messages: "byte 4096", "line 17", "row 3 of /CD/events".
  virtual std::string PlaceOf(uint64_t byte_offset) const = 0;
  // Input that was left out before it became a word, by reason. `camera` is left empty.
  virtual std::vector<Refusal> Refused() const { return {}; }
};

// Opens a RAW, HDF5 or CSV file; the format is detected from its first bytes, not from its name.
//
// NOT_FOUND, PERMISSION_DENIED, FAILED_PRECONDITION: the file does not exist or cannot be read.
// INVALID_ARGUMENT: another format, or damaged at its beginning (ParseRawHeader, OpenHdf5Events,
// OpenCsvEvents). Each names the file.
absl::StatusOr<std::unique_ptr<EventFile>> OpenEventFile(const std::string& path,
                                                         const PlainFileOptions& options = {});

// The geometry of the file or, if it has none, `given`. INVALID_ARGUMENT: they differ.
absl::StatusOr<std::optional<SensorGeometry>> GeometryOf(
    const std::string& path, const EventFileHeader& header,
    const std::optional<SensorGeometry>& given);

}  // namespace rigcal::agent
