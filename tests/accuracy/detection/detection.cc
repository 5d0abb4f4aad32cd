// SPDX-License-Identifier: Apache-2.0
// The detector of frame cameras on rendered frames. A seed is a room with 25 frames of a wand fully
// visible at 1.5 to 6 m anywhere in the image, and 25 without one. Evaluated: detection rate, false
// wands, centre errors against the projections of the spheres' centres, their mean along the radius
// in bins of distance and image radius, their bias along the motion of a moving wand, and the
// consistency of the covariance (NEES per degree of freedom, 1 if consistent).
#include <fmt/core.h>

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "tests/accuracy/detection/detection_experiment.h"
#include "tests/accuracy/detection/detection_experiments.h"
#include "tests/accuracy/seed_options.h"

namespace rigcal::accuracy {
namespace {

struct DetectionCase {
  const char* name;
  std::function<void(DetectionOptions*)> change;
};

// Each differs from the first in one respect.
std::vector<DetectionCase> DetectionCases() {
  return {{"moderate clutter", [](DetectionOptions*) {}},
          {"no wand",
           [](DetectionOptions* options) {
             options->with_wand = false;
             options->seed += 500;
           }},
          {"2 m/s", [](DetectionOptions* options) { options->pose.speed_m_s = 2; }},
          {"defocus 1.5 px", [](DetectionOptions* options) { options->render.defocus_px = 1.5; }},
          {"saturated", [](DetectionOptions* options) { options->render.led_grey = 350; }},
          {"100 grey", [](DetectionOptions* options) { options->render.led_grey = 100; }},
          {"no clutter", [](DetectionOptions* options) { options->render.clutter = 0; }},
          {"much clutter", [](DetectionOptions* options) { options->render.clutter = 2; }}};
}

std::vector<ImageResult> PrintDetectionCase(const std::string& name,
                                            const DetectionOptions& options, bool verbose) {
  auto results = RunDetection(options);
  const DetectionSummary summary = Summarise(results);
  fmt::print("{:26} {:6} {:6} {:8.2f} {:6} {:8.3f} {:9.4f} {:9.4f} {:7.2f} {:7.2f}\n", name,
             summary.frames, summary.failures,
             summary.shown > 0 ? 100.0 * summary.found / summary.shown : 0.0, summary.false_wands,
             100.0 * summary.false_wands / summary.frames, summary.rms_px, summary.motion_bias_px,
             summary.nees, summary.median_ms);
  if (!verbose) return results;
  for (const ImageResult& result : results) {
    if (!result.status.ok()) fmt::print("  {}\n", result.status.ToString());
    for (const CentreError& centre : result.centres) {
      if (centre.error_px.norm() < 0.15) continue;
      fmt::print("  frame {}: a centre {:.2f} px off, NEES {:.0f}, {:.2f} m, tilt {:.0f} deg\n",
                 result.seed, centre.error_px.norm(), centre.nees, centre.distance_m,
                 result.tilt_deg);
    }
    if ((result.found || !result.shown) && !result.false_wand) continue;
    fmt::print("  frame {}: {}{}, {} occluded, confidence {:.2f}, {:.2f} m, tilt {:.0f} deg\n",
               result.seed, DetectionOutcomeText(result.outcome),
               result.false_wand ? " (false)" : "", result.covered_markers, result.confidence,
               result.distance_m, result.tilt_deg);
  }
  return results;
}

void PrintBins(const std::vector<ImageResult>& results) {
  fmt::print("\nmean error along the radius from the image centre, px (sigma of the mean)\n");
  fmt::print("distance m  radius px  centres    mean    sigma\n");
  for (const RadialBin& bin : RadialBins(results)) {
    fmt::print("   to {:4.1f}    to {:4.0f}  {:7} {:8.4f} {:8.4f}\n", bin.distance_m,
               bin.image_radius_px, bin.count, bin.mean_px, bin.sigma_px);
  }
}

int RunDetectionCases(const SeedOptions& seeds) {
  DetectionOptions plain = PaperDetection();
  plain.frames = plain.frames_per_room * seeds.count;
  plain.seed = static_cast<uint32_t>(seeds.first);
  plain.threads = seeds.threads;
  fmt::print("LED {} grey at {} ms, {} lux, read noise {} grey, defocus {} px, clutter {}\n",
             plain.render.led_grey, 1e3 * plain.render.exposure_s, plain.render.lux,
             plain.render.read_noise_grey, plain.render.defocus_px, plain.render.clutter);
  fmt::print(
      "                                          found  false wands       error px    bias on      "
      "   "
      "median\n"
      "case                       frames failed       %      n        %      rms    motion    NEES "
      " "
      "    ms\n");
  std::vector<ImageResult> plain_results;
  for (const DetectionCase& entry : DetectionCases()) {
    DetectionOptions options = plain;
    entry.change(&options);
    auto results = PrintDetectionCase(entry.name, options, seeds.verbose);
    if (plain_results.empty()) plain_results = std::move(results);
  }
  PrintBins(plain_results);
  return 0;
}

}  // namespace

Experiment Detection() {
  return SeedExperiment("detection", "wands in rendered frames: found, false, errors, covariances",
                        SeedOptions{}, RunDetectionCases);
}

}  // namespace rigcal::accuracy
