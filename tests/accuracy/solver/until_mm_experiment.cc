// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/solver/until_mm_experiment.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <ctime>
#include <optional>
#include <utility>

#include "common/camera/camera_model.h"
#include "common/simulation/world/random_stream.h"
#include "common/simulation/world/simulated_rig.h"
#include "common/simulation/world/simulated_world.h"
#include "common/statistics/robust_statistics.h"
#include "common/status/status_macros.h"
#include "server/solve/geometry/triangulation.h"
#include "server/solve/running/running_estimate.h"

namespace rigcal::accuracy {
namespace {

constexpr uint64_t kPersonPurpose = 0x706572736f6e;
constexpr double kStepS = 2;
constexpr double kSpeedMS = 1.0;

SimulationOptions DrawWorld(const UntilOptions& options, uint32_t seed) {
  SimulationOptions simulation;
  simulation.seed = seed;
  simulation.camera_count = options.camera_count;
  simulation.duration_s = options.duration_s;
  simulation.rate_hz = 50;
  simulation.focal_sigma_rel = 0.002 * options.lens_error;
  simulation.centre_sigma_px = 2 * options.lens_error;
  simulation.radial_sigma = 0.004 * options.lens_error;
  simulation.radial_high_sigma = 0.008 * options.lens_error;
  simulation.tangential_sigma = 0.0002 * options.lens_error;
  RandomStream random{seed, kPersonPurpose, 1};
  for (int c = 0; c < options.camera_count; ++c) {
    simulation.time_offset_s[c] = random.Uniform(-0.002, 0.002);
  }
  simulation.time_offset_s[1] = -0.008;
  return simulation;
}

// Goes from one place to the next, turning the wand on the way, and stops for nothing.
class Person {
 public:
  Person(const WaveVolume& volume, uint32_t seed)
      : volume_(volume), random_{seed, kPersonPurpose, 2}, to_(volume.centre_m) {}

  // Where to go from now on; none: anywhere.
  void GoTo(std::vector<WandPose> places) { places_ = std::move(places); }

  // Ascending times only. The middle of the wand is the pose's origin here.
  WandPose At(double time_s) {
    while (time_s >= end_s_) Next();
    const double share = std::clamp((time_s - begin_s_) / (end_s_ - begin_s_), 0.0, 1.0);
    const double smooth = share * share * (3 - 2 * share);
    return {from_ + smooth * (to_ - from_),
            (from_direction_ + smooth * (to_direction_ - from_direction_)).normalized()};
  }

 private:
  void Next() {
    from_ = to_;
    from_direction_ = to_direction_;
    begin_s_ = end_s_;
    Eigen::Vector3d spread;
    for (int i = 0; i < 3; ++i) spread[i] = random_.Gaussian();
    Eigen::Vector3d turn;
    for (int i = 0; i < 3; ++i) turn[i] = random_.Gaussian();
    if (places_.empty()) {
      to_ = volume_.centre_m + 0.5 * volume_.half_extent_m.cwiseProduct(spread);
      to_direction_ = turn.normalized();
    } else {
      // Around one of them.
      const WandPose& place = places_[random_.Bits() % places_.size()];
      to_ = place.origin_m + 0.15 * spread;
      to_direction_ = (place.direction + 0.4 * turn).normalized();
    }
    // A person stays within the volume.
    to_ = to_.cwiseMin(volume_.centre_m + volume_.half_extent_m)
              .cwiseMax(volume_.centre_m - volume_.half_extent_m);
    if (to_direction_.dot(from_direction_) < 0) to_direction_ = -to_direction_;
    end_s_ = begin_s_ + std::max(0.25, 1.5 * (to_ - from_).norm() / kSpeedMS);
  }

  const WaveVolume volume_;
  RandomStream random_;
  std::vector<WandPose> places_;
  Eigen::Vector3d from_ = Eigen::Vector3d::Zero(), to_;
  Eigen::Vector3d from_direction_ = Eigen::Vector3d::UnitX();
  Eigen::Vector3d to_direction_ = Eigen::Vector3d::UnitX();
  double begin_s_ = 0, end_s_ = 0;
};

// true_from_estimated, by the cameras' centres.
Eigen::Affine3d Alignment(const SimulatedWorld& world, const server::RunningEstimate& estimate) {
  const auto count = static_cast<Eigen::Index>(estimate.cameras.size());
  Eigen::Matrix3Xd from(3, count), to(3, count);
  for (Eigen::Index c = 0; c < count; ++c) {
    const server::EstimatedCamera& camera = estimate.cameras[static_cast<size_t>(c)];
    from.col(c) = camera.cam_from_rig.SourceFromTargetTranslation();
    for (const SimulatedCamera& other : world.cameras()) {
      if (other.description.camera != camera.name) continue;
      to.col(c) = other.cam_from_rig.SourceFromTargetTranslation();
    }
  }
  return Eigen::Affine3d(Eigen::umeyama(from, to, false));
}

// So large are the errors of triangulated points in 95 % of the grid, metres, after the best rigid
// alignment and at the wand's true length.
double TrueErrorM(const SimulatedWorld& world, const server::RunningEstimate& estimate) {
  const Eigen::Affine3d true_from_estimated = Alignment(world, estimate);
  const double stretch =
      world.true_target().marker_positions_m.back() / estimate.marker_positions_m.back();
  std::vector<Eigen::Vector3d> found, truth;
  for (const size_t index : estimate.error.points) {
    const Eigen::Vector3d point = true_from_estimated * estimate.grid.Point(index);
    std::vector<server::CameraRay> views;
    for (const SimulatedCamera& camera : world.cameras()) {
      Eigen::Vector2d pixel;
      if (!ImageOf(camera.true_intrinsics, camera.cam_from_rig * point, &pixel)) continue;
      const ImageSize& size = camera.description.image_size_px;
      if (!(pixel.x() >= 0) || !(pixel.y() >= 0) || !(pixel.x() < size.width) ||
          !(pixel.y() < size.height)) {
        continue;
      }
      for (const server::EstimateStart::Camera& solved : estimate.next.cameras) {
        if (solved.name != camera.description.camera) continue;
        const auto ray = Undistort(solved.intrinsics, pixel);
        if (ray.ok()) views.push_back({solved.cam_from_rig, *ray});
      }
    }
    const auto point_found = server::Triangulate(views);
    if (!point_found) continue;
    found.push_back(stretch * *point_found);
    truth.push_back(point);
  }
  if (found.size() < 4) return INFINITY;
  const auto count = static_cast<Eigen::Index>(found.size());
  Eigen::Matrix3Xd from(3, count), to(3, count);
  for (Eigen::Index i = 0; i < count; ++i) {
    from.col(i) = found[static_cast<size_t>(i)];
    to.col(i) = truth[static_cast<size_t>(i)];
  }
  const Eigen::Affine3d fit(Eigen::umeyama(from, to, false));
  std::vector<double> errors;
  for (Eigen::Index i = 0; i < count; ++i) errors.push_back((fit * from.col(i) - to.col(i)).norm());
  return UpperQuantile(&errors, 0.95);
}

// Of a calibration of everything that has been recorded, which the estimate stands for.
double TrueErrorOfAllMm(const SimulatedWorld& world, const std::vector<server::CameraTrack>& tracks,
                        const server::RunningEstimate& estimate) {
  server::RunningInput input;
  input.target = world.target();
  input.tracks = tracks;
  input.start = estimate.next;
  input.max_instants = 1'000'000;
  input.advise = input.check_held_out = false;
  const server::RunningOutcome outcome = server::EstimateNow(std::move(input));
  return outcome.estimate ? 1e3 * TrueErrorM(world, *outcome.estimate) : INFINITY;
}

double CpuSeconds() {
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

absl::Status Wave(const UntilOptions& options, uint32_t seed, UntilTrial* trial) {
  Target target;
  target.marker_positions_m = {0, 0.13, 0.39};
  RIGCAL_ASSIGN_OR_RETURN(const SimulatedWorld world,
                          SimulatedWorld::Create(DrawWorld(options, seed), target));
  Person person(MakeWaveVolume(world.options()), seed);
  std::vector<server::CameraTrack> tracks;
  std::vector<int> views(world.cameras().size(), 0);
  for (const SimulatedCamera& camera : world.cameras()) {
    tracks.emplace_back();
    tracks.back().session_id = "s";
    tracks.back().camera = camera.description;
  }
  server::EstimateStart start;
  int frame = 0;
  for (double time_s = kStepS; time_s <= options.duration_s; time_s += kStepS) {
    // All cameras are exposed together.
    for (; frame < world.FrameCount(0) && world.FrameRigTime(0, frame) < time_s; ++frame) {
      WandPose pose = person.At(world.FrameRigTime(0, frame));
      pose.origin_m -= 0.5 * world.true_target().marker_positions_m.back() * pose.direction;
      for (size_t c = 0; c < tracks.size(); ++c) {
        tracks[c].observations.push_back(world.ObserveWand(static_cast<int>(c), frame, pose));
        views[c] += tracks[c].observations.back().VisibleCount() > 0 ? 1 : 0;
      }
    }
    server::RunningInput input;
    input.target = target;
    input.tracks = tracks;
    input.start = start;
    input.advise = options.guided;
    const double begin_s = CpuSeconds();
    const server::RunningOutcome outcome = server::EstimateNow(std::move(input));
    UntilStep step;
    step.time_s = time_s;
    step.solve_s = CpuSeconds() - begin_s;
    step.poorest_views = *std::ranges::min_element(views);
    if (outcome.estimate) {
      start = outcome.estimate->next;
      if (outcome.estimate->cameras.size() == tracks.size()) {
        step.predicted_mm = 1e3 * outcome.estimate->error.p95_m;
        step.true_mm = TrueErrorOfAllMm(world, tracks, *outcome.estimate);
        step.agrees = outcome.estimate->held_out && outcome.estimate->held_out->agrees;
      }
      std::vector<WandPose> places;
      const Eigen::Affine3d alignment = Alignment(world, *outcome.estimate);
      for (const server::WaveAdvice& advice : outcome.estimate->advice) {
        places.push_back({alignment * advice.point_m, alignment.linear() * advice.direction});
      }
      if (options.guided) person.GoTo(std::move(places));
    }
    trial->steps.push_back(step);
    if (options.stop && trial->StopAt(options.until_mm) >= 0) break;
  }
  return absl::OkStatus();
}

}  // namespace

int UntilTrial::StopAt(double until_mm) const {
  for (size_t i = 0; i < steps.size(); ++i) {
    if (steps[i].predicted_mm > 0 && steps[i].predicted_mm < until_mm && steps[i].agrees) {
      return static_cast<int>(i);
    }
  }
  return -1;
}

int UntilTrial::StepWithViews(int views) const {
  for (size_t i = 0; i < steps.size(); ++i) {
    if (steps[i].poorest_views >= views) return static_cast<int>(i);
  }
  return -1;
}

UntilTrial RunUntilTrial(const UntilOptions& options, uint32_t seed) {
  UntilTrial trial;
  trial.status = Wave(options, seed, &trial);
  return trial;
}

}  // namespace rigcal::accuracy
