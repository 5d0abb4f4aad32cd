// SPDX-License-Identifier: Apache-2.0
#include "common/scale/unit_ratio.h"

#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

namespace rigcal {

std::string UnitOfRatio(double ratio, double tolerance) {
  const std::pair<double, const char*> units[] = {
      {1000, "millimetres"}, {100, "centimetres"}, {1 / 0.0254, "inches"}, {1 / 0.3048, "feet"}};
  for (const auto& [factor, unit] : units) {
    if (std::abs(ratio / factor - 1) < tolerance) return unit;
  }
  return "";
}

std::string DescribeRatio(double ratio) {
  if (ratio > 0.5 && ratio < 2) {
    return absl::StrFormat("%.3f %% %s", 100 * std::abs(ratio - 1),
                           ratio > 1 ? "longer" : "shorter");
  }
  const double times = ratio > 1 ? ratio : 1 / ratio;
  const std::string number =
      times < 10 ? absl::StrFormat("%.2f", times) : absl::StrFormat("%.0f", times);
  return ratio > 1 ? absl::StrCat(number, " times as long")
                   : absl::StrCat("1/", number, " as long");
}

}  // namespace rigcal
