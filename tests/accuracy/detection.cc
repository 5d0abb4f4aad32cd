// SPDX-License-Identifier: Apache-2.0
// The detector of frame cameras on rendered pictures:
//
//   build/release/tests/accuracy.detection --seeds 100 --threads 2
//
// A seed is a room with 25 pictures of a wand fully visible at 1.5 to 6 m anywhere in the image,
// and 25 without one. Judged: rate of detection, false wands, centre errors against the projection
// of the spheres' centres, their mean along the radius in bins of distance and image radius, their
// bias along the motion of a moving wand, and whether the covariance is honest (NEES per degree of
// freedom, 1 where it is).
#include <fmt/core.h>

#include <string>

#include "tests/accuracy/detection_experiment.h"
#include "tests/accuracy/program_arguments.h"

namespace rigcal::accuracy {
namespace {

DetectionOptions ForArguments(const ProgramArguments& arguments) {
  DetectionOptions options = PaperDetection();
  options.pictures = options.pictures_per_room * arguments.seeds;
  options.seed = static_cast<uint32_t>(arguments.first_seed);
  options.threads = arguments.threads;
  return options;
}

std::vector<ImageResult> PrintCase(const std::string& name, const DetectionOptions& options,
                                   bool verbose) {
  auto results = RunDetection(options);
  const DetectionSummary summary = Summarise(results);
  fmt::print("{:26} {:6} {:6} {:8.2f} {:6} {:8.3f} {:9.4f} {:9.4f} {:7.2f} {:7.2f}\n", name,
             summary.pictures, summary.failures,
             summary.shown > 0 ? 100.0 * summary.found / summary.shown : 0.0, summary.false_wands,
             100.0 * summary.false_wands / summary.pictures, summary.rms_px, summary.motion_bias_px,
             summary.nees, summary.median_ms);
  if (!verbose) return results;
  for (const ImageResult& result : results) {
    if (!result.status.ok()) fmt::print("  {}\n", result.status.ToString());
    for (const CentreError& centre : result.centres) {
      if (centre.error_px.norm() < 0.15) continue;
      fmt::print("  picture {}: a centre {:.2f} px off, NEES {:.0f}, {:.2f} m, tilt {:.0f} deg\n",
                 result.seed, centre.error_px.norm(), centre.nees, centre.distance_m,
                 result.tilt_deg);
    }
    if ((result.found || !result.shown) && !result.false_wand) continue;
    fmt::print("  picture {}: {}{}, {} covered, confidence {:.2f}, {:.2f} m, tilt {:.0f} deg\n",
               result.seed, DetectionOutcomeText(result.outcome),
               result.false_wand ? " (false)" : "", result.covered_markers, result.confidence,
               result.distance_m, result.tilt_deg);
  }
  return results;
}

void PrintBins(const std::vector<ImageResult>& results) {
  fmt::print("\nmean error along the radius from the image's middle, px (sigma of the mean)\n");
  fmt::print("distance m  radius px  centres    mean    sigma\n");
  for (const RadialBin& bin : RadialBins(results)) {
    fmt::print("   to {:4.1f}    to {:4.0f}  {:7} {:8.4f} {:8.4f}\n", bin.distance_m,
               bin.image_radius_px, bin.count, bin.mean_px, bin.sigma_px);
  }
}

}  // namespace
}  // namespace rigcal::accuracy

int main(int argc, char** argv) {
  using namespace rigcal::accuracy;
  ProgramArguments arguments;
  arguments.seeds = 100;
  int exit_code = 0;
  if (!ReadArguments(argc, argv, "the detector of frame cameras on rendered pictures", &arguments,
                     &exit_code)) {
    return exit_code;
  }
  const DetectionOptions plain = ForArguments(arguments);
  fmt::print("LED {} grey at {} ms, {} lux, read noise {} grey, defocus {} px, clutter {}\n",
             plain.render.led_grey, 1e3 * plain.render.exposure_s, plain.render.lux,
             plain.render.read_noise_grey, plain.render.defocus_px, plain.render.clutter);
  fmt::print(
      "                                          found  false wands       error px    bias on      "
      "   "
      "median\n"
      "case                     pictures failed       %      n        %      rms    motion    NEES "
      " "
      "    ms\n");
  const auto main_results = PrintCase("moderate clutter", plain, arguments.verbose);

  DetectionOptions empty = plain;
  empty.with_wand = false;
  empty.seed += 500;
  PrintCase("no wand", empty, arguments.verbose);

  DetectionOptions moving = plain;
  moving.pose.speed_m_s = 2;
  PrintCase("2 m/s", moving, arguments.verbose);

  DetectionOptions defocused = plain;
  defocused.render.defocus_px = 1.5;
  PrintCase("defocus 1.5 px", defocused, arguments.verbose);

  DetectionOptions bright = plain;
  bright.render.led_grey = 350;
  PrintCase("saturated", bright, arguments.verbose);

  DetectionOptions dim = plain;
  dim.render.led_grey = 100;
  PrintCase("100 grey", dim, arguments.verbose);

  DetectionOptions clear = plain;
  clear.render.clutter = 0;
  PrintCase("no clutter", clear, arguments.verbose);

  DetectionOptions crowded = plain;
  crowded.render.clutter = 2;
  PrintCase("much clutter", crowded, arguments.verbose);
  PrintBins(main_results);
  return 0;
}
