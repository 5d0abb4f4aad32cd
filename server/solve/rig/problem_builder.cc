// SPDX-License-Identifier: Apache-2.0
#include "server/solve/rig/problem_builder.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <tuple>

#include "common/camera/intrinsics_vector.h"

namespace rigcal::server {
namespace {

void AddMember(const AlignedTrack& track, const ImageMotion& motion,
               const ClockCorrection& correction, const Instant& instant,
               const InstantMember& member, int first_marker, double sigma_px,
               MotionWeightsMemory* memory, BuiltProblem* built) {
  const ObservationTable& rows = track.track.observations;
  const auto row = static_cast<size_t>(member.observation);
  const size_t count = rows.MarkerCount(row);
  for (size_t m = 0; m < count; ++m) {
    if (!rows.IsVisible(row, m)) continue;
    const int64_t camera_time_ns = motion.TimeNs(row, m);
    const int64_t coarse_ns = track.CoarseRigTimeNs(camera_time_ns);
    const double shift_s =
        1e-9 * static_cast<double>(instant.rig_time_ns - coarse_ns) - correction.At(camera_time_ns);
    const size_t label = motion.IsFlipped(member.observation) ? count - 1 - m : m;
    MarkerMotion moved = motion.At(member.observation, static_cast<int>(label), shift_s, memory);
    if (sigma_px > 0) moved.covariance_px2 = sigma_px * sigma_px * Eigen::Matrix2d::Identity();
    BundleMarker marker;
    marker.marker = first_marker + static_cast<int>(label);
    marker.centre_px = moved.centre_px;
    marker.velocity_px_s = moved.velocity_px_s;
    marker.sqrt_information = SqrtInformation(moved.covariance_px2);
    built->problem.markers.push_back(marker);
    built->sources.push_back({member.track, member.observation, moved.noise_share});
  }
}

// As much memory as the problem needs.
void Reserve(const std::vector<AlignedTrack>& tracks, const std::vector<Instant>& instants,
             BuiltProblem* built) {
  size_t observation_count = 0, marker_count = 0;
  for (const Instant& instant : instants) {
    observation_count += instant.members.size();
    for (const InstantMember& member : instant.members) {
      marker_count += static_cast<size_t>(
          tracks[static_cast<size_t>(member.track)].track.observations.VisibleCount(
              static_cast<size_t>(member.observation)));
    }
  }
  built->problem.instants.reserve(instants.size());
  built->instant_time_ns.reserve(instants.size());
  built->problem.observations.reserve(observation_count);
  built->problem.markers.reserve(marker_count);
  built->sources.reserve(marker_count);
}

}  // namespace

Eigen::Matrix2d SqrtInformation(const Eigen::Matrix2d& covariance) {
  const Eigen::Matrix2d information = covariance.inverse();
  return information.llt().matrixU();
}

std::map<std::string, std::vector<size_t>> ClocksBySession(
    const std::vector<ClockCorrection>& clocks) {
  std::map<std::string, std::vector<size_t>> sessions;
  for (size_t k = 0; k < clocks.size(); ++k) sessions[clocks[k].session_id].push_back(k);
  return sessions;
}

RigIndex IndexRig(const std::vector<AlignedTrack>& tracks, std::vector<ClockCorrection>* clocks) {
  RigIndex index;
  std::map<std::string, int> camera_index;
  for (const AlignedTrack& track : tracks) camera_index[track.track.camera.camera] = 0;
  int next = 0;
  for (auto& [name, position] : camera_index) position = next++;
  index.cameras.resize(camera_index.size());
  std::map<std::tuple<std::string, std::string, uint32_t>, int> clock_index;
  for (const AlignedTrack& track : tracks) {
    const CleanTrack& clean = track.track;
    const int camera = camera_index[clean.camera.camera];
    // A session of static points says nothing of the camera's clock.
    CameraDescription& description = index.cameras[static_cast<size_t>(camera)];
    if (!track.is_static || description.camera.empty()) description = clean.camera;
    index.camera_of_track.push_back(camera);
    const std::string clock_id = track.is_static ? "" : clean.camera.clock.clock_id;
    const auto [entry, inserted] = clock_index.try_emplace(
        {clean.session_id, clock_id, clean.clock_epoch}, static_cast<int>(clocks->size()));
    const int64_t first_ns = clean.observations.time_ns(0);
    if (inserted) {
      clocks->push_back({clean.session_id, clock_id, clean.clock_epoch, first_ns, 0, 0});
    }
    ClockCorrection& clock = (*clocks)[static_cast<size_t>(entry->second)];
    clock.time_epoch_ns = std::min(clock.time_epoch_ns, first_ns);
    index.clock_of_track.push_back(entry->second);
  }
  return index;
}

std::vector<std::vector<int64_t>> RigTimes(const std::vector<AlignedTrack>& tracks,
                                           const RigIndex& index,
                                           const std::vector<ClockCorrection>& clocks,
                                           const std::vector<ImageMotion>* motions) {
  std::vector<std::vector<int64_t>> times = CoarseRigTimes(tracks);
  for (size_t t = 0; t < tracks.size(); ++t) {
    const ClockCorrection& clock = clocks[static_cast<size_t>(index.clock_of_track[t])];
    for (size_t i = 0; i < times[t].size(); ++i) {
      times[t][i] += std::llround(1e9 * clock.At(tracks[t].track.observations.time_ns(i)));
      if (motions != nullptr) times[t][i] += (*motions)[t].MeanDelayNs(i);
    }
  }
  return times;
}

BuiltProblem BuildProblem(const TargetParts& targets, const std::vector<AlignedTrack>& tracks,
                          const std::vector<ImageMotion>& motions, const RigIndex& index,
                          const std::vector<ClockCorrection>& clocks,
                          const std::vector<Instant>& instants, double sigma_px) {
  BuiltProblem built;
  BundleProblem& problem = built.problem;
  for (const CameraDescription& description : index.cameras) {
    BundleCamera camera;
    camera.name = description.camera;
    camera.model = description.intrinsics->model;
    camera.intrinsics = ToVector(*description.intrinsics);
    camera.middle_row = MiddleRow(description);
    problem.cameras.push_back(std::move(camera));
  }
  for (const ClockCorrection& correction : clocks) {
    BundleClock clock;
    clock.clock_id = correction.clock_id;
    problem.clocks.push_back(std::move(clock));
  }
  for (const Target& line : targets.lines()) {
    std::vector<double>& positions_m = problem.target.marker_positions_m;
    const auto first = static_cast<int>(positions_m.size());
    positions_m.insert(positions_m.end(), line.marker_positions_m.begin(),
                       line.marker_positions_m.end());
    if (first == 0) problem.target.span_sigma_m = line.span_tolerance_m;
    if (targets.lines().size() == 1) continue;
    problem.target.wands.push_back(
        {first, static_cast<int>(positions_m.size()), line.span_tolerance_m});
  }
  problem.target.given_positions_m = problem.target.marker_positions_m;
  problem.rigid_target.first_points = targets.first_points();
  for (const TargetPoint& point : targets.points()) {
    problem.rigid_target.points_m.emplace_back(point.x_m, point.y_m, point.z_m);
    problem.rigid_target.sigma_m.push_back(point.sigma_m);
  }
  problem.rigid_target.given_points_m = problem.rigid_target.points_m;
  Reserve(tracks, instants, &built);
  std::vector<MotionWeightsMemory> memories(tracks.size());
  for (const Instant& instant : instants) {
    BundleInstant entry;
    // An instant is of one session.
    const TargetParts::Part& part =
        targets.Of(tracks[static_cast<size_t>(instant.members.front().track)].track.session_id);
    entry.is_rigid = part.is_rigid;
    entry.is_point = part.is_point;
    entry.first_observation = static_cast<int>(problem.observations.size());
    entry.observation_count = static_cast<int>(instant.members.size());
    for (const InstantMember& member : instant.members) {
      const auto t = static_cast<size_t>(member.track);
      const ClockCorrection& clock = clocks[static_cast<size_t>(index.clock_of_track[t])];
      const int64_t row_ns =
          tracks[t].track.observations.time_ns(static_cast<size_t>(member.observation));
      BundleObservation observation;
      observation.camera = index.camera_of_track[t];
      observation.clock = index.clock_of_track[t];
      observation.clock_time_s = 1e-9 * static_cast<double>(row_ns - clock.time_epoch_ns);
      observation.first_marker = static_cast<int>(problem.markers.size());
      AddMember(tracks[t], motions[t], clock, instant, member, part.first_marker, sigma_px,
                &memories[t], &built);
      observation.marker_count =
          static_cast<int>(problem.markers.size()) - observation.first_marker;
      problem.observations.push_back(observation);
    }
    problem.instants.push_back(entry);
    built.instant_time_ns.push_back(instant.rig_time_ns);
  }
  return built;
}

}  // namespace rigcal::server
