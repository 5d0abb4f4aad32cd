// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "absl/strings/str_format.h"
#include "server/solve/diagnose/finding_causes.h"

namespace rigcal::server {
namespace {

// Quartz clocks of computers and cameras are within 50 ppm of each other, and rarely at 100.
constexpr double kFarRatePpm = 100;

double SpanS(const CauseInput& input) {
  const std::vector<int64_t>& times_ns = input.evaluated.solution.built.instant_time_ns;
  if (times_ns.empty()) return 0;
  const auto [first, last] = std::ranges::minmax_element(times_ns);
  return 1e-9 * static_cast<double>(*last - *first);
}

}  // namespace

std::vector<Cause> FindClockRates(const CauseInput& input) {
  std::vector<Cause> causes;
  const double span_s = SpanS(input);
  for (const CalibratedCamera& camera : input.result.cameras) {
    const double rate_ppm = camera.time_rate_ppm;
    if (!(std::abs(rate_ppm) >= kFarRatePpm)) continue;
    causes.push_back(
        {{FindingKind::kClockDrift, camera.camera, -rate_ppm, "ppm",
          absl::StrFormat("its clock runs %.0f ppm %s than the others', by %.1f ms over these %.0f "
                          "s; the calibration has taken it out. Are its stamps made by its own "
                          "clock, and from the frame rate it really has? Use them with this rate",
                          std::abs(rate_ppm), rate_ppm < 0 ? "faster" : "slower",
                          1e-3 * std::abs(rate_ppm) * span_s, span_s)},
         0});
  }
  return causes;
}

}  // namespace rigcal::server
