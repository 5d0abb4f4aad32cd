// SPDX-License-Identifier: Apache-2.0
// Detection rate against the frequency at which the wand blinks, 100 to 1 500 Hz, as CSV:
//
//   build/release/tests/accuracy.blink_frequency --seeds 10 > blink_frequency.csv
//
// The sensor's refractory period is in the CSV: a pixel that is held in reset for longer than half
// a blink misses every other change, so the rate falls above 1 / (2 * refractory period).
#include <fmt/core.h>

#include <cstdio>

#include "tests/accuracy/event_detection_experiment.h"
#include "tests/accuracy/program_arguments.h"

int main(int argc, char** argv) {
  using namespace rigcal::accuracy;
  ProgramArguments arguments;
  arguments.seeds = 10;
  int exit_code = 0;
  if (!ReadArguments(argc, argv, "detection rate against the wand's blink frequency", &arguments,
                     &exit_code)) {
    return exit_code;
  }
  EventDetectionOptions options = PaperEventDetection();
  options.streams = arguments.seeds;
  options.seed = static_cast<uint32_t>(arguments.first_seed);
  options.threads = arguments.threads;
  options.outputs = 5;
  options.sensor.refractory_us = 700;
  options.sensor.refractory_spread = 0.1;
  fmt::print("blink_hz,refractory_us,refractory_spread,outputs,wand_rate,marker_rate,rms_px\n");
  for (const double hz : {100., 200., 300., 400., 450., 500., 550., 600., 650., 700., 750., 800.,
                          900., 1000., 1200., 1500.}) {
    options.target.blink_hz = {hz};
    options.filter.blink_hz = {hz};
    options.warm_up_s = 0.02 + 5 / hz;
    const EventDetectionSummary s = Summarise(RunEventDetection(options));
    fmt::print("{:.0f},{:.0f},{:.2f},{},{:.4f},{:.4f},{:.4f}\n", hz, options.sensor.refractory_us,
               options.sensor.refractory_spread, s.shown,
               s.shown > 0 ? static_cast<double>(s.found) / s.shown : 0.0,
               s.markers > 0 ? static_cast<double>(s.markers_found) / s.markers : 0.0, s.rms_px);
    std::fflush(stdout);
  }
  return 0;
}
