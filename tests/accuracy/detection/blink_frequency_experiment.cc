// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/detection/blink_frequency_experiment.h"

#include <limits>

#include "absl/strings/str_format.h"

namespace rigcal::accuracy {
namespace {

double Share(int part, int whole) {
  return whole > 0 ? static_cast<double>(part) / whole : std::numeric_limits<double>::quiet_NaN();
}

}  // namespace

BlinkFrequencyOptions PaperBlinkFrequency() {
  BlinkFrequencyOptions options;
  options.detection = PaperEventDetection();
  options.detection.outputs = 8;
  options.detection.textbook = true;
  options.detection.sensor.refractory_us = 700;
  options.detection.sensor.refractory_spread = 0.1;
  options.blink_hz = {100, 200, 300, 400, 500,  550,  600,  650,
                      700, 750, 800, 900, 1000, 1100, 1250, 1500};
  return options;
}

double BlinkFrequencyPoint::WandRate() const {
  return Share(summary.wands_found, summary.wands_shown);
}

double BlinkFrequencyPoint::TextbookRate() const {
  return Share(summary.textbook_found, summary.shown);
}

std::vector<BlinkFrequencyPoint> RunBlinkFrequency(const BlinkFrequencyOptions& options) {
  std::vector<BlinkFrequencyPoint> points;
  for (const double hz : options.blink_hz) {
    EventDetectionOptions detection = options.detection;
    detection.target.blink_hz = {hz};
    detection.filter.blink_hz = {hz};
    detection.warm_up_s = 0.02 + 12 / hz;
    points.push_back({hz, Summarise(RunEventDetection(detection))});
  }
  return points;
}

std::string BlinkFrequencyCsv(const BlinkFrequencyOptions& options,
                              const std::vector<BlinkFrequencyPoint>& points) {
  const EventRenderOptions& sensor = options.detection.sensor;
  std::string csv =
      "blink_hz,refractory_us,refractory_spread,latency_us,detections,wand_rate,false_wands,rms_px,"
      "outputs,textbook_rate,failures\n";
  for (const BlinkFrequencyPoint& point : points) {
    const EventDetectionSummary& s = point.summary;
    absl::StrAppendFormat(&csv, "%.0f,%.0f,%.2f,%.0f,%d,%.4f,%d,%.4f,%d,%.4f,%d\n", point.blink_hz,
                          sensor.refractory_us, sensor.refractory_spread, sensor.latency_us,
                          s.wands_shown, point.WandRate(), s.false_wands, s.wands.rms_px, s.shown,
                          point.TextbookRate(), s.failures);
  }
  return csv;
}

}  // namespace rigcal::accuracy
