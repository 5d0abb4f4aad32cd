// SPDX-License-Identifier: Apache-2.0
#include "agent/event_files/sensor_geometry.h"

#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"

namespace rigcal::agent {

std::optional<SensorGeometry> ParseSensorGeometry(std::string_view text) {
  const std::pair<std::string, std::string> sides =
      absl::StrSplit(std::string(text), absl::MaxSplits('x', 1));
  return ParseSensorGeometry(sides.first, sides.second);
}

std::optional<SensorGeometry> ParseSensorGeometry(std::string_view width, std::string_view height) {
  const auto read = [](std::string_view text, uint32_t* side) {
    return absl::SimpleAtoi(std::string(text), side) && *side >= 1 && *side <= kMaxSensorSide;
  };
  SensorGeometry geometry;
  if (!read(width, &geometry.width) || !read(height, &geometry.height)) return std::nullopt;
  return geometry;
}

std::string FormatSensorGeometry(const SensorGeometry& geometry) {
  return absl::StrCat(geometry.width, "x", geometry.height);
}

void AddGeometry(std::optional<SensorGeometry>* geometry, OptionTable* table) {
  const auto read = [geometry](const std::string& text) {
    const auto parsed = ParseSensorGeometry(text);
    if (!parsed) {
      return absl::InvalidArgumentError(absl::StrCat(
          "must be WIDTHxHEIGHT, such as 1280x720, at most ", kMaxSensorSide, " each way"));
    }
    *geometry = *parsed;
    return absl::OkStatus();
  };
  table->Add("geometry", "WIDTHxHEIGHT", "of the sensor, if the file does not say", read,
             [=] { return *geometry ? FormatSensorGeometry(**geometry) : ""; });
}

}  // namespace rigcal::agent
