// SPDX-License-Identifier: Apache-2.0
#include "server/solve/initialize/shared_views.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "common/statistics/robust_statistics.h"

namespace rigcal::server {
namespace {

// Of the way from the image's centre to its edge: nearer is the middle.
constexpr double kMiddleShare = 1.0 / 3;
// Views beyond these do not count for the extent.
constexpr double kLowQuantile = 0.05, kHighQuantile = 0.95;

// Along one axis, in focal lengths from the centre.
struct Extent {
  double middle = 0, degrees = 0;
};

Extent ExtentOf(std::vector<double> values) {
  const double low = LowerQuantile(&values, kLowQuantile),
               high = LowerQuantile(&values, kHighQuantile);
  return {LowerQuantile(&values, 0.5), (std::atan(high) - std::atan(low)) * 180 / M_PI};
}

std::string PlaceIn(const BundleCamera& camera, std::vector<double> x, std::vector<double> y) {
  const double fx = camera.intrinsics[0], fy = camera.intrinsics[1];
  const Extent across = ExtentOf(std::move(x)), down = ExtentOf(std::move(y));
  const double right = across.middle * fx / camera.intrinsics[2],
               below = down.middle * fy / camera.intrinsics[3];
  const std::string vertical = below < -kMiddleShare  ? "upper"
                               : below > kMiddleShare ? "lower"
                                                      : "";
  const std::string horizontal = right < -kMiddleShare  ? "left"
                                 : right > kMiddleShare ? "right"
                                                        : "";
  std::string place =
      absl::StrCat(vertical, vertical.empty() || horizontal.empty() ? "" : " ", horizontal);
  if (place.empty()) place = "middle";
  if (place == vertical) place += " part";
  return absl::StrFormat("the %s of %s's image (%.0f x %.0f degrees)", place, camera.name,
                         across.degrees, down.degrees);
}

// Between the nearest two of two sorted lists; infinite where one is empty.
double NearestS(const std::vector<int64_t>& a, const std::vector<int64_t>& b) {
  double nearest_s = INFINITY;
  for (size_t i = 0, j = 0; i < a.size() && j < b.size(); a[i] < b[j] ? ++i : ++j) {
    nearest_s = std::min(nearest_s, 1e-9 * std::abs(static_cast<double>(a[i] - b[j])));
  }
  return nearest_s;
}

}  // namespace

const BundleObservation* ObservationBy(const BundleProblem& problem, const BundleInstant& instant,
                                       int camera) {
  for (const BundleObservation& observation : problem.ObservationsOf(instant)) {
    if (observation.camera == camera && observation.marker_count > 0) return &observation;
  }
  return nullptr;
}

std::vector<std::vector<int>> CountShared(
    const BundleProblem& problem,
    const std::function<bool(const BundleInstant&, const BundleObservation&)>& counts) {
  const size_t size = problem.cameras.size();
  std::vector<std::vector<int>> shared(size, std::vector<int>(size, 0));
  for (const BundleInstant& instant : problem.instants) {
    std::vector<size_t> seen;
    for (const BundleObservation& observation : problem.ObservationsOf(instant)) {
      if (counts(instant, observation)) seen.push_back(static_cast<size_t>(observation.camera));
    }
    for (const size_t a : seen) {
      for (const size_t b : seen) ++shared[a][b];
    }
  }
  return shared;
}

std::string DescribeSharedViews(const BundleProblem& problem, int a, int b) {
  std::vector<std::string> places;
  for (const int camera : {a, b}) {
    const BundleCamera& own = problem.cameras[static_cast<size_t>(camera)];
    std::vector<double> x, y;
    for (const BundleInstant& instant : problem.instants) {
      const BundleObservation* observation = ObservationBy(problem, instant, camera);
      if (observation == nullptr ||
          ObservationBy(problem, instant, camera == a ? b : a) == nullptr) {
        continue;
      }
      for (const BundleMarker& marker : problem.MarkersOf(*observation)) {
        const Eigen::Vector2d& centre_px = marker.centre_px;
        if (!centre_px.allFinite()) continue;
        x.push_back((centre_px.x() - own.intrinsics[2]) / own.intrinsics[0]);
        y.push_back((centre_px.y() - own.intrinsics[3]) / own.intrinsics[1]);
      }
    }
    if (x.empty()) return "";
    places.push_back(PlaceIn(own, std::move(x), std::move(y)));
  }
  return absl::StrCat("both saw it in ", absl::StrJoin(places, " and in "));
}

std::string DescribeLostCameras(const BundleProblem& problem, int min_views) {
  auto shared =
      CountShared(problem, [](const BundleInstant&, const BundleObservation&) { return true; });
  const auto agreeing = CountShared(problem, [&problem](const BundleInstant& instant,
                                                        const BundleObservation& observation) {
    return instant.used && std::ranges::any_of(problem.MarkersOf(observation), &BundleMarker::used);
  });
  std::vector<std::string> lost;
  for (size_t c = 0; c < shared.size(); ++c) {
    if (agreeing[c][c] >= min_views) continue;
    const int views = std::exchange(shared[c][c], -1);
    const auto partner =
        static_cast<size_t>(std::ranges::max_element(shared[c]) - shared[c].begin());
    const std::string where =
        DescribeSharedViews(problem, static_cast<int>(c), static_cast<int>(partner));
    lost.push_back(absl::StrCat(
        "camera ", problem.cameras[c].name, ": of the ", views,
        " wand views that it shares with others ", agreeing[c][c], " agree with them (at least ",
        min_views, " are needed). It shares most with ", problem.cameras[partner].name, " (",
        shared[c][partner], where.empty() ? "" : "; ", where,
        "): if these are many, check its clock, its intrinsics and its markers' labels; if they "
        "are few or in one place, wave the wand where both see it, in the rest of both images, "
        "near and far, and turn it"));
  }
  return absl::StrJoin(lost, "; ");
}

std::string DescribeNearestViews(const std::vector<AlignedTrack>& tracks,
                                 const std::vector<std::vector<int64_t>>& rig_time_ns) {
  std::vector<std::vector<int64_t>> seen(tracks.size());
  for (size_t t = 0; t < tracks.size(); ++t) {
    for (size_t i = 0; i < rig_time_ns[t].size(); ++i) {
      if (tracks[t].track.observations.AnyVisible(i)) {
        seen[t].push_back(rig_time_ns[t][i]);
      }
    }
    std::ranges::sort(seen[t]);
  }
  double nearest_s = INFINITY;
  std::string nearest;
  for (size_t a = 0; a < tracks.size(); ++a) {
    for (size_t b = a + 1; b < tracks.size(); ++b) {
      const CleanTrack &left = tracks[a].track, &right = tracks[b].track;
      if (left.camera.camera == right.camera.camera || left.session_id != right.session_id) {
        continue;
      }
      const double apart_s = NearestS(seen[a], seen[b]);
      if (!(apart_s < nearest_s)) continue;
      nearest_s = apart_s;
      nearest = absl::StrFormat(
          " (cameras %s and %s come nearest to it: their closest wand views are %s s apart)",
          left.camera.camera, right.camera.camera,
          nearest_s < 1000 ? absl::StrFormat("%.4g", nearest_s)
                           : absl::StrFormat("%.0f", nearest_s));
    }
  }
  return nearest;
}

}  // namespace rigcal::server
