// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "agent/event/event_words.h"
#include "common/options/option_table.h"

namespace rigcal::agent {

inline constexpr uint32_t kMaxSensorSide = 2048;  // EVT words hold 11 bits
// Every pixel that a file of words, or one for interchange, can name.
constexpr SensorGeometry EveryPixel(EventFormat format) {
  if (format == EventFormat::kPlain) return {65535, 65535};
  return {kMaxSensorSide, kMaxSensorSide};
}

// "1280x720" or its two numbers; none: another text, or not 1 to kMaxSensorSide pixels each way.
std::optional<SensorGeometry> ParseSensorGeometry(std::string_view text);
std::optional<SensorGeometry> ParseSensorGeometry(std::string_view width, std::string_view height);
std::string FormatSensorGeometry(const SensorGeometry& geometry);
// "geometry"
void AddGeometry(std::optional<SensorGeometry>* geometry, OptionTable* table);

}  // namespace rigcal::agent
