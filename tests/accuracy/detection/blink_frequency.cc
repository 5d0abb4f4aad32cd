// SPDX-License-Identifier: Apache-2.0
// The detection rate of event cameras against the wand's blink frequency, after the figure in the
// eWand paper. A pixel emits no event for its refractory period after each event; if that is longer
// than half a blink, it misses changes. The textbook chain, as the paper describes it
// (tests/testing/textbook_events.h), needs both changes of every blink from every pixel and
// degrades first; this detector needs a few pixels of a marker to find it, and then takes all that
// lit up.
#include <fmt/core.h>

#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "tests/accuracy/detection/blink_frequency_experiment.h"
#include "tests/accuracy/detection/blink_frequency_plot.h"
#include "tests/accuracy/detection/detection_experiments.h"
#include "tests/accuracy/detection/figure_files.h"

namespace rigcal::accuracy {
namespace {

int RunBlinkFrequencies(const BlinkFrequencyOptions& options, const std::string& csv,
                        const std::string& png) {
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
  return WriteFigure(BlinkFrequencyCsv(options, points), csv, png, [&](const std::string& path) {
    return DrawBlinkFrequency(options, points, path);
  });
}

struct BlinkFrequencyArguments {
  BlinkFrequencyOptions options = PaperBlinkFrequency();
  std::string csv, png;
  int seed = 1;
};

Experiment::Run PrepareBlinkFrequency(OptionList* list) {
  const auto arguments = std::make_shared<BlinkFrequencyArguments>();
  BlinkFrequencyOptions& options = arguments->options;
  options.detection.streams = 20;
  EventRenderOptions& sensor = options.detection.sensor;
  AddFigureOptions(list, &arguments->csv, &arguments->png);
  list->Add("--hz", &options.blink_hz, 20, 5000, "frequencies, ascending");
  list->Add("--streams", &options.detection.streams, 1, 100000,
            "streams of each frequency, about 6 detections each");
  list->Add("--seed", &arguments->seed, 0, 40000, "of poses, pixels and noise");
  list->Add("--threads", &options.detection.threads, 1, 256, "streams at the same time");
  list->Add("--refractory", &sensor.refractory_us, 0, 1e5, "refractory period of a pixel, us");
  list->Add("--spread", &sensor.refractory_spread, 0, 0.3,
            "one sigma of the refractory period over the pixels, relative");
  list->Add("--latency", &sensor.latency_us, 0, 1e4, "time constant at the LED's light, us");
  return [arguments] {
    BlinkFrequencyOptions run = arguments->options;
    run.detection.seed = static_cast<uint32_t>(arguments->seed);
    return RunBlinkFrequencies(run, arguments->csv, arguments->png);
  };
}

}  // namespace

Experiment BlinkFrequency() {
  return {"blink_frequency", "detection rate of event cameras against blink frequency",
          PrepareBlinkFrequency};
}

}  // namespace rigcal::accuracy
