// SPDX-License-Identifier: Apache-2.0
// The detector of frame cameras on rendered frames. A seed is a room with 25 frames of a wand fully
// visible at 1.5 to 6 m anywhere in the image, and 25 without one. Evaluated: detection rate, false
// wands, centre errors against the projections of the spheres' centres, their mean along the radius
// in bins of distance and image radius, their bias along the motion of a moving wand, and the
// consistency of the covariance (NEES per degree of freedom, 1 if consistent).
#include <fmt/core.h>

#include <string>
#include <utility>
#include <vector>

#include "tests/accuracy/detection/detection_experiment.h"
#include "tests/accuracy/detection/detection_experiments.h"
#include "tests/accuracy/detection/photographs.h"
#include "tests/accuracy/detection/room_cases.h"
#include "tests/accuracy/seed_options.h"

namespace rigcal::accuracy {
namespace {

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

void PrintRoomCase(const std::string& name, const DetectionOptions& options, bool verbose) {
  const auto results = RunDetection(options);
  const DetectionSummary sum = Summarise(results);
  const int with_wand = sum.frames - sum.empty_frames;
  fmt::print(
      "{:26} {:6} {:6.1f} {:6.1f}  {:3}/{:5}  {:3}/{:5} {:7.3f} {:7.3f} {:6.2f} {:7.2f} "
      "{:7.1f}\n",
      name, sum.frames, sum.shown > 0 ? 100.0 * sum.found / sum.shown : 0.0,
      sum.visible_markers > 0 ? 100.0 * sum.found_markers / sum.visible_markers : 0.0,
      sum.false_in_empty, sum.empty_frames, sum.false_wands - sum.false_in_empty, with_wand,
      sum.rms_px, sum.bias_px, sum.nees, sum.median_ms, sum.worst_ms);
  if (sum.unlit > 0) {
    fmt::print("  in {} frames the LEDs are dark; they are not counted as frames with a wand\n",
               sum.unlit);
  }
  if (!verbose) return;
  for (const ImageResult& result : results) {
    if (!result.status.ok()) fmt::print("  {}\n", result.status.ToString());
    if (!result.false_wand && (result.found || !result.shown)) continue;
    fmt::print("  frame {}: {}{}, confidence {:.2f}, {:.2f} m, tilt {:.0f} deg\n", result.seed,
               DetectionOutcomeText(result.outcome), result.false_wand ? " (false)" : "",
               result.confidence, result.distance_m, result.tilt_deg);
  }
}

bool IsWanted(const SeedOptions& seeds, const std::string& name) {
  return seeds.only.empty() || name.find(seeds.only) != std::string::npos;
}

void PrintRooms(const DetectionOptions& plain, const SeedOptions& seeds) {
  fmt::print(
      "\nrooms, a third of the frames without a wand; markers are those of wands with two or more "
      "to be seen\n"
      "                                   found, %      false wands in       error, px            "
      "time, ms\n"
      "room                       frames  wands markers   no wand   a wand     rms    bias   NEES  "
      "median   worst\n");
  const std::vector<std::string> photographs = FindPhotographs();
  if (photographs.empty()) {
    fmt::print(
        "no photographs: install mate-backgrounds and opencv-doc, or set RIGCAL_PHOTOGRAPHS "
        "to a folder of them\n");
  }
  for (const DetectionCase& entry : RoomCases(photographs)) {
    if (!IsWanted(seeds, entry.name)) continue;
    DetectionOptions options = plain;
    entry.change(&options);
    PrintRoomCase(entry.name, options, seeds.verbose);
  }
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
    if (!IsWanted(seeds, entry.name)) continue;
    DetectionOptions options = plain;
    entry.change(&options);
    auto results = PrintDetectionCase(entry.name, options, seeds.verbose);
    if (plain_results.empty()) plain_results = std::move(results);
  }
  if (!plain_results.empty()) PrintBins(plain_results);
  PrintRooms(plain, seeds);
  return 0;
}

}  // namespace

Experiment Detection() {
  return SeedExperiment("detection", "wands in rendered frames: found, false, errors, covariances",
                        SeedOptions{}, RunDetectionCases);
}

}  // namespace rigcal::accuracy
