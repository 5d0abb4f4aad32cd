// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "agent/event/event.h"
#include "agent/event/event_words.h"
#include "agent/event/evt3_writer.h"

namespace rigcal::agent {

// The text in front of a RAW file in EVT 2.0.
std::string Evt2Header(SensorGeometry geometry, const std::string& serial_number);

// Encodes events as EVT 2.0 (docs.prophesee.ai, "EVT 2.0 Format"): a word of 32 bits for each, the
// time's upper bits in TIME_HIGH words of their own, every 64 us. Time must not step backwards.
class Evt2Writer {
 public:
  // Times that the format holds: 34 bits, 4 hours and 46 minutes.
  static constexpr int64_t kMaxTimeUs = (int64_t{1} << 34) - 1;

  // Appends words to `bytes`. Columns and rows are below 2048, channels below 32.
  void Write(std::span<const CdEvent> events, std::vector<uint8_t>* bytes);
  void Write(const TriggerEvent& trigger, std::vector<uint8_t>* bytes);

 private:
  // Returns the lower bits, where an event's word has them.
  uint32_t WriteTime(int64_t time_us, std::vector<uint8_t>* bytes);

  std::optional<int64_t> high_;
};

}  // namespace rigcal::agent
