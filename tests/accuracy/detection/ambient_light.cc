// SPDX-License-Identifier: Apache-2.0
// The detection rate of frame cameras against ambient light, after the figure in the eWand paper:
// rendered frames of the paper's camera with a wand 1.5 to 4 m away, fully visible anywhere in the
// image, and as many without one. Exposure and gain are printed: ambient light reaches the sensor
// through both.
#include <fmt/core.h>

#include <memory>
#include <string>

#include "tests/accuracy/detection/ambient_light_experiment.h"
#include "tests/accuracy/detection/ambient_light_plot.h"
#include "tests/accuracy/detection/detection_experiments.h"
#include "tests/accuracy/detection/figure_files.h"

namespace rigcal::accuracy {
namespace {

void PrintCameraSetting(const AmbientLightOptions& options) {
  const FrameRenderOptions& render = options.detection.render;
  const RandomWandPoseOptions& pose = options.detection.pose;
  fmt::print(
      "exposure {} ms; fixed gain: LED alone {} grey in red, automatic gain: at most 200 grey on "
      "a\n"
      "sphere; LED {} cd/m^2, black {} grey, read noise {} grey, defocus {} px; wand {} to {} m\n",
      1e3 * render.exposure_s, render.led_grey, render.led_cd_m2, render.black_grey,
      render.read_noise_grey, render.defocus_px, pose.min_distance_m, pose.max_distance_m);
  const ColourRange& colour = options.detection.detector.colour;
  fmt::print("detector: hue {} to {} degrees, saturation from {}, value from {}, white from {}\n",
             colour.hue_min_deg, colour.hue_max_deg, colour.saturation_min, colour.value_min,
             colour.washed_out_min);
  fmt::print(
      "\n                                            gain   wands  found  error px  false\n"
      "case                                lux  grey m^2/cd   shown      %       rms  wands\n");
}

int RunAmbientLightCases(const AmbientLightOptions& options, const std::string& csv,
                         const std::string& png) {
  PrintCameraSetting(options);
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
    fmt::print(stderr, "{} frames could not be rendered or searched\n", failures);
    return 1;
  }
  return WriteFigure(AmbientLightCsv(points), csv, png,
                     [&points](const std::string& path) { return DrawAmbientLight(points, path); });
}

struct AmbientLightArguments {
  AmbientLightOptions options = PaperAmbientLight();
  std::string csv, png;
  int seed = 1;
};

Experiment::Run PrepareAmbientLight(OptionList* list) {
  const auto arguments = std::make_shared<AmbientLightArguments>();
  AmbientLightOptions& options = arguments->options;
  ColourRange& colour = options.detection.detector.colour;
  AddFigureOptions(list, &arguments->csv, &arguments->png);
  list->Add("--pictures", &options.frames, 1, 100000,
            "frames of each case and lux with a wand; as many without one");
  list->Add("--seed", &arguments->seed, 0, 4000000, "of rooms, poses and noise");
  list->Add("--lux", &options.lux, 0, 1e5, "levels of light, ascending");
  list->Add("--hue-min", &colour.hue_min_deg, 0, 360,
            "of the detector, degrees, as `rigcal-agent tune` finds it");
  list->Add("--hue-max", &colour.hue_max_deg, 0, 360, "of the detector, degrees");
  list->Add("--threads", &options.detection.threads, 1, 256, "rooms at the same time");
  return [arguments] {
    AmbientLightOptions run = arguments->options;
    run.detection.seed = static_cast<uint32_t>(arguments->seed);
    run.empty_frames = run.frames;
    return RunAmbientLightCases(run, arguments->csv, arguments->png);
  };
}

}  // namespace

Experiment AmbientLight() {
  return {"ambient_light", "detection rate of frame cameras against ambient light",
          PrepareAmbientLight};
}

}  // namespace rigcal::accuracy
