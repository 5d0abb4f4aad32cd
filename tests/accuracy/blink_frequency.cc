// SPDX-License-Identifier: Apache-2.0
// The detection rate of event cameras against the frequency at which the wand blinks, after the
// figure in the eWand paper:
//
//   build/release/tests/accuracy.blink_frequency --csv blink.csv --png blink.png
//
// A pixel tells no change for its refractory period after each event. Held longer than half a
// blink, it misses changes. The textbook's chain, as the paper describes it (tests/testing/
// textbook_events.h), asks every pixel for both changes of every blink and falls first; this
// detector needs a few pixels of a marker to find it, and takes all that lit up once it has.
#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <fstream>
#include <string>
#include <vector>

#include "tests/accuracy/blink_frequency_experiment.h"
#include "tests/accuracy/blink_frequency_plot.h"

namespace rigcal::accuracy {
namespace {

int Run(const BlinkFrequencyOptions& options, const std::string& csv, const std::string& png) {
  const EventRenderOptions& sensor = options.detection.sensor;
  fmt::print(
      "refractory period {} us, one sigma over the pixels {} %; latency at the LED's light {} us,\n"
      "{:.2f} times that in the dark; noise {:.1f} Mev/s; wand {} to {} m, up to {} m/s\n\n"
      "            wands          false  error px  textbook\n"
      "blink Hz    shown  found %  wands       rms   found %\n",
      sensor.refractory_us, 100 * sensor.refractory_spread, sensor.latency_us,
      1 + 19 * sensor.latency_slowdown, 1e-6 * sensor.background_hz * 1280 * 720,
      options.detection.pose.min_distance_m, options.detection.pose.max_distance_m,
      options.detection.pose.speed_m_s);
  BlinkFrequencyOptions one = options;
  std::vector<BlinkFrequencyPoint> points;
  int failures = 0;
  for (const double hz : options.blink_hz) {
    one.blink_hz = {hz};
    for (const BlinkFrequencyPoint& point : RunBlinkFrequency(one)) {
      const EventDetectionSummary& s = point.summary;
      fmt::print("{:8.0f} {:8} {:8.1f} {:6} {:9.3f} {:9.1f}\n", hz, s.wands_shown,
                 100 * point.WandRate(), s.false_wands, s.wands.rms_px, 100 * point.TextbookRate());
      std::fflush(stdout);
      failures += s.failures;
      points.push_back(point);
    }
  }
  if (failures > 0) {
    fmt::print(stderr, "{} streams could not be rendered or searched\n", failures);
    return 1;
  }
  if (!csv.empty()) {
    std::ofstream file(csv);
    file << BlinkFrequencyCsv(options, points);
    file.close();
    if (!file) {
      fmt::print(stderr, "{}: cannot write the table; does its folder exist?\n", csv);
      return 1;
    }
  }
  if (png.empty()) return 0;
  const absl::Status drawn = DrawBlinkFrequency(options, points, png);
  if (!drawn.ok()) fmt::print(stderr, "{}\n", std::string(drawn.message()));
  return drawn.ok() ? 0 : 1;
}

}  // namespace
}  // namespace rigcal::accuracy

int main(int argc, char** argv) {
  using namespace rigcal::accuracy;
  BlinkFrequencyOptions options = PaperBlinkFrequency();
  rigcal::EventRenderOptions& sensor = options.detection.sensor;
  std::string csv, png;
  int seed = 1;
  options.detection.streams = 20;
  CLI::App app("detection rate of event cameras against the wand's blink frequency");
  app.option_defaults()->always_capture_default();
  app.add_option("--csv", csv, "file to write the table to");
  app.add_option("--png", png, "file to draw the figure to");
  app.add_option("--hz", options.blink_hz, "frequencies, ascending")
      ->check(CLI::Range(20.0, 5000.0));
  app.add_option("--streams", options.detection.streams, "of each frequency, about 6 answers each")
      ->check(CLI::Range(1, 100000));
  app.add_option("--seed", seed, "of poses, pixels and noise")->check(CLI::Range(0, 40000));
  app.add_option("--threads", options.detection.threads, "streams at the same time")
      ->check(CLI::Range(1, 256));
  app.add_option("--refractory", sensor.refractory_us, "period of a pixel, us")
      ->check(CLI::Range(0.0, 1e5));
  app.add_option("--spread", sensor.refractory_spread, "of that, one sigma, relative")
      ->check(CLI::Range(0.0, 0.3));
  app.add_option("--latency", sensor.latency_us, "time constant at the LED's light, us")
      ->check(CLI::Range(0.0, 1e4));
  CLI11_PARSE(app, argc, argv);
  options.detection.seed = static_cast<uint32_t>(seed);
  return Run(options, csv, png);
}
