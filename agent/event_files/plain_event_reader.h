// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "agent/event/event_decoder.h"
#include "agent/event/plain_events.h"
#include "common/status/refusal.h"

namespace rigcal::agent {

// What the times in a file for interchange are. kAuto: HDF5: whole numbers are microseconds,
// fractions are seconds. CSV: as its column's name says (t_us, t_s, t_ns); else seconds where one
// of the first lines has a fraction that is not zero, microseconds where none has.
enum class TimeUnit : uint8_t { kAuto, kSeconds, kMicroseconds, kNanoseconds };

// "seconds" and so on.
std::string TimeUnitName(TimeUnit unit);
// From "s", "us", "ns" or "auto"; none: another text.
std::optional<TimeUnit> ParseTimeUnit(std::string_view text);

// How a file for interchange is to be read, where it does not say so itself.
struct PlainFileOptions {
  TimeUnit time_unit = TimeUnit::kAuto;
  std::string columns = "xypt";  // of a CSV file without a header line
};

// What such a file says about itself.
struct PlainFileFacts {
  std::string format;  // "HDF5", "CSV"
  std::string layout;  // where its events stand: "/CD/events", "x,y,p,t"
  TimeUnit time_unit = TimeUnit::kMicroseconds;
  std::optional<SensorGeometry> geometry;     // none: the file does not say
  std::map<std::string, std::string> fields;  // its other attributes or comments, as text
};

// Reads the events of a file for interchange in order, a block at a time, in bounded memory. One
// thread at a time.
class PlainEventReader {
 public:
  virtual ~PlainEventReader() = default;

  virtual const PlainFileFacts& facts() const = 0;
  // Replaces `events` by the next ones, at most `max_count`; none: the end. DATA_LOSS: the file
  // cannot be read on; names the file and the place.
  virtual absl::Status Read(size_t max_count, std::vector<PlainEvent>* events) = 0;
  // Of event `index` of the last block read: "line 17", "row 3 of /CD/events" (from 0).
  virtual std::string PlaceOf(size_t index) const = 0;
  // What was left out, by reason. `camera` is left empty.
  virtual std::vector<Refusal> Refused() const { return {}; }
};

}  // namespace rigcal::agent
