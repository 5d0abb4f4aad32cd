// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "rigcal/v1/live.pb.h"

namespace rigcal::client {

// How the live state is written for people.

struct LiveScreenOptions {
  size_t columns = 80;
  size_t rows = 24;
  bool colour = false;
  bool all = false;  // cameras by name and all alerts, however many there are
  std::string server = {};
  double age_s = 0;          // since the server last answered
  std::string problem = {};  // why it does not; empty: it does
  std::string message = {};  // what the last key has done
};

// The whole screen: at most `rows` lines of at most `columns` columns; the first ones matter most.
std::vector<std::string> FormatLiveScreen(const rigcal::v1::LiveState& live,
                                          const LiveScreenOptions& options);
// One line without its end: state, elapsed, figure, cameras, worst camera, advice, alerts.
std::string FormatLiveLine(const rigcal::v1::LiveState& live);

}  // namespace rigcal::client
