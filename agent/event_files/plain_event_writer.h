// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>

#include "absl/status/status.h"
#include "agent/event/event_decoder.h"
#include "agent/event/plain_events.h"

namespace rigcal::agent {

// Header of a new file.
struct PlainFileFront {
  std::optional<SensorGeometry> geometry;
  std::map<std::string, std::string> fields;  // "serial_number" and so on, if the format allows
};

// What a file's format could not hold.
struct WriterLosses {
  uint64_t triggers = 0;      // left out: no triggers, or none of this channel
  uint64_t moved_events = 0;  // written with a time that is at most 1 ms too late
};

// Writes events into a file for interchange. One thread at a time. Errors name the file.
class PlainEventWriter {
 public:
  virtual ~PlainEventWriter() = default;

  // Events in the order of their stream. FAILED_PRECONDITION: a time that the format cannot hold.
  // DATA_LOSS: the file cannot be written.
  virtual absl::Status Write(std::span<const PlainEvent> events) = 0;
  // Once, at the end: completes and closes the file. DATA_LOSS.
  virtual absl::Status Finish() = 0;
  virtual WriterLosses losses() const = 0;
};

}  // namespace rigcal::agent
