// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/solver/until_mm_experiment.h"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <limits>
#include <utility>

#include "common/simulation/world/random_stream.h"
#include "common/simulation/world/simulated_rig.h"
#include "common/simulation/world/simulated_world.h"
#include "common/status/status_macros.h"
#include "server/solve/running/running_estimate.h"
#include "tests/accuracy/solver/rig_comparison.h"
#include "tests/accuracy/solver/waving_person.h"

namespace rigcal::accuracy {
namespace {

constexpr uint64_t kUntilPurpose = 0x756e74696c;
constexpr double kStepS = 2;

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
  RandomStream random{seed, kUntilPurpose, 1};
  for (int c = 0; c < options.camera_count; ++c) {
    simulation.time_offset_s[c] = random.Uniform(-0.002, 0.002);
  }
  simulation.time_offset_s[1] = -0.008;
  return simulation;
}

double CpuSeconds() {
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

// Running estimates of the same session, one after the other.
class Estimates {
 public:
  explicit Estimates(bool advise) : advise_(advise) {}

  std::optional<server::RunningEstimate> Next(const Target& target,
                                              std::vector<server::CameraTrack> tracks,
                                              UntilStep* step) {
    const size_t camera_count = tracks.size();
    server::RunningInput input;
    input.target = target;
    input.tracks = std::move(tracks);
    input.start = start_;
    input.advise = advise_;
    const double begin_s = CpuSeconds();
    server::RunningOutcome outcome = server::EstimateNow(std::move(input));
    step->solve_s = CpuSeconds() - begin_s;
    if (!outcome.estimate) return std::nullopt;
    start_ = outcome.estimate->next;
    if (outcome.estimate->cameras.size() == camera_count) {
      step->predicted_mm = 1e3 * outcome.estimate->error.p95_m;
      step->agrees = outcome.estimate->held_out && outcome.estimate->held_out->agrees;
    }
    return std::move(outcome.estimate);
  }

 private:
  const bool advise_;
  server::EstimateStart start_;
};

// Of everything that has been recorded, which the estimate stands for.
double TrueErrorMm(const ComparedRig& truth, const Target& target,
                   const std::vector<server::CameraTrack>& tracks,
                   const server::RunningEstimate& estimate) {
  server::RunningInput input;
  input.target = target;
  input.tracks = tracks;
  input.start = estimate.next;
  input.max_views = 1'000'000;
  input.advise = input.check_held_out = false;
  const server::RunningOutcome outcome = server::EstimateNow(std::move(input));
  if (!outcome.estimate) return std::numeric_limits<double>::infinity();
  return 1e3 * TriangulationErrorM(truth, RigOf(*outcome.estimate), PointsOf(estimate, truth));
}

double CalibratedMm(const ComparedRig& truth, const Target& target,
                    std::vector<server::CameraTrack> tracks,
                    const std::vector<Eigen::Vector3d>& points_m) {
  server::CalibrationInput input;
  input.target = target;
  input.tracks = std::move(tracks);
  const server::CalibrationOutcome outcome = server::Calibrate(std::move(input), {});
  if (!outcome.result.ok()) return std::numeric_limits<double>::infinity();
  return 1e3 * TriangulationErrorM(truth, RigOf(*outcome.result), points_m);
}

std::vector<WandPose> AdvisedPlaces(const server::RunningEstimate& estimate,
                                    const ComparedRig& truth) {
  const Eigen::Isometry3d truth_from_estimate = Align(RigOf(estimate), truth);
  std::vector<WandPose> places;
  for (const server::WaveAdvice& advice : estimate.advice) {
    places.push_back(
        {truth_from_estimate * advice.point_m, truth_from_estimate.linear() * advice.direction});
  }
  return places;
}

absl::Status Wave(const UntilOptions& options, uint32_t seed, UntilTrial* trial) {
  Target target;
  target.marker_positions_m = {0, 0.13, 0.39};
  RIGCAL_ASSIGN_OR_RETURN(const SimulatedWorld world,
                          SimulatedWorld::Create(DrawWorld(options, seed), target));
  const ComparedRig truth = RigOf(world);
  WavingPerson person(MakeWaveVolume(world.options()), seed);
  std::vector<server::CameraTrack> tracks;
  std::vector<int> views(world.cameras().size(), 0);
  for (const SimulatedCamera& camera : world.cameras()) {
    tracks.emplace_back();
    tracks.back().session_id = "s";
    tracks.back().camera = camera.description;
  }
  Estimates estimates(options.guided);
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
    UntilStep step;
    step.time_s = time_s;
    step.poorest_views = *std::ranges::min_element(views);
    const auto estimate = estimates.Next(target, tracks, &step);
    if (step.predicted_mm > 0) step.true_mm = TrueErrorMm(truth, target, tracks, *estimate);
    if (estimate && options.guided) person.GoTo(AdvisedPlaces(*estimate, truth));
    const bool stopped_before = trial->StopAt(options.until_mm) >= 0;
    trial->steps.push_back(step);
    const bool stopped = trial->StopAt(options.until_mm) >= 0;
    if (stopped && !stopped_before) {
      trial->calibrated_mm = CalibratedMm(truth, target, tracks, PointsOf(*estimate, truth));
    }
    if (stopped && step.poorest_views >= options.end_views) break;
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

absl::StatusOr<UntilTrial> ReplayRecording(const server::CalibrationInput& recording,
                                           double lowest_target_mm) {
  const server::CalibrationOutcome whole = server::Calibrate(recording, {});
  RIGCAL_RETURN_IF_ERROR(whole.result.status());
  const ComparedRig truth = RigOf(*whole.result);
  int64_t begin_ns = std::numeric_limits<int64_t>::max(), end_ns = 0;
  for (const server::CameraTrack& track : recording.tracks) {
    for (const Observation& row : track.observations) {
      begin_ns = std::min(begin_ns, row.time_ns);
      end_ns = std::max(end_ns, row.time_ns);
    }
  }
  UntilTrial trial;
  Estimates estimates(false);
  const double duration_s = 1e-9 * static_cast<double>(end_ns - begin_ns);
  for (double time_s = kStepS; time_s < duration_s + kStepS; time_s += kStepS) {
    std::vector<server::CameraTrack> tracks;
    UntilStep step;
    step.time_s = time_s;
    step.poorest_views = std::numeric_limits<int>::max();
    for (const server::CameraTrack& track : recording.tracks) {
      server::CameraTrack so_far = track;
      std::erase_if(so_far.observations, [&](const Observation& row) {
        return 1e-9 * static_cast<double>(row.time_ns - begin_ns) >= time_s;
      });
      const auto views = std::ranges::count_if(
          so_far.observations, [](const Observation& row) { return row.VisibleCount() > 0; });
      step.poorest_views = std::min(step.poorest_views, static_cast<int>(views));
      tracks.push_back(std::move(so_far));
    }
    const auto estimate = estimates.Next(recording.target, tracks, &step);
    if (step.predicted_mm > 0) {
      step.true_mm = TrueErrorMm(truth, recording.target, tracks, *estimate);
    }
    trial.steps.push_back(step);
    if (trial.StopAt(lowest_target_mm) >= 0) break;
  }
  return trial;
}

}  // namespace rigcal::accuracy
