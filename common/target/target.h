// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace rigcal {

inline constexpr int kMaxMarkers = 16;

enum class TargetKind : uint8_t { kWand = 1, kPoint = 2 };

// The waved target: markers on a line. Frame `wand`: origin at marker 0, x along the wand.
struct Target {
  TargetKind kind = TargetKind::kWand;
  std::vector<double> marker_positions_m;  // strictly increasing, first 0
  double diameter_m = 0;                   // of the spheres; 0 = not known
  std::vector<double> blink_hz;            // none, one for all, or one per marker
  double span_tolerance_m = 0.002;         // one sigma of each span between neighbours

  int marker_count() const { return static_cast<int>(marker_positions_m.size()); }
  friend bool operator==(const Target&, const Target&) = default;

  // Every fault. A wand needs at least two distinct positions, a point exactly one.
  absl::Status Validate() const;
};

// Reads `wand:0,0.13,0.39;diameter=0.04;hz=500;tolerance=0.002` or `point`. Positions may be given
// in any order and from any origin: they are sorted and moved to begin at 0. The error quotes the
// offending part and shows a right example.
absl::StatusOr<Target> ParseTarget(std::string_view text);
// The same notation; ParseTarget(FormatTarget(t)) == t.
std::string FormatTarget(const Target& target);

}  // namespace rigcal
