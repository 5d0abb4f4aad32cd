// SPDX-License-Identifier: Apache-2.0
#include "server/solve/rig/sphere_centres.h"

#include "common/camera/sphere_projection.h"

namespace rigcal::server {
namespace {

bool IsImageBlob(const AlignedTrack& track, const ImageMotion& motion, int observation,
                 int marker) {
  const ObservationTable& rows = track.track.observations;
  const auto row = static_cast<size_t>(observation);
  const auto label = static_cast<size_t>(marker);
  const size_t source = motion.IsFlipped(observation) ? rows.MarkerCount(row) - 1 - label : label;
  return rows.centre_kind(row, source) == CentreKind::kImageBlob;
}

}  // namespace

int CorrectSphereCentres(const TargetParts& targets, const std::vector<AlignedTrack>& tracks,
                         const std::vector<ImageMotion>& motions, bool is_metric,
                         BuiltProblem* built) {
  if (!is_metric) return 0;
  BundleProblem& problem = built->problem;
  const std::vector<Intrinsics> intrinsics = CurrentIntrinsics(problem);
  int count = 0;
  for (const BundleInstant& instant : problem.instants) {
    if (!instant.used) continue;
    for (const BundleObservation& observation : problem.ObservationsOf(instant)) {
      const auto camera = static_cast<size_t>(observation.camera);
      if (observation.marker_count == 0) continue;
      const MarkerSource& first = built->sources[static_cast<size_t>(observation.first_marker)];
      const TargetParts::Part& part =
          targets.Of(tracks[static_cast<size_t>(first.track)].track.session_id);
      if (!(part.target.diameter_m > 0)) continue;
      for (BundleMarker& marker : problem.MarkersOf(observation)) {
        const MarkerSource& source = built->sources[problem.IndexOf(marker)];
        const auto t = static_cast<size_t>(source.track);
        if (!IsImageBlob(tracks[t], motions[t], source.observation,
                         marker.marker - part.first_marker)) {
          continue;
        }
        const double distance_m =
            (problem.cameras[camera].cam_from_rig * problem.PointOf(instant, marker)).norm();
        Eigen::Vector2d centre_px = marker.centre_px;
        count += SphereCentreFromCentroid(intrinsics[camera], centre_px, distance_m,
                                          part.target.diameter_m, &centre_px);
        marker.centre_px = centre_px;
      }
    }
  }
  return count;
}

}  // namespace rigcal::server
