// SPDX-License-Identifier: Apache-2.0
#include "server/solve/misfit_causes.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "common/statistics/robust_statistics.h"

namespace rigcal::server {
namespace {

constexpr double kAloneShare = 0.05;
constexpr int64_t kNearNs = 200'000'000;
constexpr size_t kMinViews = 30;
// A wand that is turned through all directions shows its own ratio in the median; perspective moves
// single views by a fifth, and the median by a few percent.
constexpr double kOtherRatio = 1.25;

// Times of the rows with a wand of one camera, or of all others; sorted.
std::vector<int64_t> TimesOf(const RigObservations& rig, const std::string& camera, bool others) {
  std::vector<int64_t> times_ns;
  for (const AlignedTrack& track : rig.tracks) {
    if ((track.track.camera.camera == camera) == others) continue;
    const ObservationTable& rows = track.track.observations;
    for (size_t i = 0; i < rows.size(); ++i) {
      if (rows.AnyVisible(i)) times_ns.push_back(track.CoarseRigTimeNs(rows.time_ns(i)));
    }
  }
  std::ranges::sort(times_ns);
  return times_ns;
}

}  // namespace

bool SeesTheWandAlone(const RigObservations& rig, const std::string& camera) {
  const std::vector<int64_t> own_ns = TimesOf(rig, camera, false);
  const std::vector<int64_t> others_ns = TimesOf(rig, camera, true);
  size_t shared = 0;
  for (const int64_t time_ns : own_ns) {
    const auto after = std::ranges::lower_bound(others_ns, time_ns - kNearNs);
    shared += after != others_ns.end() && *after <= time_ns + kNearNs ? 1 : 0;
  }
  return static_cast<double>(shared) < kAloneShare * static_cast<double>(own_ns.size());
}

std::string SpanContradiction(const RigObservations& rig) {
  std::map<std::string, std::vector<double>> by_camera;  // logarithm of second span over first
  double given = 0;
  for (size_t t = 0; t < rig.tracks.size(); ++t) {
    const Target& target = rig.TargetOf(t);
    if (target.kind != TargetKind::kWand || target.marker_positions_m.size() < 3) continue;
    const std::vector<double>& at_m = target.marker_positions_m;
    given = std::log((at_m[2] - at_m[1]) / (at_m[1] - at_m[0]));
    const ObservationTable& rows = rig.tracks[t].track.observations;
    for (size_t i = 0; i < rows.size(); ++i) {
      if (!rows.IsVisible(i, 0) || !rows.IsVisible(i, 1) || !rows.IsVisible(i, 2)) continue;
      const double first = (rows.centre_px(i, 1) - rows.centre_px(i, 0)).norm();
      const double second = (rows.centre_px(i, 2) - rows.centre_px(i, 1)).norm();
      if (first > 0 && second > 0) {
        by_camera[rig.tracks[t].track.camera.camera].push_back(std::log(second / first));
      }
    }
  }
  const double other = std::log(kOtherRatio);
  std::vector<double> medians;
  std::vector<std::string> reversed;
  for (auto& [camera, ratios] : by_camera) {
    if (ratios.size() < kMinViews) continue;
    const double seen = UpperMedian(&ratios);
    medians.push_back(seen);
    // An equal ratio looks the same from both ends.
    if (std::abs(given) > other && std::abs(seen + given) < other) reversed.push_back(camera);
  }
  if (medians.empty()) return "";
  if (!reversed.empty() && reversed.size() < medians.size()) {
    return absl::StrCat("camera ", absl::StrJoin(reversed, ", "),
                        reversed.size() == 1 ? " counts" : " count",
                        " the markers from the other end of the wand: write them in the order of "
                        "the target");
  }
  const double seen = UpperMedian(&medians);
  if (std::abs(seen - given) < other) return "";
  return absl::StrFormat(
      "the images show spans of about 1 : %.2g, the target says 1 : %.2g: check the wand's marker "
      "positions (--target)",
      std::exp(seen), std::exp(given));
}

}  // namespace rigcal::server
