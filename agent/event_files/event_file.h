// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"
#include "agent/event/event_words.h"
#include "common/options/option_table.h"
#include "common/status/refusal.h"

namespace rigcal::agent {

// Unit of the times in a file for interchange. kAuto: in HDF5 whole numbers are microseconds and
// fractions seconds; in CSV the unit of the column's name (t_us, t_ms, t_s, t_ns), else seconds if
// one of the first lines has a fraction that is not zero, else microseconds.
enum class TimeUnit : uint8_t { kAuto, kSeconds, kMicroseconds, kNanoseconds, kMilliseconds };

// "seconds" and so on.
const char* TimeUnitName(TimeUnit unit);
// How many microseconds one of them is; not of kAuto.
double MicrosecondsOf(TimeUnit unit);
// What the option is called: "s".
const char* TimeUnitOption(TimeUnit unit);

// Of the words of EVT 2.1. kAuto: as the header says; headers that do not say it are of the time
// when only one order was written, the legacy one.
enum class Evt21Order : uint8_t { kAuto, kLittle, kLegacy };

// How a file is read, if it does not say so itself.
struct EventFileOptions {
  TimeUnit time_unit = TimeUnit::kAuto;
  std::string columns = "xypt";                // of a CSV file without a header line
  Evt21Order evt21_order = Evt21Order::kAuto;  // instead of what the header says
};

// "time", "columns" and "endianness"
void AddOptions(EventFileOptions* options, OptionTable* table);

// Told now and then how many events of a file have been read.
using EventsRead = std::function<void(uint64_t count)>;

// Facts that a file of events states itself.
struct EventFileHeader {
  EventFormat format = EventFormat::kPlain;
  bool halves_swapped = false;                // EVT 2.1 as an IMX636 sends it ("legacy")
  bool states_endianness = false;             // of EVT 2.1
  std::string format_name;                    // "EVT3", "HDF5", "CSV"
  std::string layout;                         // of HDF5 and CSV: dataset or columns
  TimeUnit time_unit = TimeUnit::kAuto;       // of HDF5 and CSV, never kAuto there
  std::optional<SensorGeometry> geometry;     // none: not stated
  size_t byte_count = 0;                      // of RAW: the events begin here
  std::map<std::string, std::string> fields;  // its other statements, as text
};

// INVALID_ARGUMENT.
template <typename... Pieces>
absl::Status InvalidFile(const Pieces&... what) {
  return absl::InvalidArgumentError(absl::StrCat(what...));
}

// A file of events, read in blocks as a stream of words; in bounded memory, however large the file.
// One thread at a time.
class EventFile {
 public:
  virtual ~EventFile() = default;

  const EventFileHeader& header() const { return header_; }
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

 protected:
  EventFileHeader header_;
};

// Opens a RAW, HDF5 or CSV file; the format is detected from its first bytes, not from its name.
//
// NOT_FOUND, PERMISSION_DENIED, FAILED_PRECONDITION: the file does not exist or cannot be read.
// INVALID_ARGUMENT: another format, or damaged at its beginning (ParseRawHeader, OpenHdf5Events,
// OpenCsvEvents). Each names the file.
absl::StatusOr<std::unique_ptr<EventFile>> OpenEventFile(const std::string& path,
                                                         const EventFileOptions& options = {});

// The geometry of the file or, if it has none, `given`. INVALID_ARGUMENT: they differ.
absl::StatusOr<std::optional<SensorGeometry>> GeometryOf(
    const std::string& path, const EventFileHeader& header,
    const std::optional<SensorGeometry>& given);

}  // namespace rigcal::agent
