// SPDX-License-Identifier: Apache-2.0
#include "common/export/covariance_json.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_format.h"

namespace rigcal {

std::string WithCameraCovariance(std::string json, const std::vector<double>& packed) {
  const size_t end = json.rfind('}');
  const auto is_number = [](double value) { return std::isfinite(value); };
  if (packed.empty() || end == std::string::npos || !std::ranges::all_of(packed, is_number)) {
    return json;
  }
  const size_t last = json.find_last_not_of(" \t\r\n", end - 1);
  std::string field = json[last] == '{' ? "\n" : ",\n";
  field += " \"camera_covariance\": [";
  for (size_t i = 0; i < packed.size(); ++i) {
    // Digits enough that a covariance of strongly correlated values stays one.
    absl::StrAppendFormat(&field, "%s%.14g", i == 0 ? "" : i % 8 == 0 ? ",\n  " : ", ", packed[i]);
  }
  field += "]\n";
  json.replace(last + 1, end - last - 1, field);
  return json;
}

}  // namespace rigcal
