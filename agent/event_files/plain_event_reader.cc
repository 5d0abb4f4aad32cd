// SPDX-License-Identifier: Apache-2.0
#include "agent/event_files/plain_event_reader.h"

namespace rigcal::agent {

std::string TimeUnitName(TimeUnit unit) {
  switch (unit) {
    case TimeUnit::kSeconds:
      return "seconds";
    case TimeUnit::kMicroseconds:
      return "microseconds";
    case TimeUnit::kNanoseconds:
      return "nanoseconds";
    case TimeUnit::kAuto:
      break;
  }
  return "a unit still to be told";
}

std::optional<TimeUnit> ParseTimeUnit(std::string_view text) {
  if (text == "s") return TimeUnit::kSeconds;
  if (text == "us") return TimeUnit::kMicroseconds;
  if (text == "ns") return TimeUnit::kNanoseconds;
  if (text == "auto") return TimeUnit::kAuto;
  return std::nullopt;
}

}  // namespace rigcal::agent
