// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/rig/marker_fates.h"

#include <cstdint>
#include <limits>
#include <map>

#include "tests/accuracy/rig/simulated_tracks.h"

namespace rigcal::accuracy {
namespace {

double ShareOf(int part, int rest) {
  if (part + rest == 0) return std::numeric_limits<double>::quiet_NaN();
  return static_cast<double>(part) / (part + rest);
}

// Finds the camera and frame that a marker of the problem comes from.
class RowFinder {
 public:
  explicit RowFinder(const SimulatedWorld& world) : world_(world) {
    for (int c = 0; c < static_cast<int>(world.cameras().size()); ++c) {
      frame_of_time_.emplace_back();
      for (int frame = 0; frame < world.FrameCount(c); ++frame) {
        frame_of_time_.back()[world.Observe(c, frame).time_ns] = frame;
      }
    }
  }
  int Camera(const server::AlignedTrack& track) const {
    return CameraIndex(world_, track.track.camera.camera);
  }
  int Frame(int camera, int64_t time_ns) const {
    return frame_of_time_[static_cast<size_t>(camera)].at(time_ns);
  }

 private:
  const SimulatedWorld& world_;
  std::vector<std::map<int64_t, int>> frame_of_time_;
};

// Index in the row of a marker whose label the solver may have flipped, and whose centre it may
// have moved a little along its path.
size_t MarkerInRow(const Observation& row, const server::BundleMarker& marker) {
  const auto label = static_cast<size_t>(marker.marker);
  const size_t other = row.markers.size() - 1 - label;
  if (!row.markers[label].visible) return other;
  if (!row.markers[other].visible) return label;
  const double here = (row.markers[label].centre_px - marker.centre_px).squaredNorm();
  const double there = (row.markers[other].centre_px - marker.centre_px).squaredNorm();
  return there < here ? other : label;
}

struct RowFate {
  bool any_end = false;
  bool flipped = false;           // by the solver
  bool kept_as_labelled = false;  // an end marker is used with the label of the row
};

}  // namespace

FateCounts& FateCounts::operator+=(const FateCounts& other) {
  for (int FateCounts::*count :
       {&FateCounts::outlier_removed, &FateCounts::outlier_kept, &FateCounts::good_removed,
        &FateCounts::good_kept, &FateCounts::flipped_corrected, &FateCounts::flipped_removed,
        &FateCounts::flipped_kept, &FateCounts::good_flipped}) {
    this->*count += other.*count;
  }
  return *this;
}

double FateCounts::OutlierPrecision() const { return ShareOf(outlier_removed, good_removed); }
double FateCounts::OutlierRecall() const { return ShareOf(outlier_removed, outlier_kept); }
double FateCounts::FlippedRecall() const {
  return ShareOf(flipped_corrected + flipped_removed, flipped_kept);
}

FateCounts CountFates(const SimulatedWorld& world, const server::RigObservations& rig,
                      const server::RigSolution& solution) {
  const std::vector<std::vector<RowGroundTruth>> truth = MakeRowGroundTruth(world);
  const RowFinder rows(world);
  const server::BundleProblem& problem = solution.built.problem;
  FateCounts counts;
  for (const server::BundleInstant& instant : problem.instants) {
    if (!instant.used) continue;
    for (int o = 0; o < instant.observation_count; ++o) {
      const server::BundleObservation& observation =
          problem.observations[static_cast<size_t>(instant.first_observation + o)];
      RowFate fate;
      bool row_is_flipped = false;
      for (int i = 0; i < observation.marker_count; ++i) {
        const auto m = static_cast<size_t>(observation.first_marker + i);
        const server::MarkerSource& source = solution.built.sources[m];
        const server::AlignedTrack& track = rig.tracks[static_cast<size_t>(source.track)];
        const int camera = rows.Camera(track);
        const int frame = rows.Frame(
            camera, track.track.observations.time_ns(static_cast<size_t>(source.observation)));
        const RowGroundTruth& row_truth =
            truth[static_cast<size_t>(camera)][static_cast<size_t>(frame)];
        const server::BundleMarker& marker = problem.markers[m];
        const size_t in_row = MarkerInRow(world.Observe(camera, frame), marker);
        row_is_flipped = row_truth.flipped;
        if (row_truth.is_outlier[in_row]) {
          ++(marker.used ? counts.outlier_kept : counts.outlier_removed);
          continue;
        }
        const bool is_end = 2 * in_row + 1 != row_truth.is_outlier.size();
        const bool flipped = in_row != static_cast<size_t>(marker.marker);
        fate.any_end |= is_end;
        fate.flipped |= flipped && marker.used;
        fate.kept_as_labelled |= is_end && !flipped && marker.used;
        if (!row_is_flipped) ++(marker.used ? counts.good_kept : counts.good_removed);
      }
      if (!fate.any_end) continue;
      if (!row_is_flipped) {
        counts.good_flipped += fate.flipped ? 1 : 0;
      } else if (fate.kept_as_labelled) {
        ++counts.flipped_kept;
      } else {
        ++(fate.flipped ? counts.flipped_corrected : counts.flipped_removed);
      }
    }
  }
  return counts;
}

}  // namespace rigcal::accuracy
