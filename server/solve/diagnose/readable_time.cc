// SPDX-License-Identifier: Apache-2.0
#include "server/solve/diagnose/readable_time.h"

#include <cmath>

#include "absl/strings/str_format.h"

namespace rigcal::server {

ReadableTime ReadableTimeOf(double time_s) {
  const double size_s = std::abs(time_s);
  if (size_s < 10) return {1e3 * time_s, "ms"};
  if (size_s < 600) return {time_s, "s"};
  if (size_s < 7200) return {time_s / 60, "min"};
  return {time_s / 3600, "h"};
}

std::string FormatTime(double time_s) {
  const ReadableTime time = ReadableTimeOf(time_s);
  return absl::StrFormat("%.2f %s", std::abs(time.value), time.unit);
}

}  // namespace rigcal::server
