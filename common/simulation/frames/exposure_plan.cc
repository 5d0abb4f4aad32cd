// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/frames/exposure_plan.h"

#include <algorithm>
#include <cmath>

namespace rigcal {
namespace {

// Bounds the work if a sphere crosses half the image during one exposure.
constexpr int kMaxPartsPerPiece = 400;

void AddPiece(double begin_s, double end_s, bool lit, double exposure_s, double longest_part_s,
              std::vector<ExposurePart>* parts) {
  const double length_s = end_s - begin_s;
  if (!(length_s > 0)) return;
  const int count = static_cast<int>(
      std::clamp(std::ceil(length_s / longest_part_s), 1.0, double{kMaxPartsPerPiece}));
  for (int i = 0; i < count; ++i) {
    const double share = length_s / count / exposure_s;
    parts->push_back({begin_s + (i + 0.5) * length_s / count, share, lit ? share : 0});
  }
}

}  // namespace

std::vector<ExposurePart> PlanExposure(double exposure_s, const BlinkTiming& blink,
                                       double longest_part_s) {
  std::vector<ExposurePart> parts;
  const double begin_s = -0.5 * exposure_s, end_s = 0.5 * exposure_s;
  if (!(blink.hz > 0) || (blink.duty >= 1 && blink.code.code == nullptr)) {
    AddPiece(begin_s, end_s, true, exposure_s, longest_part_s, &parts);
  } else {
    const double period_s = 1 / blink.hz;
    const double first = std::floor((blink.phase_s + begin_s) * blink.hz);
    // Counted from the first period, so that a late phase costs no accuracy.
    const double start_s = first * period_s - blink.phase_s;
    const int periods = static_cast<int>(std::ceil(exposure_s * blink.hz)) + 2;
    for (int k = 0; k < periods; ++k) {
      const double begin_of_period_s = start_s + k * period_s;
      const double edge_s = period_s * blink.code.EdgeAt(begin_of_period_s + blink.phase_s);
      const double on_s = begin_of_period_s + edge_s;
      const double off_s = begin_of_period_s + blink.duty * period_s - edge_s;
      const auto within = [&](double t) { return std::clamp(t, begin_s, end_s); };
      AddPiece(within(begin_of_period_s), within(on_s), false, exposure_s, longest_part_s, &parts);
      AddPiece(within(on_s), within(off_s), true, exposure_s, longest_part_s, &parts);
      AddPiece(within(off_s), within(begin_of_period_s + period_s), false, exposure_s,
               longest_part_s, &parts);
    }
  }
  if (exposure_s > longest_part_s) return parts;
  ExposurePart whole{0, 1, 0};
  for (const ExposurePart& part : parts) {
    whole.lit_share += part.lit_share;
    whole.dt_s += part.lit_share * part.dt_s;
  }
  if (whole.lit_share > 0) whole.dt_s /= whole.lit_share;
  return {whole};
}

}  // namespace rigcal
