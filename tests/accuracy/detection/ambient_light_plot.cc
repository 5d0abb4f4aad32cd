// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/detection/ambient_light_plot.h"

#include <map>
#include <vector>

#include "absl/strings/str_format.h"
#include "tests/accuracy/detection/rate_plot.h"

namespace rigcal::accuracy {
namespace {

constexpr double kMinLux = 8, kMaxLux = 6000;
// The requirement: this rate up to this much light.
constexpr double kGoalRate = 0.95, kGoalLux = 1000;

}  // namespace

absl::Status DrawAmbientLight(const std::vector<AmbientLightPoint>& points,
                              const std::string& png_path) {
  RatePlot plot;
  plot.title = "Wand detection rate against ambient light";
  plot.x_title = "ambient light, lux";
  plot.y_title = "wands found, % of those fully visible";
  plot.min_x = kMinLux;
  plot.max_x = kMaxLux;
  plot.logarithmic_x = true;
  for (const double decade : {10, 100, 1000}) {
    for (int step = 1; step < 10 && step * decade <= kMaxLux; ++step) {
      plot.grid_x.push_back(step * decade);
      if (step == 1 || step == 2 || step == 5) plot.labelled_x.push_back(step * decade);
    }
  }
  plot.legend_x = 12;
  plot.goal = {{kMinLux, kGoalRate}, {kGoalLux, kGoalRate}, {kGoalLux, 0}};
  std::map<std::string, size_t> curve_of;
  std::vector<int> false_wands;
  for (const AmbientLightPoint& point : points) {
    const auto [entry, is_new] = curve_of.emplace(point.setting.name, plot.curves.size());
    if (is_new) {
      plot.curves.push_back({.name = point.setting.name, .points = {}});
      false_wands.push_back(0);
    }
    plot.curves[entry->second].points.emplace_back(point.lux, point.Rate());
    false_wands[entry->second] += point.FalseWands();
  }
  for (size_t i = 0; i < plot.curves.size(); ++i) {
    plot.curves[i].name =
        absl::StrFormat("%s (%d false wands)", plot.curves[i].name, false_wands[i]);
  }
  return DrawRates(plot, png_path);
}

}  // namespace rigcal::accuracy
