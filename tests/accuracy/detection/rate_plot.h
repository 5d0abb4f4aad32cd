// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"

namespace rigcal::accuracy {

struct RateCurve {
  std::string name;
  std::vector<std::pair<double, double>> points;  // x, rate from 0 to 1; NaN: unknown
};

// A figure of rates in percent over x, a curve for each case.
struct RatePlot {
  std::string title, x_title, y_title;
  double min_x = 0, max_x = 1;
  bool logarithmic_x = false;
  std::vector<double> grid_x, labelled_x;
  std::vector<std::pair<double, double>> goal;  // a grey line: the requirement
  std::vector<RateCurve> curves;
  std::vector<std::string> notes;  // below the curves' names
  double legend_x = 0;             // left end of both, at the bottom
};

// As a PNG file. UNAVAILABLE: the file cannot be written.
absl::Status DrawRates(const RatePlot& plot, const std::string& png_path);

}  // namespace rigcal::accuracy
