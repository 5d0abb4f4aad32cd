// SPDX-License-Identifier: Apache-2.0
#include "server/solve/rig/labels.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "server/solve/bundle/marker_residual_px.h"
#include "server/solve/geometry/marker_rays.h"
#include "server/solve/geometry/target_pose.h"
#include "server/solve/rig/outliers.h"

namespace rigcal::server {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kMinGain = 0.5;
constexpr double kTruncationPx = 6;
// Instants of more observations outvote one that is flipped.
constexpr int kMaxContestedObservations = 4;
constexpr double kNeighbourS = 0.2;         // two instants this close are neighbours
constexpr double kMinOppositeCosine = 0.5;  // below minus this, directions are opposite

class LabelContest {
 public:
  LabelContest(const BundleProblem& problem, const std::vector<int64_t>& instant_time_ns)
      : problem_(problem),
        instant_time_ns_(instant_time_ns),
        has_pose_(problem.cameras.size(), true),
        intrinsics_(CurrentIntrinsics(problem)),
        limits_(OutlierLimits(problem)) {}

  std::vector<int> Run() {
    std::vector<int> flipped;
    for (size_t i = 0; i < problem_.instants.size(); ++i) {
      const BundleInstant& instant = problem_.instants[i];
      if (instant.is_rigid || !HasTwoEnds(instant)) continue;
      std::vector<int> found;
      if (instant.used) found = AgainstTheOthers(instant);
      if (found.empty() && IsAgainstItsNeighbours(i)) found = AllIfMirrored(instant);
      if (!IsExplained(instant, found)) {
        if (const auto contested = Contested(instant)) found = {*contested};
      }
      flipped.insert(flipped.end(), found.begin(), found.end());
    }
    std::sort(flipped.begin(), flipped.end());
    return flipped;
  }

 private:
  // The wand that the instant shows.
  BundleWand WandOf(const BundleInstant& instant) const {
    for (const BundleObservation& observation : problem_.ObservationsOf(instant)) {
      for (const BundleMarker& marker : problem_.MarkersOf(observation)) {
        return problem_.target.WandOf(marker.marker);
      }
    }
    return {};
  }
  // One marker has one order.
  bool HasTwoEnds(const BundleInstant& instant) const {
    const BundleWand wand = WandOf(instant);
    return wand.end - wand.first > 1;
  }

  // `pose` is the instant's, or one to be tried.
  double Score(const BundleInstant& pose, int index, bool flipped) const {
    const BundleObservation& observation = problem_.observations[static_cast<size_t>(index)];
    const double limit = limits_[static_cast<size_t>(observation.camera)];
    double score = 0;
    for (BundleMarker marker : problem_.MarkersOf(observation)) {
      if (flipped) marker.marker = problem_.target.WandOf(marker.marker).Mirrored(marker.marker);
      const auto residual = MarkerResidualPx(problem_, pose, observation, marker);
      const double share =
          residual ? (marker.sqrt_information * *residual).squaredNorm() / (limit * limit) : 1;
      score += share < 1 ? share : 1;
    }
    return score;
  }

  double TotalScore(const BundleInstant& pose, const std::vector<int>& flipped) const {
    double total = 0;
    for (int o = 0; o < pose.observation_count; ++o) {
      const int index = pose.first_observation + o;
      total +=
          Score(pose, index, std::find(flipped.begin(), flipped.end(), index) != flipped.end());
    }
    return total;
  }

  std::vector<int> AgainstTheOthers(const BundleInstant& instant) const {
    std::vector<int> found;
    for (int o = 0; o < instant.observation_count; ++o) {
      const int index = instant.first_observation + o;
      const double given = Score(instant, index, false);
      if (given > kMinGain && given - Score(instant, index, true) > kMinGain) {
        found.push_back(index);
      }
    }
    return found;
  }

  bool IsAgainstItsNeighbours(size_t i) const {
    if (i == 0 || i + 1 >= problem_.instants.size() || !problem_.instants[i].used) return false;
    for (const size_t j : {i - 1, i + 1}) {
      const double away_s =
          1e-9 * std::abs(static_cast<double>(instant_time_ns_[j] - instant_time_ns_[i]));
      const double cosine = problem_.instants[j].direction.dot(problem_.instants[i].direction);
      if (!problem_.instants[j].used || problem_.instants[j].is_rigid || away_s > kNeighbourS ||
          cosine > -kMinOppositeCosine) {
        return false;
      }
    }
    return true;
  }

  // All observations of the instant, where they fit the target flipped about its middle as well.
  std::vector<int> AllIfMirrored(const BundleInstant& instant) const {
    BundleInstant mirrored = instant;
    const auto last = static_cast<size_t>(WandOf(instant).end) - 1;
    mirrored.origin_m += problem_.target.marker_positions_m[last] * instant.direction;
    mirrored.direction = -instant.direction;
    std::vector<int> all;
    for (int o = 0; o < instant.observation_count; ++o) {
      all.push_back(instant.first_observation + o);
    }
    const double lost = TotalScore(mirrored, all) - TotalScore(instant, {});
    return lost < kMinGain ? all : std::vector<int>{};
  }

  // Nothing is left that another order of labels would have to explain.
  bool IsExplained(const BundleInstant& instant, const std::vector<int>& flipped) const {
    return instant.used && TotalScore(instant, flipped) < kMinGain;
  }

  std::optional<int> Contested(const BundleInstant& instant) const {
    if (instant.observation_count < 2 || instant.observation_count > kMaxContestedObservations) {
      return std::nullopt;
    }
    BundleProblem small = OneInstant(instant);
    std::vector<Eigen::Vector2d> rays(small.markers.size());
    UndistortInstant(small, intrinsics_, small.instants.front(), &rays);
    const double as_is = PlacedScore(instant, -1, rays, &small);
    // The labels as they are would be a next best that fits nearly as well.
    if (as_is <= kMinGain) return std::nullopt;
    double best = kInfinity, second = as_is;
    int best_index = -1;
    for (int o = 0; o < instant.observation_count; ++o) {
      const int index = instant.first_observation + o;
      const double score = PlacedScore(instant, index, rays, &small);
      second = std::min(second, std::max(score, best));
      if (score < best) best_index = index;
      best = std::min(best, score);
    }
    if (!(best < kMinGain) || !(second - best > kMinGain)) return std::nullopt;
    return best_index;
  }

  // Of all the instant's markers, with the target placed anew and one observation flipped; -1:
  // none. `small` is OneInstant's and comes back as it was, `rays` are its undistorted markers.
  double PlacedScore(const BundleInstant& instant, int flipped,
                     const std::vector<Eigen::Vector2d>& rays, BundleProblem* small) const {
    const int index = flipped - instant.first_observation;  // in `small`
    if (flipped >= 0) FlipLabels(index, small);
    auto fit = EstimateTargetPose(*small, has_pose_, rays, kTruncationPx, small->instants.front());
    if (flipped >= 0) FlipLabels(index, small);
    if (!fit) return kInfinity;
    fit->instant.first_observation = instant.first_observation;
    return TotalScore(fit->instant, flipped >= 0 ? std::vector<int>{flipped} : std::vector<int>{});
  }

  // A copy of one instant in which every marker takes part.
  BundleProblem OneInstant(const BundleInstant& instant) const {
    BundleProblem small;
    small.cameras = problem_.cameras;
    small.clocks = problem_.clocks;
    small.target = problem_.target;
    small.instants = {instant};
    small.instants.front().first_observation = 0;
    for (const BundleObservation& observation : problem_.ObservationsOf(instant)) {
      const auto markers = problem_.MarkersOf(observation);
      small.observations.push_back(observation);
      small.observations.back().first_marker = static_cast<int>(small.markers.size());
      small.markers.insert(small.markers.end(), markers.begin(), markers.end());
    }
    for (BundleMarker& marker : small.markers) marker.used = true;
    return small;
  }

  const BundleProblem& problem_;
  const std::vector<int64_t>& instant_time_ns_;
  const std::vector<bool> has_pose_;
  const std::vector<Intrinsics> intrinsics_;
  const std::vector<double> limits_;  // by camera
};

}  // namespace

std::vector<int> FindFlippedLabels(const BundleProblem& problem,
                                   const std::vector<int64_t>& instant_time_ns) {
  return LabelContest(problem, instant_time_ns).Run();
}

void FlipLabels(int observation, BundleProblem* problem) {
  const BundleObservation& entry = problem->observations[static_cast<size_t>(observation)];
  for (BundleMarker& marker : problem->MarkersOf(entry)) {
    marker.marker = problem->target.WandOf(marker.marker).Mirrored(marker.marker);
    marker.used = true;
  }
}

}  // namespace rigcal::server
