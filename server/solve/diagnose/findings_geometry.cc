// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/statistics/robust_statistics.h"
#include "server/solve/diagnose/finding_causes.h"
#include "server/solve/initialize/shared_views.h"

namespace rigcal::server {
namespace {

// Below this angle between two rays 0.3 px put a point some percent of its distance off.
constexpr double kNarrowDegrees = 2;
constexpr double kLooseSigmaShare = 0.005;  // of the distance to the wand
constexpr size_t kMinInstants = 8;

// A camera's geometry to the wand over the instants it shares with others.
struct Sighting {
  std::vector<double> degrees;     // by instant, the widest angle at the wand to another camera
  std::vector<double> distance_m;  // likewise, to the wand
  std::vector<int> shared;         // by camera, instants
};

std::vector<Sighting> Sightings(const BundleProblem& problem) {
  const size_t count = problem.cameras.size();
  std::vector<Sighting> sightings(count, {{}, {}, std::vector<int>(count, 0)});
  std::vector<Eigen::Vector3d> centres;
  for (const BundleCamera& camera : problem.cameras) {
    centres.push_back(camera.cam_from_rig.SourceFromTargetTranslation());
  }
  for (const BundleInstant& instant : problem.instants) {
    if (!instant.used || instant.observation_count < 2) continue;
    for (const BundleObservation& observation : problem.ObservationsOf(instant)) {
      const auto own = static_cast<size_t>(observation.camera);
      const Eigen::Vector3d ray = instant.origin_m - centres[own];
      double widest = 0;
      for (const BundleObservation& beside : problem.ObservationsOf(instant)) {
        const auto other = static_cast<size_t>(beside.camera);
        if (other == own) continue;
        const Eigen::Vector3d other_ray = instant.origin_m - centres[other];
        // Rays that meet head on do not tell the distance either.
        widest =
            std::max(widest, std::atan2(ray.cross(other_ray).norm(), std::abs(ray.dot(other_ray))));
        ++sightings[own].shared[other];
      }
      sightings[own].degrees.push_back(widest * 180 / M_PI);
      sightings[own].distance_m.push_back(ray.norm());
    }
  }
  return sightings;
}

size_t Partner(const Sighting& sighting) {
  return static_cast<size_t>(std::ranges::max_element(sighting.shared) - sighting.shared.begin());
}

}  // namespace

std::vector<Cause> FindNarrowBaselines(const CauseInput& input) {
  const BundleProblem& problem = input.evaluated.solution.built.problem;
  const std::vector<Sighting> sightings = Sightings(problem);
  std::vector<bool> named(sightings.size(), false);
  std::vector<Cause> causes;
  for (size_t c = 0; c < sightings.size(); ++c) {
    if (sightings[c].degrees.size() < kMinInstants) continue;
    const double degrees = UpperMedian(sightings[c].degrees);
    const size_t partner = Partner(sightings[c]);
    if (!(degrees < kNarrowDegrees) || named[partner]) continue;
    named[c] = true;
    const std::string& name = problem.cameras[partner].name;
    causes.push_back(
        {{FindingKind::kNarrowBaseline, problem.cameras[c].name, degrees, "degrees",
          absl::StrFormat("it and the other cameras that see the wand at the same time, %s above "
                          "all, see it from nearly one direction (or from opposite ones): the "
                          "distance hangs on the wand's length alone, and points are triangulated "
                          "badly. Put it and %s further apart, at 10 degrees or more as seen from "
                          "the wand, or add a camera that sees the wand from the side",
                          name, name)},
         0});
  }
  return causes;
}

std::vector<Cause> FindLoosePoses(const CauseInput& input) {
  const BundleProblem& problem = input.evaluated.solution.built.problem;
  if (!input.evaluated.uncertainty) return {};
  const std::vector<Sighting> sightings = Sightings(problem);
  // As PredictedError has it: in the frame of the reference camera all others turn with its error.
  // Without what kept lenses and the scatter of parts add, which are no matter of the motion.
  const std::vector<double> sigmas_m = PredictCentreSigmas(
      problem, *input.evaluated.uncertainty, {}, 1);
  std::vector<Cause> causes;
  for (size_t c = 0; c < sightings.size(); ++c) {
    if (sightings[c].distance_m.empty()) continue;
    const double sigma_m = sigmas_m[c];
    const double distance_m = UpperMedian(sightings[c].distance_m);
    if (sigma_m <= kLooseSigmaShare * distance_m) continue;
    const size_t partner = Partner(sightings[c]);
    const std::string where =
        DescribeSharedViews(problem, static_cast<int>(c), static_cast<int>(partner));
    causes.push_back(
        {{FindingKind::kLoosePose, problem.cameras[c].name, 1e3 * sigma_m, "mm",
          absl::StrFormat(
              "what was recorded holds its position in the rig to %.0f mm (one sigma) "
              "only, %.1f %% of its distance to the wand%s. Wave the wand where it and %s see "
              "it, in the rest of both images, near and far, and turn it",
              1e3 * sigma_m, 100 * sigma_m / distance_m,
              where.empty() ? "" : absl::StrCat(": ", where), problem.cameras[partner].name)},
         0});
  }
  return causes;
}

}  // namespace rigcal::server
