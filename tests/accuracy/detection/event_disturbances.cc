// SPDX-License-Identifier: Apache-2.0
// The wand detector behind event cameras whose streams are not whole: rate control, long refractory
// periods, lost packets, and lamps near the wand's frequency. A seed is a stream of 0.4 s of a wand
// that moves with up to 2 m/s at 1.5 to 5 m, searched for at 200 Hz.
#include <fmt/core.h>

#include <cstdio>
#include <functional>
#include <string>

#include "tests/accuracy/detection/detection_experiments.h"
#include "tests/accuracy/detection/event_detection_experiment.h"
#include "tests/accuracy/seed_options.h"

namespace rigcal::accuracy {
namespace {

constexpr int kOutputs = 80;
// Which switches of the light pixels answer is found out by then.
constexpr double kSettledS = 0.6;

void RunCase(const std::string& name, const SeedOptions& seeds,
             const std::function<void(EventDetectionOptions*)>& change) {
  if (name.find(seeds.only) == std::string::npos) return;
  EventDetectionOptions options = PaperEventDetection();
  options.streams = seeds.count;
  options.seed = static_cast<uint32_t>(seeds.first);
  options.threads = seeds.threads;
  options.output_hz = 200;
  options.outputs = kOutputs;
  change(&options);
  const auto results = RunEventDetection(options);
  const EventDetectionSummary s = Summarise(results);
  fmt::print("{:28} {:6.2f} {:5.1f} % {:4} {:5}  {:.3f}  {:6.0f}  {:5.2f} {:5.2f}\n", name,
             s.mev_per_s, s.wands_shown > 0 ? 100.0 * s.wands_found / s.wands_shown : 0.0,
             s.false_wands, s.ambiguous, s.wands.rms_px, s.wand_latency_us, s.wands.nees_along,
             s.wands.nees_across);
  agent::BlinkWandCounts counts;
  for (const EventStreamResult& result : results) counts += result.counts;
  if (counts.gaps > 0) {
    fmt::print("    {} gaps, {:.1f} ms in all; {} wands beside them\n", counts.gaps,
               1e-3 * static_cast<double>(counts.gap_us), counts.beside_gap);
  }
  if (counts.thinned > 0) {
    fmt::print("    {} of {} wands thinned, {} % answered\n", counts.thinned, counts.judged,
               counts.answered_percent / counts.judged);
  }
  if (counts.missed_looks > 0) {
    fmt::print("    {} looks without a wand: {} % of blinks answered\n", counts.missed_looks,
               counts.missed_answered_percent / counts.missed_looks);
  }
  if (counts.banded > 0) {
    fmt::print("    {} ambiguous ones by lights of {} Hz: band={}\n", counts.banded,
               counts.other_hz / counts.banded,
               1e-4 * static_cast<double>(counts.band_10000 / counts.banded));
  }
  std::fflush(stdout);
}

int RunDisturbances(const SeedOptions& seeds) {
  fmt::print("{:28}  Mev/s  found false ambig.  rms px  late us  NEES along, across\n", "case");
  const auto run = [&seeds](const std::string& name, const auto& change) {
    RunCase(name, seeds, change);
  };
  run("undisturbed", [](EventDetectionOptions*) {});
  for (const double share : {0.75, 0.5, 0.25}) {
    run(fmt::format("kept at random: {}", share),
        [=](EventDetectionOptions* o) { o->disturbance.kept_share = share; });
  }
  run("every second kept", [](EventDetectionOptions* o) { o->disturbance.keep_every = 2; });
  run("every fourth kept", [](EventDetectionOptions* o) { o->disturbance.keep_every = 4; });
  for (const bool first : {false, true}) {
    for (const double mev : {8.0, 4.0, 2.0}) {
      run(fmt::format("limit of {} Mev/s{}", mev, first ? ", first ones" : ""),
          [=](EventDetectionOptions* o) {
            o->disturbance.rate_limit = mev * 1e6;
            o->disturbance.keeps_first = first;
          });
    }
  }
  // Several events for each switch of the light.
  const auto be_fast = [](EventDetectionOptions* o) {
    o->sensor.refractory_us = 30;
    o->sensor.on_threshold = o->sensor.off_threshold = 0.12;
  };
  run("fast pixels", be_fast);
  for (const double share : {0.5, 0.25}) {
    run(fmt::format("fast pixels, kept: {}", share), [=](EventDetectionOptions* o) {
      be_fast(o);
      o->disturbance.kept_share = share;
    });
  }
  for (const double mev : {8.0, 4.0}) {
    run(fmt::format("fast pixels, limit of {} Mev/s", mev), [=](EventDetectionOptions* o) {
      be_fast(o);
      o->disturbance.rate_limit = 1e6 * mev;
    });
  }
  for (const double ms : {0.1, 0.3, 0.8, 1.0, 1.2, 1.5}) {
    run(fmt::format("refractory period of {} ms", ms), [=](EventDetectionOptions* o) {
      o->sensor.refractory_us = 1e3 * ms;
      o->warm_up_s = kSettledS;
    });
  }
  for (const double share : {0.02, 0.05, 0.1, 0.2}) {
    run(fmt::format("{:.0f} % of milliseconds lost", 100 * share),
        [=](EventDetectionOptions* o) { o->disturbance.lost_ms_share = share; });
  }
  for (const double band : {0.15, 0.02}) {
    run(fmt::format("lamps of 480 Hz, band={}", band), [=](EventDetectionOptions* o) {
      o->sensor.lamp_hz = 480;
      o->band_rel = band;
    });
  }
  return 0;
}

}  // namespace

Experiment EventDisturbances() {
  SeedOptions defaults;
  defaults.count = 20;
  return SeedExperiment("event_disturbances",
                        "wands of event cameras behind rate control, gaps and lamps", defaults,
                        RunDisturbances);
}

}  // namespace rigcal::accuracy
