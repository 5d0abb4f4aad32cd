// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/detection/ambient_light_experiment.h"

#include <limits>

#include "absl/strings/str_format.h"
#include "common/simulation/frames/light_model.h"

namespace rigcal::accuracy {
AmbientLightOptions PaperAmbientLight() {
  AmbientLightOptions options;
  options.detection = PaperDetection();
  options.detection.pose.min_distance_m = 1.5;
  options.detection.pose.max_distance_m = 4;
  options.lux = {10, 20, 50, 100, 200, 300, 500, 700, 1000, 1500, 2000, 3000, 5000};
  options.cases = {{"no clutter, fixed gain", 0, false},
                   {"moderate clutter, fixed gain", 0.5, false},
                   {"no clutter, automatic gain", 0, true},
                   {"moderate clutter, automatic gain", 0.5, true}};
  return options;
}

double AmbientLightPoint::Rate() const {
  if (shown.shown == 0) return std::numeric_limits<double>::quiet_NaN();
  return static_cast<double>(shown.found) / shown.shown;
}

std::vector<AmbientLightPoint> RunAmbientLight(const AmbientLightOptions& options) {
  std::vector<AmbientLightPoint> points;
  for (const AmbientLightCase& setting : options.cases) {
    for (const double lux : options.lux) {
      // The same rooms and poses at every point: what differs along a curve is the light.
      DetectionOptions detection = options.detection;
      detection.render.lux = lux;
      detection.render.clutter = setting.clutter;
      detection.render.auto_gain = setting.auto_gain;
      AmbientLightPoint point;
      point.setting = setting;
      point.lux = lux;
      point.grey_per_cd_m2 = LightModel(detection.render).grey_per_cd_m2;
      detection.frames = options.frames;
      detection.with_wand = true;
      point.shown = Summarise(RunDetection(detection));
      detection.frames = options.empty_frames;
      detection.with_wand = false;
      detection.seed += 500;
      point.empty = Summarise(RunDetection(detection));
      points.push_back(point);
    }
  }
  return points;
}

std::string AmbientLightCsv(const std::vector<AmbientLightPoint>& points) {
  std::string csv =
      "case,clutter,auto_gain,lux,grey_per_cd_m2,wands_shown,wands_found,detection_rate,"
      "centre_rms_px,empty_frames,false_wands,failures\n";
  for (const AmbientLightPoint& point : points) {
    absl::StrAppendFormat(&csv, "\"%s\",%g,%d,%.1f,%.5f,%d,%d,%.4f,%.4f,%d,%d,%d\n",
                          point.setting.name, point.setting.clutter, point.setting.auto_gain,
                          point.lux, point.grey_per_cd_m2, point.shown.shown, point.shown.found,
                          point.Rate(), point.shown.rms_px, point.empty.frames, point.FalseWands(),
                          point.shown.failures + point.empty.failures);
  }
  return csv;
}

}  // namespace rigcal::accuracy
