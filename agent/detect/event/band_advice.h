// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "agent/detect/event/burst_measurer.h"

namespace rigcal::agent {

// A band (BlinkTuning::band_rel) that keeps the wand's markers and leaves other lights out, and the
// frequency of the nearest of these.
struct BandAdvice {
  double band_rel = 0;
  double other_hz = 0;
};

// Where more lights than the wand has markers blink within the band, but the others clearly further
// away from the target's frequency: lamps, not another wand. None: no band separates them.
// `blink_hz`: as BlinkFilterOptions'.
std::optional<BandAdvice> AdviseBand(const std::vector<BlinkBlob>& blobs, size_t marker_count,
                                     const std::vector<double>& blink_hz);

}  // namespace rigcal::agent
