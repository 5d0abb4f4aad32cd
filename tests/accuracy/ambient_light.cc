// SPDX-License-Identifier: Apache-2.0
// The detection rate of frame cameras against ambient light, after the figure in the eWand paper:
//
//   build/release/tests/accuracy.ambient_light --csv ambient.csv --png ambient.png
//
// Rendered pictures of the paper's camera with a wand 1.5 to 4 m away, fully visible anywhere in
// the image, and as many without one. Exposure and gain are printed: ambient light reaches the
// sensor through both.
#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <fstream>
#include <string>

#include "tests/accuracy/ambient_light_experiment.h"
#include "tests/accuracy/ambient_light_plot.h"

namespace rigcal::accuracy {
namespace {

void PrintSetting(const AmbientLightOptions& options) {
  const FrameRenderOptions& render = options.detection.render;
  const RandomWandPoseOptions& pose = options.detection.pose;
  fmt::print(
      "exposure {} ms; fixed gain: LED alone {} grey in red, automatic gain: at most 200 grey on "
      "a\n"
      "sphere; LED {} cd/m^2, black {} grey, read noise {} grey, defocus {} px; wand {} to {} m\n",
      1e3 * render.exposure_s, render.led_grey, render.led_cd_m2, render.black_grey,
      render.read_noise_grey, render.defocus_px, pose.min_distance_m, pose.max_distance_m);
  const agent::ColourRange& colour = options.detection.detector.colour;
  fmt::print("detector: hue {} to {} degrees, saturation from {}, value from {}, white from {}\n",
             colour.hue_min_deg, colour.hue_max_deg, colour.saturation_min, colour.value_min,
             colour.washed_out_min);
  fmt::print(
      "\n                                            gain   wands  found  error px  false\n"
      "case                                lux  grey m^2/cd   shown      %       rms  wands\n");
}

int Run(const AmbientLightOptions& options, const std::string& csv, const std::string& png) {
  PrintSetting(options);
  AmbientLightOptions one = options;
  std::vector<AmbientLightPoint> points;
  int failures = 0;
  for (const AmbientLightCase& setting : options.cases) {
    one.cases = {setting};
    for (const AmbientLightPoint& point : RunAmbientLight(one)) {
      fmt::print("{:33} {:6.0f}  {:11.4f}  {:6} {:6.1f}  {:8.3f} {:6}\n", setting.name, point.lux,
                 point.grey_per_cd_m2, point.shown.shown, 100 * point.Rate(), point.shown.rms_px,
                 point.FalseWands());
      failures += point.shown.failures + point.empty.failures;
      points.push_back(point);
    }
  }
  if (failures > 0) {
    fmt::print(stderr, "{} pictures could not be rendered or searched\n", failures);
    return 1;
  }
  if (!csv.empty()) {
    std::ofstream file(csv);
    file << AmbientLightCsv(points);
    file.close();
    if (!file) {
      fmt::print(stderr, "{}: cannot write the table; does its folder exist?\n", csv);
      return 1;
    }
  }
  if (png.empty()) return 0;
  const absl::Status drawn = DrawAmbientLight(points, png);
  if (!drawn.ok()) fmt::print(stderr, "{}\n", std::string(drawn.message()));
  return drawn.ok() ? 0 : 1;
}

}  // namespace
}  // namespace rigcal::accuracy

int main(int argc, char** argv) {
  using namespace rigcal::accuracy;
  AmbientLightOptions options = PaperAmbientLight();
  std::string csv, png;
  int seed = 1;
  CLI::App app("detection rate of frame cameras against ambient light");
  app.option_defaults()->always_capture_default();
  app.add_option("--csv", csv, "file to write the table to");
  app.add_option("--png", png, "file to draw the figure to");
  app.add_option("--pictures", options.pictures,
                 "of each case and lux, with a wand; as many without one")
      ->check(CLI::Range(1, 100000));
  app.add_option("--seed", seed, "of rooms, poses and noise")->check(CLI::Range(0, 4000000));
  app.add_option("--lux", options.lux, "levels of light, ascending")->check(CLI::Range(0.0, 1e5));
  rigcal::agent::ColourRange& colour = options.detection.detector.colour;
  app.add_option("--hue-min", colour.hue_min_deg, "of the detector, degrees, as tune finds it")
      ->check(CLI::Range(0.0, 360.0));
  app.add_option("--hue-max", colour.hue_max_deg, "likewise")->check(CLI::Range(0.0, 360.0));
  app.add_option("--threads", options.detection.threads, "rooms at the same time")
      ->check(CLI::Range(1, 256));
  CLI11_PARSE(app, argc, argv);
  options.detection.seed = static_cast<uint32_t>(seed);
  options.empty_pictures = options.pictures;
  return Run(options, csv, png);
}
