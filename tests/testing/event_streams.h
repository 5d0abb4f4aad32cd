// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "agent/event/evt3_writer.h"

namespace rigcal::testing {

// One second of events, for benchmarks and for comparing decoders and filters: three
// blinking discs of 20, 25 and 30 pixels moving side by side, noise everywhere, and a moving comb
// of vertical edges. For sensor physics see common/simulation.
struct EventStreamOptions {
  std::string name;
  double noise_per_s = 1e6;    // events, all pixels together
  double edges_per_s = 1.2e6;  // events, all edges together
  bool rows_together = false;  // all changes of a row in one step are read out together
  double duration_s = 1;
  double blink_hz = 500;
  double speed_px_s = 550;
  int events_per_flip = 2;
  uint32_t seed = 1;
};

inline constexpr agent::SensorGeometry kStreamGeometry{1280, 720};

struct EventStream {
  std::vector<agent::CdEvent> events;  // by time
  std::vector<uint8_t> evt3;           // words, no header
  double wand_share = 0, noise_share = 0, edge_share = 0;
};

// 5.6, 9.6 and 22.4 million events per second, and one in which rows fire together.
std::vector<EventStreamOptions> BenchStreams();
EventStream MakeEventStream(const EventStreamOptions& options);

// Centre of disc 0, 1 or 2.
struct DiscCentre {
  double x_px = 0;
  double y_px = 0;
  double radius_px = 0;
};
DiscCentre DiscAt(const EventStreamOptions& options, int disc, double time_us);

}  // namespace rigcal::testing
