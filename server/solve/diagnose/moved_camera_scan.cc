// SPDX-License-Identifier: Apache-2.0
#include "server/solve/diagnose/moved_camera_scan.h"

#include <Eigen/Cholesky>
#include <algorithm>

#include "common/camera/camera_model.h"
#include "server/solve/bundle/marker_residual_px.h"

namespace rigcal::server {
namespace {

constexpr double kCapPx = 60;
constexpr size_t kMaxMarkers = 1500;
constexpr size_t kMinMarkersOfPart = 60;
constexpr int kCoarseSteps = 20;
constexpr int kFineSteps = 8;
constexpr int kReweightings = 6;

struct Sample {
  int64_t time_ns;
  Eigen::Vector2d residual;  // predicted minus measured
  Eigen::Matrix<double, 2, 6> jacobian;
};

std::vector<Sample> SamplesOf(const TrialProblem& trial, int camera) {
  const BundleProblem& problem = trial.problem;
  const BundleCamera& solved = problem.cameras[static_cast<size_t>(camera)];
  std::vector<Sample> samples;
  ForEachMarker(problem, [&](size_t i, const BundleObservation& observation, size_t m) {
    if (observation.camera != camera) return;
    const BundleInstant& instant = problem.instants[i];
    const BundleMarker& marker = problem.markers[m];
    const auto residual = MarkerResidualPx(problem, instant, observation, marker);
    const Eigen::Vector3d rotated = solved.cam_from_rig.rotation * problem.PointOf(instant, marker);
    Eigen::Vector2d pixel;
    Eigen::Matrix<double, 2, 3> d_point;
    if (!residual ||
        !Project(solved.model, solved.intrinsics.data(),
                 rotated + solved.cam_from_rig.translation_m, &pixel, &d_point, nullptr)) {
      return;
    }
    Sample sample = {trial.instant_time_ns[i], *residual, {}};
    Eigen::Matrix3d cross;
    cross << 0, -rotated.z(), rotated.y(), rotated.z(), 0, -rotated.x(), -rotated.y(), rotated.x(),
        0;
    sample.jacobian.leftCols<3>() = -d_point * cross;
    sample.jacobian.rightCols<3>() = d_point;
    samples.push_back(sample);
  });
  std::ranges::stable_sort(samples, {}, &Sample::time_ns);
  const size_t stride = 1 + samples.size() / kMaxMarkers;
  std::vector<Sample> some;
  for (size_t i = 0; i < samples.size(); i += stride) some.push_back(samples[i]);
  return some;
}

struct Fit {
  PoseStep step = PoseStep::Zero();
  double cost = 0;
};

double CostOf(const std::vector<Sample>& samples, size_t begin, size_t end, const PoseStep& step) {
  double cost = 0;
  for (size_t i = begin; i < end; ++i) {
    cost += std::min(kCapPx, (samples[i].residual + samples[i].jacobian * step).norm());
  }
  return cost;
}

// Least absolute errors by iterative reweighting.
Fit FitStep(const std::vector<Sample>& samples, size_t begin, size_t end) {
  Fit fit;
  fit.cost = CostOf(samples, begin, end, fit.step);
  PoseStep step = PoseStep::Zero();
  for (int round = 0; round < kReweightings; ++round) {
    Eigen::Matrix<double, 6, 6> information = 1e-6 * Eigen::Matrix<double, 6, 6>::Identity();
    PoseStep gradient = PoseStep::Zero();
    for (size_t i = begin; i < end; ++i) {
      const Sample& sample = samples[i];
      const double norm = (sample.residual + sample.jacobian * step).norm();
      // Beyond the cap a residual says nothing about the pose.
      const double weight = (norm > 4 * kCapPx ? 0.01 : 1) / std::max(norm, 0.1);
      information += weight * sample.jacobian.transpose() * sample.jacobian;
      gradient += weight * sample.jacobian.transpose() * sample.residual;
    }
    step = -information.ldlt().solve(gradient);
    if (!step.allFinite()) break;
    const double cost = CostOf(samples, begin, end, step);
    if (cost < fit.cost) fit = {step, cost};
  }
  return fit;
}

}  // namespace

std::optional<ChangePoint> ScanForMove(const TrialProblem& trial, int camera) {
  const std::vector<Sample> samples = SamplesOf(trial, camera);
  const size_t count = samples.size();
  if (count < 4 * kMinMarkersOfPart) return std::nullopt;
  const double cost_of_one = FitStep(samples, 0, count).cost;
  if (!(cost_of_one > 0)) return std::nullopt;
  std::optional<ChangePoint> best;
  size_t best_split = 0;
  const auto look = [&](size_t split) {
    while (split < count && split > 0 && samples[split].time_ns == samples[split - 1].time_ns) {
      ++split;
    }
    if (split < kMinMarkersOfPart || split + kMinMarkersOfPart > count) return;
    const Fit before = FitStep(samples, 0, split), after = FitStep(samples, split, count);
    const double gain = 1 - (before.cost + after.cost) / cost_of_one;
    if (best && gain <= best->gain) return;
    best = ChangePoint{samples[split].time_ns, before.step, after.step, gain};
    best_split = split;
  };
  const size_t stride = std::max<size_t>(1, count / kCoarseSteps);
  for (size_t split = stride; split < count; split += stride) look(split);
  // Halving towards the best.
  for (size_t fine = stride / 2, step = 0; best && fine > 0 && step < kFineSteps;
       fine /= 2, ++step) {
    const size_t around = best_split;
    if (around > fine) look(around - fine);
    look(around + fine);
  }
  return best;
}

}  // namespace rigcal::server
