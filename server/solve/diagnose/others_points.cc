// SPDX-License-Identifier: Apache-2.0
#include "server/solve/diagnose/others_points.h"

#include <algorithm>

#include "server/solve/geometry/marker_rays.h"
#include "server/solve/geometry/triangulation.h"

namespace rigcal::server {
namespace {

constexpr double kOthersAgreePx = 5;
// More cameras make a point hardly better, and every camera asks for the others' points.
constexpr size_t kMostViews = 8;

}  // namespace

std::vector<TimedMarker> MarkersSeenBy(
    const BundleProblem& problem, const std::vector<int64_t>& instant_time_ns,
    const std::function<bool(const BundleObservation& observation)>& takes_part, size_t max_count,
    const std::vector<size_t>* among) {
  const std::vector<Intrinsics> intrinsics = CurrentIntrinsics(problem);
  const size_t markers = problem.target.marker_positions_m.size();
  std::vector<bool> allowed(problem.cameras.size());
  std::vector<TimedMarker> points;
  const size_t count = among != nullptr ? among->size() : problem.instants.size();
  const size_t stride = 1 + count * markers / std::max<size_t>(1, max_count);
  for (size_t n = 0; n < count; n += stride) {
    const size_t i = among != nullptr ? (*among)[n] : n;
    const BundleInstant& instant = problem.instants[i];
    if (!instant.used || instant.is_rigid) continue;
    allowed.assign(problem.cameras.size(), false);
    // Each instant begins with another camera.
    const auto observations = problem.ObservationsOf(instant);
    size_t views_left = kMostViews;
    for (size_t k = 0; k < observations.size() && views_left > 0; ++k) {
      const BundleObservation& observation = observations[(i + k) % observations.size()];
      if (!takes_part(observation)) continue;
      allowed[static_cast<size_t>(observation.camera)] = true;
      --views_left;
    }
    const std::vector<MarkerRay> rays = UsedMarkerRays(problem, intrinsics, instant, &allowed);
    for (size_t m = 0; m < markers; ++m) {
      std::vector<CameraRay> views;
      std::vector<double> focal_px;
      for (const MarkerRay& ray : rays) {
        const auto camera = static_cast<size_t>(ray.camera);
        if (ray.marker != static_cast<int>(m) || !ray.has_ray) continue;
        views.push_back(ray.ray);
        focal_px.push_back(problem.cameras[camera].intrinsics[0]);
      }
      const auto point = Triangulate(views);
      if (!point) continue;
      bool agree = true;
      for (size_t v = 0; v < views.size(); ++v) {
        agree = agree && RayError(views[v], *point) * focal_px[v] < kOthersAgreePx;
      }
      if (agree) {
        const int label = static_cast<int>(m) - problem.target.WandOf(static_cast<int>(m)).first;
        points.push_back({label, instant_time_ns[i], *point});
      }
    }
  }
  std::ranges::stable_sort(points, {}, &TimedMarker::rig_time_ns);
  return points;
}

}  // namespace rigcal::server
