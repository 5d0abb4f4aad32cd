// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/detection/blink_frequency_plot.h"

#include "absl/strings/str_format.h"
#include "tests/accuracy/detection/rate_plot.h"

namespace rigcal::accuracy {
namespace {

constexpr double kMaxHz = 1600;
// The requirement at 500 Hz.
constexpr double kPlotGoalRate = 0.98, kGoalHz = 500;

}  // namespace

absl::Status DrawBlinkFrequency(const BlinkFrequencyOptions& options,
                                const std::vector<BlinkFrequencyPoint>& points,
                                const std::string& png_path) {
  RatePlot plot;
  plot.title = "Wand detection rate against blink frequency";
  plot.x_title = "blink frequency, Hz";
  plot.y_title = "wands found, % of those fully visible";
  plot.min_x = 0;
  plot.max_x = kMaxHz;
  for (double hz = 100; hz < kMaxHz; hz += 100) {
    plot.grid_x.push_back(hz);
    plot.labelled_x.push_back(hz);
  }
  plot.legend_x = 850;
  plot.goal = {{kGoalHz, 0}, {kGoalHz, kPlotGoalRate}, {0, kPlotGoalRate}};
  plot.curves = {{.name = "wands, this detector", .points = {}},
                 {.name = "wands, textbook chain", .points = {}}};
  for (const BlinkFrequencyPoint& point : points) {
    plot.curves[0].points.emplace_back(point.blink_hz, point.WandRate());
    plot.curves[1].points.emplace_back(point.blink_hz, point.TextbookRate());
  }
  const EventRenderOptions& sensor = options.detection.sensor;
  plot.notes = {absl::StrFormat("refractory period %.2f ms, one sigma %.0f %%",
                                1e-3 * sensor.refractory_us, 100 * sensor.refractory_spread)};
  return DrawRates(plot, png_path);
}

}  // namespace rigcal::accuracy
