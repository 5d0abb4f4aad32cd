// SPDX-License-Identifier: Apache-2.0
#include "tests/testing/event_streams.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <random>

namespace rigcal::testing {
namespace {

using agent::CdEvent;

constexpr std::array<double, 3> kDiameterPx = {20, 25, 30};
constexpr double kStepUs = 50;
constexpr int kEdgeCount = 6;

// Lit pixels of a disc before and after one time step.
class DiscPainter {
 public:
  DiscPainter(const EventStreamOptions& options, std::mt19937* random, std::vector<CdEvent>* events)
      : options_(options),
        random_(*random),
        events_(*events),
        bright_(static_cast<size_t>(kStreamGeometry.width) * kStreamGeometry.height, false) {}

  void Step(int disc, double time_us) {
    const DiscCentre centre = DiscAt(options_, disc, time_us);
    const double phase = time_us * 1e-6 * options_.blink_hz;
    const bool lit = phase - std::floor(phase) < 0.5;
    const int reach = static_cast<int>(centre.radius_px) + 2;
    const int x_middle = static_cast<int>(centre.x_px), y_middle = static_cast<int>(centre.y_px);
    for (int y = y_middle - reach; y <= y_middle + reach; ++y) {
      row_delay_us_ = static_cast<double>(random_() % 50);
      for (int x = x_middle - reach; x <= x_middle + reach; ++x) {
        const bool now = lit && std::hypot(x - centre.x_px, y - centre.y_px) < centre.radius_px;
        const size_t pixel =
            static_cast<size_t>(y) * kStreamGeometry.width + static_cast<size_t>(x);
        if (bright_[pixel] != now) Flip(x, y, now, time_us);
        bright_[pixel] = now;
      }
    }
  }

 private:
  void Flip(int x, int y, bool on, double time_us) {
    for (int i = 0; i < options_.events_per_flip; ++i) {
      const double later_us = options_.rows_together
                                  ? row_delay_us_ + 100.0 * i
                                  : static_cast<double>(random_() % 150) + 150.0 * i;
      events_.push_back({static_cast<int64_t>(time_us + later_us), static_cast<uint16_t>(x),
                         static_cast<uint16_t>(y), on});
    }
  }

  const EventStreamOptions& options_;
  std::mt19937& random_;
  std::vector<CdEvent>& events_;
  std::vector<bool> bright_;
  double row_delay_us_ = 0;
};

void AddNoise(const EventStreamOptions& options, std::mt19937* random,
              std::vector<CdEvent>* events) {
  const auto count = static_cast<size_t>(options.noise_per_s * options.duration_s);
  std::uniform_int_distribution<int64_t> time(0, static_cast<int64_t>(options.duration_s * 1e6));
  for (size_t i = 0; i < count; ++i) {
    events->push_back({time(*random), static_cast<uint16_t>((*random)() % kStreamGeometry.width),
                       static_cast<uint16_t>((*random)() % kStreamGeometry.height),
                       ((*random)() & 1) != 0});
  }
}

// Vertical edges moving to the right: each column they reach fires over its whole height.
void AddEdges(const EventStreamOptions& options, std::mt19937* random,
              std::vector<CdEvent>* events) {
  const double columns_per_s = options.edges_per_s / kStreamGeometry.height / kEdgeCount;
  const double step_s = 1 / columns_per_s;
  for (int edge = 0; edge < kEdgeCount; ++edge) {
    const uint32_t first = static_cast<uint32_t>(edge) * kStreamGeometry.width / kEdgeCount;
    uint32_t column = first;
    for (double t = 0; t < options.duration_s - 0.01; t += step_s) {
      column = (column + 1) % kStreamGeometry.width;
      for (uint32_t y = 0; y < kStreamGeometry.height; ++y) {
        const auto jitter = static_cast<int64_t>((*random)() % 3000);
        events->push_back({static_cast<int64_t>(t * 1e6) + jitter, static_cast<uint16_t>(column),
                           static_cast<uint16_t>(y), edge % 2 == 0});
      }
    }
  }
}

}  // namespace

std::vector<EventStreamOptions> BenchStreams() {
  std::vector<EventStreamOptions> streams(4);
  streams[0].name = "5.6M";
  streams[0].noise_per_s = 1.0e6, streams[0].edges_per_s = 1.18e6;
  streams[1].name = "9.6M";
  streams[1].noise_per_s = 5.0e6, streams[1].edges_per_s = 1.15e6;
  streams[2].name = "22.4M";
  streams[2].noise_per_s = 11.0e6, streams[2].edges_per_s = 8.0e6;
  streams[3].name = "rows";
  streams[3].noise_per_s = 0.1e6, streams[3].edges_per_s = 0, streams[3].rows_together = true;
  // Twelve times the light: discs whose rows are read out at once.
  streams[3].events_per_flip = 4;
  for (size_t i = 0; i < streams.size(); ++i) streams[i].seed = static_cast<uint32_t>(i + 1);
  return streams;
}

DiscCentre DiscAt(const EventStreamOptions& options, int disc, double time_us) {
  constexpr std::array<double, 3> kStartX = {60, 130, 270};
  DiscCentre centre;
  centre.radius_px = kDiameterPx[static_cast<size_t>(disc)] / 2;
  centre.x_px = kStartX[static_cast<size_t>(disc)] + options.speed_px_s * 1e-6 * time_us;
  centre.y_px =
      300.4 + 0.2 * kStartX[static_cast<size_t>(disc)] + 0.3 * options.speed_px_s * 1e-6 * time_us;
  return centre;
}

EventStream MakeEventStream(const EventStreamOptions& options) {
  EventStream stream;
  std::mt19937 random(options.seed);
  {
    DiscPainter painter(options, &random, &stream.events);
    for (double t = 0; t < options.duration_s * 1e6; t += kStepUs) {
      for (int disc = 0; disc < 3; ++disc) painter.Step(disc, t);
    }
  }
  const auto wand = static_cast<double>(stream.events.size());
  AddNoise(options, &random, &stream.events);
  const double with_noise = static_cast<double>(stream.events.size());
  if (options.edges_per_s > 0) AddEdges(options, &random, &stream.events);
  const auto all = static_cast<double>(stream.events.size());
  stream.wand_share = wand / all;
  stream.noise_share = (with_noise - wand) / all;
  stream.edge_share = (all - with_noise) / all;
  std::stable_sort(stream.events.begin(), stream.events.end(),
                   [](const CdEvent& a, const CdEvent& b) {
                     if (a.time_us != b.time_us) return a.time_us < b.time_us;
                     if (a.y != b.y) return a.y < b.y;
                     if (a.on != b.on) return b.on;
                     return a.x < b.x;
                   });
  agent::Evt3Writer().Write(stream.events, &stream.evt3);
  return stream;
}

}  // namespace rigcal::testing
