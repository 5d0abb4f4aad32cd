// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "agent/event/event_decoder.h"
#include "agent/event/plain_events.h"
#include "common/options/option_table.h"
#include "common/status/refusal.h"

namespace rigcal::agent {

// Unit of the times in a file for interchange. kAuto: in HDF5 whole numbers are microseconds and
// fractions seconds; in CSV the unit of the column's name (t_us, t_s, t_ns), else seconds if one of
// the first lines has a fraction that is not zero, else microseconds.
enum class TimeUnit : uint8_t { kAuto, kSeconds, kMicroseconds, kNanoseconds };

// "seconds" and so on.
std::string TimeUnitName(TimeUnit unit);

// How a file for interchange is read, if it does not say so itself.
struct PlainFileOptions {
  TimeUnit time_unit = TimeUnit::kAuto;
  std::string columns = "xypt";  // of a CSV file without a header line
};

// "time" and "columns"
void AddOptions(PlainFileOptions* options, OptionTable* table);

// Facts that such a file states itself.
struct PlainFileFacts {
  std::string format;  // "HDF5", "CSV"
  std::string layout;  // place of its events: "/CD/events", "x,y,p,t"
  TimeUnit time_unit = TimeUnit::kMicroseconds;
  std::optional<SensorGeometry> geometry;     // none: not stated
  std::map<std::string, std::string> fields;  // its other attributes or comments, as text
};

// Reads the events of a file for interchange in order, a block at a time, in bounded memory. One
// thread at a time.
class PlainEventReader {
 public:
  virtual ~PlainEventReader() = default;

  virtual const PlainFileFacts& facts() const = 0;
  // Replaces `events` by the next ones, at most `max_count`; none: the end. DATA_LOSS: reading
  // failed; names the file and the place.
  virtual absl::Status Read(size_t max_count, std::vector<PlainEvent>* events) = 0;
  // Of event `index` of the last block read: "line 17", "row 3 of /CD/events" (from 0).
  virtual std::string PlaceOf(size_t index) const = 0;
  // Lines left out, by reason. `camera` is left empty.
  virtual std::vector<Refusal> Refused() const { return {}; }
};

}  // namespace rigcal::agent
