// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "agent/event_files/event_file.h"

namespace rigcal::agent {

// Edges of one kind at one external-trigger input.
struct TriggerEdges {
  uint64_t count = 0;
  int64_t first_us = 0;
  int64_t last_us = 0;
  // Between neighbours in one clock epoch; 0: fewer than two.
  int64_t shortest_gap_us = 0;
  int64_t longest_gap_us = 0;
};

// What is in a file of events.
struct EventFileInfo {
  std::string path;
  uint64_t byte_count = 0;
  EventFileHeader header;
  uint64_t cd_events = 0, on_events = 0;
  uint64_t sum_x = 0, sum_y = 0;  // of all CD events: to compare two decoders
  uint32_t largest_x = 0, largest_y = 0;
  uint64_t trigger_events = 0;
  std::map<int, TriggerEdges> rising, falling;  // by channel
  // Of the first and the last event, CD or trigger, of the sensor's clock; none: no event.
  std::optional<int64_t> first_us, last_us;
  int64_t duration_us = 0;  // in all clock epochs together
  EventFaults faults;
  // Where the first fault of each kind is, by the name of its count: "byte 4096", "line 17".
  std::map<std::string, std::string> first_faults;
  // If events contradict the geometry: the smallest that holds all of them.
  std::optional<SensorGeometry> extent;
  std::vector<Refusal> refused;  // lines that are no events
  // The smallest step from one time to another one, and how many such steps there are.
  int64_t shortest_step_us = 0;
  uint64_t step_count = 0;

  // Silence of the whole sensor while the scene fires (EventGaps).
  uint64_t gaps = 0, gap_us = 0;

  // What cannot be as the file or the options say, each with what to do about it.
  std::vector<std::string> Notes() const;

  uint64_t off_events() const { return cd_events - on_events; }
  double events_per_s() const {
    return duration_us > 0 ? static_cast<double>(cd_events) * 1e6 / static_cast<double>(duration_us)
                           : 0;
  }
};

// Decodes all of a file. `geometry`: where the file does not say; without either every pixel that
// the format can name is taken. Errors as OpenEventFile's.
absl::StatusOr<EventFileInfo> ReadEventFileInfo(const std::string& path,
                                                std::optional<SensorGeometry> geometry,
                                                const EventFileOptions& plain = {},
                                                const EventsRead& on_read = nullptr);

// For people.
std::string FormatInfo(const EventFileInfo& info);
// One JSON object, with a line end.
std::string InfoJson(const EventFileInfo& info);

}  // namespace rigcal::agent
