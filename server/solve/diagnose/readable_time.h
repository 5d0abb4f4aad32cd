// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace rigcal::server {

// A time as people read it: ms below 10 s, s below 10 min, min below 2 h, else h.
struct ReadableTime {
  double value = 0;  // with the sign of the time
  std::string unit;
};
ReadableTime ReadableTimeOf(double time_s);

// Its size without the sign, two decimals: "8.05 ms", "2.50 h".
std::string FormatTime(double time_s);

}  // namespace rigcal::server
