// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "agent/event/event.h"
#include "agent/event/event_decoder.h"

namespace rigcal::agent {

// One change of brightness with its full time.
struct CdEvent {
  int64_t time_us = 0;
  uint16_t x = 0;
  uint16_t y = 0;
  bool on = false;

  friend bool operator==(const CdEvent&, const CdEvent&) = default;
};

// The text in front of a RAW file in EVT 3.0.
std::string Evt3Header(SensorGeometry geometry, const std::string& serial_number);

// Encodes events as EVT 3.0. Time must not step backwards; events of one time, row and polarity
// that stand side by side in rising columns become vectors of 12, 12 and 8 columns, always all
// three, as a sensor's readout makes them.
class Evt3Writer {
 public:
  // Appends words to `bytes`. Columns and rows are below 2048.
  void Write(std::span<const CdEvent> events, std::vector<uint8_t>* bytes);
  void Write(const TriggerEvent& trigger, std::vector<uint8_t>* bytes);
  // Writes the time without an event, so that a decoder knows that nothing happened.
  void WriteTime(int64_t time_us, std::vector<uint8_t>* bytes);

 private:
  void WriteRun(std::span<const CdEvent> run, std::vector<uint8_t>* bytes);

  std::optional<int64_t> high_;
  uint32_t low_ = 0;
  std::optional<uint16_t> y_;
};

}  // namespace rigcal::agent
