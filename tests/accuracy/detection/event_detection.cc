// SPDX-License-Identifier: Apache-2.0
// The marker chain of event cameras on simulated streams. A seed is a stream with ten outputs at
// 50 Hz of a wand that moves with up to 2 m/s at 1.5 to 5 m, and one with ten outputs without a
// wand, both with bars, lamps and 5 Mev/s of background noise; the detector, which waits for bursts
// to end, emits eight detections in each. A quarter or less of the seeds is repeated with a
// stationary wand, without noise, with 20 Mev/s of it, with a frequency for each marker, and at 200
// and 1 000 outputs per second. Evaluated: detection rate, false blobs, centre errors against the
// projections of the spheres' centres at the blobs' own times, their bias along the motion at about
// 550 px/s once a constant latency is subtracted, and the detector's wands, with nothing
// subtracted, and their errors against the covariances they state.
#include <fmt/core.h>

#include <algorithm>
#include <cstdio>
#include <string>

#include "tests/accuracy/detection/detection_experiments.h"
#include "tests/accuracy/detection/event_detection_experiment.h"
#include "tests/accuracy/seed_options.h"

namespace rigcal::accuracy {
namespace {

// Centres of the detector by size and by speed.
void PrintCentreErrors(const std::vector<EventStreamResult>& results) {
  const auto print = [&](const std::string& name, const EventCentreRange& range) {
    const EventCentreErrors errors = CentreErrorsOf(results, range);
    if (errors.centres == 0) return;
    fmt::print("    {:18} {:7} centres, rms {:.4f} px, nees along {:.2f}, across {:.2f}\n", name,
               errors.centres, errors.rms_px, errors.nees_along, errors.nees_across);
  };
  print("all", {});
  print("radius < 5 px", {.max_radius_px = 5});
  print("radius 5 to 8 px", {.min_radius_px = 5, .max_radius_px = 8});
  print("radius > 8 px", {.min_radius_px = 8});
  print("< 150 px/s", {.max_px_s = 150});
  print("150 to 450 px/s", {.min_px_s = 150, .max_px_s = 450});
  print("> 450 px/s", {.min_px_s = 450});
}

EventDetectionSummary PrintEventCase(const std::string& name, const EventDetectionOptions& options,
                                     const SeedOptions& seeds) {
  if (name.find(seeds.only) == std::string::npos) return {};
  const auto results = RunEventDetection(options);
  const EventDetectionSummary s = Summarise(results);
  fmt::print(
      "{:22} {:7} {:6} {:7.2f} {:7.2f} {:6} {:8.4f} {:8.4f} {:8.1f} {:8.4f} {:6.1f} {:6.2f}\n",
      name, s.outputs, s.failures, s.shown > 0 ? 100.0 * s.found / s.shown : 0.0,
      s.markers > 0 ? 100.0 * s.markers_found / s.markers : 0.0, s.false_blobs, s.rms_px,
      s.raw_rms_px, s.latency_us, s.motion_bias_px, s.mev_per_s, s.render_ratio);
  fmt::print(
      "{:22} {:7} detections, {:.2f} % of wands, {} false ({:.2f} %), rms {:.4f} px, "
      "latency {:.0f} us\n",
      "  wand detector", s.detections,
      s.wands_shown > 0 ? 100.0 * s.wands_found / s.wands_shown : 0.0, s.false_wands,
      s.detections > 0 ? 100.0 * s.false_wands / s.detections : 0.0, s.wands.rms_px,
      s.wand_latency_us);
  if (s.spheres_shown > 0) {
    fmt::print("    spheres seen whole, of wands with two or more: {:.2f} % of {}; {} ambiguous\n",
               100.0 * s.spheres_found / s.spheres_shown, s.spheres_shown, s.ambiguous);
  }
  if (s.wands.centres > 0) PrintCentreErrors(results);
  std::fflush(stdout);
  if (!seeds.verbose) return s;
  for (const EventStreamResult& result : results) {
    if (!result.status.ok()) fmt::print("  {}\n", result.status.ToString());
    for (size_t i = 0; i < result.outputs.size(); ++i) {
      const EventOutput& output = result.outputs[i];
      if (output.false_blobs > 0) {
        fmt::print("  stream {} output {}: {} false blobs\n", output.seed, i, output.false_blobs);
      }
      for (size_t k = 0; output.shown && k < output.centres.size(); ++k) {
        const EventCentre& centre = output.centres[k];
        if (centre.found && centre.error_px.norm() < 0.7) continue;
        fmt::print(
            "  stream {} output {} marker {}: {} ({:.2f} {:.2f}) px off, {:.1f} px radius, ({:.0f} "
            "{:.0f}) px/s\n",
            output.seed, i, k, centre.found ? "found" : "missing", centre.error_px.x(),
            centre.error_px.y(), centre.radius_px, centre.velocity_px_s.x(),
            centre.velocity_px_s.y());
      }
    }
  }
  return s;
}

// The variants, with a share of the streams each.
void PrintVariants(const EventDetectionOptions& plain, const SeedOptions& seeds) {
  const auto some = [&plain](int share) {
    EventDetectionOptions options = plain;
    options.streams = std::max(1, plain.streams / share);
    return options;
  };
  EventDetectionOptions still = some(4);
  still.pose.speed_m_s = 0;
  PrintEventCase("stationary", still, seeds);
  EventDetectionOptions quiet = some(4);
  quiet.sensor.background_hz = quiet.sensor.bars = quiet.sensor.lamps = quiet.sensor.hot_pixels = 0;
  quiet.sensor.leak_hz = 0;
  PrintEventCase("moving, no noise", quiet, seeds);
  EventDetectionOptions loud = some(8);
  loud.sensor.background_hz *= 4;
  PrintEventCase("moving, 20 Mev/s noise", loud, seeds);
  EventDetectionOptions individual = some(8);
  individual.target.blink_hz = individual.filter.blink_hz = {400, 500, 620};
  PrintEventCase("moving, 3 frequencies", individual, seeds);
  EventDetectionOptions fast = some(8);
  fast.output_hz = 200;
  fast.outputs = 40;
  PrintEventCase("moving, 200 Hz", fast, seeds);
  fast.output_hz = 1000;  // each burst is emitted once: 500 detections per second
  fast.outputs = 200;
  PrintEventCase("moving, 1 kHz", fast, seeds);
  EventDetectionOptions border = some(4);
  border.at_border = true;
  PrintEventCase("an end at the border", border, seeds);
  EventDetectionOptions hidden = some(4);
  hidden.hide_one = true;
  PrintEventCase("one sphere hidden", hidden, seeds);
  EventDetectionOptions two = some(4);
  two.second_wand = true;
  PrintEventCase("two wands that cross", two, seeds);
}

int RunEventCases(const SeedOptions& seeds) {
  EventDetectionOptions plain = PaperEventDetection();
  plain.streams = seeds.count;
  plain.seed = static_cast<uint32_t>(seeds.first);
  plain.threads = seeds.threads;
  fmt::print(
      "                                  wands markers  false   rms px   rms px  latency  bias px  "
      "        wall/\n"
      "case                   outputs failed       %       %  blobs  lat.out      raw       us   "
      "motion  Mev/s    sim\n");
  const EventDetectionSummary moving = PrintEventCase("moving", plain, seeds);
  EventDetectionOptions empty = plain;
  empty.with_wand = false;
  empty.seed += 500;
  const EventDetectionSummary none = PrintEventCase("no wand", empty, seeds);
  const int detections = moving.detections + none.detections;
  const int false_wands = moving.false_wands + none.false_wands;
  fmt::print("false wands: {} of {} detections ({:.3f} %), {} of them without a wand in view\n",
             false_wands, detections, 100.0 * false_wands / std::max(1, detections),
             none.detections);
  PrintVariants(plain, seeds);
  return 0;
}

}  // namespace

Experiment EventDetection() {
  SeedOptions defaults;
  defaults.count = 320;
  return SeedExperiment("event_detection",
                        "markers and wands of event cameras: found, false, errors, covariances",
                        defaults, RunEventCases);
}

}  // namespace rigcal::accuracy
