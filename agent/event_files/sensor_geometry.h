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
inline constexpr SensorGeometry kWholeSensor{kMaxSensorSide, kMaxSensorSide};
inline constexpr SensorGeometry kWholePlainSensor{65535, 65535};

// 1 to kMaxSensorSide pixels each way.
bool IsSensorGeometry(const SensorGeometry& geometry);
// "1280x720"; none: another text or size.
std::optional<SensorGeometry> ParseSensorGeometry(std::string_view text);
std::string FormatSensorGeometry(const SensorGeometry& geometry);
// "geometry"
void AddGeometry(std::optional<SensorGeometry>* geometry, OptionTable* table);

}  // namespace rigcal::agent
