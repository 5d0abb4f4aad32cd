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

// Row of the input that a marker of the problem comes from.
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

// Which marker of the row this is: the solver may have turned its label, and moved its centre a
// little along its path.
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
  bool turned = false;
  bool kept_wrong = false;  // an end marker is used with the label the row gave it
};

}  // namespace

FateCounts& FateCounts::operator+=(const FateCounts& other) {
  for (int FateCounts::*count :
       {&FateCounts::outlier_removed, &FateCounts::outlier_kept, &FateCounts::good_removed,
        &FateCounts::good_kept, &FateCounts::reversed_turned, &FateCounts::reversed_removed,
        &FateCounts::reversed_kept, &FateCounts::straight_turned}) {
    this->*count += other.*count;
  }
  return *this;
}

double FateCounts::OutlierPrecision() const { return ShareOf(outlier_removed, good_removed); }
double FateCounts::OutlierRecall() const { return ShareOf(outlier_removed, outlier_kept); }
double FateCounts::ReversedRecall() const {
  return ShareOf(reversed_turned + reversed_removed, reversed_kept);
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
      bool reversed = false;
      for (int i = 0; i < observation.marker_count; ++i) {
        const auto m = static_cast<size_t>(observation.first_marker + i);
        const server::MarkerSource& source = solution.built.sources[m];
        const server::AlignedTrack& track = rig.tracks[static_cast<size_t>(source.track)];
        const int camera = rows.Camera(track);
        const int frame = rows.Frame(
            camera, track.track.observations[static_cast<size_t>(source.observation)].time_ns);
        const RowGroundTruth& row_truth =
            truth[static_cast<size_t>(camera)][static_cast<size_t>(frame)];
        const server::BundleMarker& marker = problem.markers[m];
        const size_t in_row = MarkerInRow(world.Observe(camera, frame), marker);
        reversed = row_truth.reversed;
        if (row_truth.is_outlier[in_row]) {
          ++(marker.used ? counts.outlier_kept : counts.outlier_removed);
          continue;
        }
        const bool is_end = 2 * in_row + 1 != row_truth.is_outlier.size();
        const bool turned = in_row != static_cast<size_t>(marker.marker);
        fate.any_end |= is_end;
        fate.turned |= turned && marker.used;
        fate.kept_wrong |= is_end && !turned && marker.used;
        if (!reversed) ++(marker.used ? counts.good_kept : counts.good_removed);
      }
      if (!fate.any_end) continue;
      if (!reversed) {
        counts.straight_turned += fate.turned ? 1 : 0;
      } else if (fate.kept_wrong) {
        ++counts.reversed_kept;
      } else {
        ++(fate.turned ? counts.reversed_turned : counts.reversed_removed);
      }
    }
  }
  return counts;
}

}  // namespace rigcal::accuracy
