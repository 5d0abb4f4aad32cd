// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace rigcal {

struct Board;

inline constexpr int kMaxMarkers = 200;     // of a rigid target, and static points
inline constexpr int kMaxWandMarkers = 16;  // of a wand

enum class TargetKind : uint8_t { kWand = 1, kPoint = 2, kRigid = 3, kStatic = 4 };

// A marker of a rigid target, in a frame `target` of the target's own; or a static point, in the
// frame of its survey. Metres.
struct TargetPoint {
  std::string label;
  double x_m = 0, y_m = 0, z_m = 0;
  double sigma_m = 0;  // one sigma of each coordinate as given; 0: exact, never estimated

  friend bool operator==(const TargetPoint&, const TargetPoint&) = default;
};

// What the cameras see: a waved target, with markers on a line or labelled points of a rigid body;
// or labelled points that stay where they are while they are recorded. Frame `wand`: origin at
// marker 0, x along the wand.
struct Target {
  TargetKind kind = TargetKind::kWand;
  std::vector<double> marker_positions_m;  // of a wand or point: strictly increasing, first 0
  std::vector<TargetPoint> points;         // of a rigid target or static: marker m is points[m]
  bool is_surveyed = false;                // of static points: their positions are given
  // The rigid target is this printed board, as FormatBoard writes it, and `points` are its points,
  // in its order; empty: not a board.
  std::string board;
  double diameter_m = 0;            // of the spheres; 0 = not known
  std::vector<double> blink_hz;     // none, one for all, or one per marker
  double span_tolerance_m = 0.002;  // one sigma of each span between neighbours

  // Its markers are on a line, or it is one of them: no labelled points.
  bool IsLine() const { return kind == TargetKind::kWand || kind == TargetKind::kPoint; }
  bool IsStatic() const { return kind == TargetKind::kStatic; }
  // It gives the scale.
  bool HasLengths() const { return kind != TargetKind::kPoint && (!IsStatic() || is_surveyed); }
  int marker_count() const {
    return static_cast<int>(IsLine() ? marker_positions_m.size() : points.size());
  }
  friend bool operator==(const Target&, const Target&) = default;

  // Every fault. A wand needs at least two distinct positions, a point exactly one, a rigid target
  // and surveyed static points 4 to 200 distinct points that are not all on one line. Static points
  // of unknown position are 1 to 200, with labels alone.
  absl::Status Validate() const;
};

// FAILED_PRECONDITION: the detectors cannot find it in images: static points, and a rigid target
// that is not a board. Their markers come from elsewhere.
absl::Status CheckDetectable(const Target& target);
// FAILED_PRECONDITION: not a wand or a point. Events, rendered images, colours and masks are about
// those only.
absl::Status CheckIsLine(const Target& target);

// The points of a board as the markers of a rigid target, each known to `sigma_m`: how flat the
// print is and how exact. INVALID_ARGUMENT: more than kMaxMarkers points, or a board that looks the
// same when it is turned by 180 degrees, so that cameras on two sides would mix up its points.
inline constexpr double kBoardSigmaM = 0.0003;
absl::StatusOr<Target> MakeBoardTarget(const Board& board, double sigma_m = kBoardSigmaM);

// Reads `wand:0,0.13,0.39;diameter=0.04;hz=500;tolerance=0.002`, `point`, `rigid:FILE` or
// `static:FILE` with the same options, or `board:checker,9x6,0.03;flatness=0.0003` (ParseBoard;
// metres). Positions may be given in any order and from any origin:
// they are sorted and moved to begin at 0. FILE is read here (see target_file.h); `rigid:{A 0 0 0
// 0.0005|B ...}` says what would be in it. The file of static points has their labels, or all their
// positions too. The error quotes the offending part, or names file and line, and shows a right
// example.
absl::StatusOr<Target> ParseTarget(std::string_view text);
// The same notation; ParseTarget(FormatTarget(t)) == t. Labelled points come in braces.
std::string FormatTarget(const Target& target);

}  // namespace rigcal
