// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "client/results/trajectory_evaluation.h"

namespace rigcal::client {
namespace {

constexpr double kWidth = 960, kPanel = 180, kLeft = 80, kRight = 20, kTop = 20, kBelow = 40;
constexpr size_t kMostDots = 4000;

// Half the height of a panel, millimetres: a round number above the 99th percentile.
double PlotLimitMm(const TrajectoryEvaluation& evaluation) {
  std::vector<double> values;
  for (const auto& error : evaluation.errors) {
    values.push_back(1000 * error.error_m.cwiseAbs().maxCoeff());
  }
  std::sort(values.begin(), values.end());
  const double high = std::max(values[values.size() - 1 - values.size() / 100], 1e-6);
  const double decade = std::pow(10, std::floor(std::log10(high)));
  for (const double step : {1.0, 2.0, 5.0}) {
    if (step * decade >= high) return step * decade;
  }
  return 10 * decade;
}

}  // namespace

std::string PlotAsSvg(const TrajectoryEvaluation& evaluation) {
  if (evaluation.errors.empty()) return "";
  const double limit_mm = PlotLimitMm(evaluation);
  const double first_s = evaluation.errors.front().time_s;
  const double span_s = std::max(evaluation.errors.back().time_s - first_s, 1e-9);
  const double height = kTop + 3 * kPanel + kBelow;
  std::string svg = absl::StrFormat(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 %.0f %.0f\" "
      "font-family=\"sans-serif\" font-size=\"13\">\n<rect width=\"100%%\" height=\"100%%\" "
      "fill=\"white\"/>\n",
      kWidth, height);
  const size_t every = evaluation.errors.size() / kMostDots + 1;
  const char* const names[] = {"x", "y", "z"};
  const char* const colours[] = {"#b3261e", "#1b7f3b", "#1f4fbf"};
  for (int axis = 0; axis < 3; ++axis) {
    const double middle = kTop + (axis + 0.5) * kPanel;
    const double half = kPanel / 2 - 8;
    for (const int line : {-1, 0, 1}) {
      absl::StrAppendFormat(&svg,
                            "<path d=\"M%.1f %.1fH%.1f\" stroke=\"#ccc\"/><text x=\"%.1f\" "
                            "y=\"%.1f\" text-anchor=\"end\">%g</text>\n",
                            kLeft, middle - line * half, kWidth - kRight, kLeft - 6,
                            middle - line * half + 4, line * limit_mm);
    }
    absl::StrAppendFormat(&svg, "<text x=\"6\" y=\"%.1f\">%s (mm)</text>\n<path fill=\"%s\" d=\"",
                          middle - half / 2, names[axis], colours[axis]);
    for (size_t i = 0; i < evaluation.errors.size(); i += every) {
      const auto& error = evaluation.errors[i];
      // What lies beyond is drawn on the edge.
      const double mm = std::clamp(1000 * error.error_m[axis], -limit_mm, limit_mm);
      absl::StrAppendFormat(
          &svg, "M%.1f %.1fh2v2h-2z",
          kLeft + (error.time_s - first_s) / span_s * (kWidth - kLeft - kRight) - 1,
          middle - mm / limit_mm * half - 1);
    }
    svg += "\"/>\n";
  }
  absl::StrAppendFormat(&svg,
                        "<text x=\"%.1f\" y=\"%.1f\">%.3f s</text><text x=\"%.1f\" y=\"%.1f\" "
                        "text-anchor=\"end\">%.3f s</text>\n</svg>\n",
                        kLeft, height - 14, first_s, kWidth - kRight, height - 14,
                        first_s + span_s);
  return svg;
}

}  // namespace rigcal::client
