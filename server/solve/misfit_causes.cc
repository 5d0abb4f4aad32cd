// SPDX-License-Identifier: Apache-2.0
#include "server/solve/misfit_causes.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <utility>
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
constexpr double kMostViews = 0.8;
constexpr double kAlikeRows = 0.02;  // numbers of rows that are as many, spans that are as long
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

// The markers of a row in the order in which they lie on their line, the lower end first; none
// where one of them was not seen.
std::vector<size_t> OrderOnLine(const ObservationTable& rows, size_t row, size_t markers) {
  Eigen::Vector2d along = Eigen::Vector2d::Zero();
  for (size_t m = 0; m < markers; ++m) {
    if (!rows.IsVisible(row, m)) return {};
    for (size_t k = 0; k < m; ++k) {
      const Eigen::Vector2d span = rows.centre_px(row, m) - rows.centre_px(row, k);
      if (span.norm() > along.norm()) along = span;
    }
  }
  std::vector<size_t> order(markers);
  std::iota(order.begin(), order.end(), size_t{0});
  std::ranges::stable_sort(order, {}, [&](size_t m) { return rows.centre_px(row, m).dot(along); });
  if (order.front() > order.back()) std::ranges::reverse(order);
  return order;
}

// Cameras whose markers lie on their line in another order than on the wand, which no image shows.
std::string OrderContradiction(const RigObservations& rig) {
  std::map<std::string, std::map<std::vector<size_t>, size_t>> by_camera;
  for (size_t t = 0; t < rig.tracks.size(); ++t) {
    const Target& target = rig.TargetOf(t);
    if (target.kind != TargetKind::kWand || target.marker_positions_m.size() < 3) continue;
    const ObservationTable& rows = rig.tracks[t].track.observations;
    for (size_t i = 0; i < rows.size(); ++i) {
      std::vector<size_t> order = OrderOnLine(rows, i, target.marker_positions_m.size());
      if (!order.empty()) ++by_camera[rig.tracks[t].track.camera.camera][std::move(order)];
    }
  }
  std::vector<std::string> faults;
  for (const auto& [camera, orders] : by_camera) {
    size_t views = 0;
    for (const auto& [order, count] : orders) views += count;
    for (const auto& [order, count] : orders) {
      const bool is_most = static_cast<double>(count) > kMostViews * static_cast<double>(views);
      if (!is_most || views < kMinViews || std::ranges::is_sorted(order)) continue;
      faults.push_back(absl::StrCat("camera ", camera, " shows the markers in the order ",
                                    absl::StrJoin(order, ", "), " along the wand in ", count,
                                    " of ", views, " views"));
    }
  }
  if (faults.empty()) return "";
  return absl::StrCat(
      faults.front(),
      faults.size() > 1 ? absl::StrCat(" (and ", faults.size() - 1, " other cameras alike)") : "",
      ": two of them are exchanged; write them in the order of the target");
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

std::string StretchedStamps(const RigObservations& rig, const std::string& camera) {
  double own_rows = 0, own_s = 0;
  std::vector<double> rows, spans_s;
  for (const AlignedTrack& track : rig.tracks) {
    const ObservationTable& table = track.track.observations;
    if (table.size() < kMinViews || track.is_static) continue;
    const auto count = static_cast<double>(table.size());
    const double span_s = 1e-9 * (static_cast<double>(table.time_ns(table.size() - 1)) -
                                  static_cast<double>(table.time_ns(0)));
    if (track.track.camera.camera == camera) {
      // In several sessions or clock epochs the whole says nothing.
      if (own_rows > 0) return "";
      own_rows = count;
      own_s = span_s;
    } else {
      rows.push_back(count);
      spans_s.push_back(span_s);
    }
  }
  if (own_rows == 0 || rows.size() < 2) return "";
  const double others_s = UpperMedian(&spans_s), others_rows = UpperMedian(&rows);
  const double others_apart = std::ranges::max(spans_s) / std::ranges::min(spans_s) - 1;
  const bool as_many = std::abs(own_rows / others_rows - 1) < kAlikeRows;
  const bool is_longer = std::abs(own_s / others_s - 1) > std::max(kAlikeRows, 3 * others_apart);
  if (!as_many || !is_longer) return "";
  return absl::StrFormat(
      "its %.0f rows last %.4g s by their stamps, as many of the others %.4g s: were its stamps "
      "counted with a wrong frame rate?",
      own_rows, own_s, others_s);
}

std::string SpanContradiction(const RigObservations& rig) {
  if (std::string order = OrderContradiction(rig); !order.empty()) return order;
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
