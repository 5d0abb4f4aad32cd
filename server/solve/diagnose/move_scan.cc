// SPDX-License-Identifier: Apache-2.0
#include "server/solve/diagnose/move_scan.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <numeric>
#include <vector>

#include "common/camera/camera_model.h"
#include "common/statistics/robust_statistics.h"
#include "server/solve/bundle/marker_residual_px.h"
#include "server/solve/evaluate/held_out_choice.h"

namespace rigcal::server {
namespace {

constexpr size_t kMaxMarkers = 1500;
constexpr size_t kMinMarkersOfPart = 60;
constexpr int kCoarseSteps = 20;
constexpr int kFineSteps = 8;
constexpr int kReweightings = 6;
constexpr int kBlocksOfPart = 6;
constexpr size_t kMinMarkersOfBlock = 5;
// Of what one change leaves, a span of time must leave no more.
constexpr double kSpanWorth = 0.8;
constexpr int kSpanRounds = 4;
constexpr double kSeedCap = 8;  // times the median error
constexpr double kHeldOutSigmas = 2;

struct Fit {
  PoseStep step = PoseStep::Zero();
  double cost = 0;
};

double CostOf(const std::vector<MoveSample>& samples, size_t begin, size_t end,
              const PoseStep& step) {
  double cost = 0;
  for (size_t i = begin; i < end; ++i) {
    cost += std::min(kMoveCapPx, (samples[i].residual + samples[i].jacobian * step).norm());
  }
  return cost;
}

// Least absolute errors by iterative reweighting.
Fit FitStep(const std::vector<MoveSample>& samples, size_t begin, size_t end) {
  Fit fit;
  fit.cost = CostOf(samples, begin, end, fit.step);
  PoseStep step = PoseStep::Zero();
  for (int round = 0; round < kReweightings; ++round) {
    Eigen::Matrix<double, 6, 6> information = 1e-6 * Eigen::Matrix<double, 6, 6>::Identity();
    PoseStep gradient = PoseStep::Zero();
    for (size_t i = begin; i < end; ++i) {
      const MoveSample& sample = samples[i];
      const double norm = (sample.residual + sample.jacobian * step).norm();
      // Beyond the cap a residual says nothing about the pose.
      const double weight = (norm > 4 * kMoveCapPx ? 0.01 : 1) / std::max(norm, 0.1);
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

// The samples in which the sum of `gains` is largest.
std::pair<size_t, size_t> BestSpan(const std::vector<double>& gains) {
  std::pair<size_t, size_t> best = {0, 0};
  double best_sum = 0, sum = 0;
  for (size_t begin = 0, i = 0; i < gains.size(); ++i) {
    sum += gains[i];
    if (sum <= 0) {
      sum = 0;
      begin = i + 1;
    } else if (sum > best_sum) {
      best_sum = sum;
      best = {begin, i + 1};
    }
  }
  return best;
}

double CappedPx(const MoveSample& sample, const PoseStep& step) {
  return std::min(kMoveCapPx, (sample.residual + sample.jacobian * step).norm());
}

// False detections that no pose explains would hide how much a change explains of the rest.
bool IsLost(const MoveSample& sample, const PoseStep& one, const ChangePoint& change) {
  const PoseStep& own = change.HasMoved(sample.time_ns) ? change.after : change.before;
  return CappedPx(sample, one) >= kMoveCapPx && CappedPx(sample, own) >= kMoveCapPx;
}

double GainBesideLost(const std::vector<MoveSample>& samples, const PoseStep& one,
                      const ChangePoint& change) {
  double before = 0, after = 0;
  for (const MoveSample& sample : samples) {
    if (IsLost(sample, one, change)) continue;
    before += CappedPx(sample, one);
    after += CappedPx(sample, change.HasMoved(sample.time_ns) ? change.after : change.before);
  }
  return before > 0 ? 1 - after / before : 0;
}

// The span of time in which another pose explains most, found in turns with the two poses: from the
// samples that one pose fits worst (`first_sign` 1), or best (-1, where it was elsewhere most of
// the time).
std::optional<ChangePoint> ScanForSpan(const std::vector<MoveSample>& samples, const Fit& one,
                                       double first_sign) {
  const size_t count = samples.size();
  // Where one pose fits worse than usual; false detections count little.
  std::vector<double> gains(count);
  for (size_t i = 0; i < count; ++i) gains[i] = CappedPx(samples[i], one.step);
  const double most_px = kSeedCap * UpperMedian(gains);
  for (double& gain : gains) gain = std::min(gain, most_px);
  const double mean_px =
      std::accumulate(gains.begin(), gains.end(), 0.0) / static_cast<double>(count);
  for (double& gain : gains) gain = first_sign * (gain - mean_px);
  std::optional<ChangePoint> best;
  for (int round = 0; round < kSpanRounds; ++round) {
    auto [begin, end] = BestSpan(gains);
    const auto is_same_time = [&samples](size_t i) {
      return i > 0 && i < samples.size() && samples[i].time_ns == samples[i - 1].time_ns;
    };
    while (is_same_time(begin)) --begin;
    while (is_same_time(end)) ++end;
    // At either end of the recording it is one change.
    if (begin < kMinMarkersOfPart || end + kMinMarkersOfPart > count ||
        begin + kMinMarkersOfPart > end) {
      return best;
    }
    const auto at = [&samples](size_t i) {
      return samples.begin() + static_cast<std::ptrdiff_t>(i);
    };
    std::vector<MoveSample> rest(samples.begin(), at(begin));
    rest.insert(rest.end(), at(end), samples.end());
    const Fit inside = FitStep(samples, begin, end), outside = FitStep(rest, 0, rest.size());
    const double gain = 1 - (inside.cost + outside.cost) / one.cost;
    if (best && gain <= best->gain) return best;
    best =
        ChangePoint{samples[begin].time_ns, samples[end].time_ns, outside.step, inside.step, gain};
    for (size_t i = 0; i < count; ++i) {
      gains[i] = CappedPx(samples[i], outside.step) - CappedPx(samples[i], inside.step);
    }
  }
  return best;
}

}  // namespace

std::vector<MoveSample> AllMoveSamplesOf(const TrialProblem& trial, const SessionTimeline& timeline,
                                         int camera) {
  const BundleProblem& problem = trial.problem;
  const BundleCamera& solved = problem.cameras[static_cast<size_t>(camera)];
  const Eigen::Vector2d principal_px(solved.intrinsics[2], solved.intrinsics[3]);
  std::vector<MoveSample> samples;
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
    MoveSample sample = {timeline.TimeNs(i), m, *residual, {}, pixel - principal_px};
    Eigen::Matrix3d cross;
    cross << 0, -rotated.z(), rotated.y(), rotated.z(), 0, -rotated.x(), -rotated.y(), rotated.x(),
        0;
    sample.jacobian.leftCols<3>() = -d_point * cross;
    sample.jacobian.rightCols<3>() = d_point;
    samples.push_back(sample);
  });
  std::ranges::stable_sort(samples, {}, &MoveSample::time_ns);
  return samples;
}

std::vector<MoveSample> MoveSamplesOf(const TrialProblem& trial, const SessionTimeline& timeline,
                                      int camera) {
  const std::vector<MoveSample> samples = AllMoveSamplesOf(trial, timeline, camera);
  const size_t stride = 1 + samples.size() / kMaxMarkers;
  std::vector<MoveSample> some;
  for (size_t i = 0; i < samples.size(); i += stride) some.push_back(samples[i]);
  return some;
}

std::optional<ChangePoint> ScanForMove(const TrialProblem& trial, const SessionTimeline& timeline,
                                       int camera) {
  const std::vector<MoveSample> samples = MoveSamplesOf(trial, timeline, camera);
  const size_t count = samples.size();
  if (count < 4 * kMinMarkersOfPart) return std::nullopt;
  const Fit one = FitStep(samples, 0, count);
  if (!(one.cost > 0)) return std::nullopt;
  std::optional<ChangePoint> best;
  size_t best_split = 0;
  const auto look = [&](size_t split) {
    while (split < count && split > 0 && samples[split].time_ns == samples[split - 1].time_ns) {
      ++split;
    }
    if (split < kMinMarkersOfPart || split + kMinMarkersOfPart > count) return;
    const Fit before = FitStep(samples, 0, split), after = FitStep(samples, split, count);
    const double gain = 1 - (before.cost + after.cost) / one.cost;
    if (best && gain <= best->gain) return;
    best = ChangePoint{.time_ns = samples[split].time_ns,
                       .before = before.step,
                       .after = after.step,
                       .gain = gain};
    best_split = split;
  };
  const size_t stride = std::max<size_t>(1, count / kCoarseSteps);
  for (size_t split = stride; split < count; split += stride) look(split);
  for (const int64_t begin_ns : timeline.BeginsNs()) {
    const auto first = std::ranges::lower_bound(samples, begin_ns, {}, &MoveSample::time_ns);
    look(static_cast<size_t>(first - samples.begin()));
  }
  // Halving towards the best.
  for (size_t fine = stride / 2, step = 0; best && fine > 0 && step < kFineSteps;
       fine /= 2, ++step) {
    const size_t around = best_split;
    if (around > fine) look(around - fine);
    look(around + fine);
  }
  if (best) best->time_ns = timeline.Snapped(best->time_ns);
  if (best) best->gain = GainBesideLost(samples, one.step, *best);
  for (const double first_sign : {1.0, -1.0}) {
    std::optional<ChangePoint> span = ScanForSpan(samples, one, first_sign);
    if (!span) continue;
    span->gain = GainBesideLost(samples, one.step, *span);
    const double left = best ? 1 - best->gain : 1;
    if (1 - span->gain < (best && best->IsBack() ? 1 : kSpanWorth) * left) best = span;
  }
  return best;
}

bool HoldsForOtherTimes(const TrialProblem& trial, const SessionTimeline& timeline, int camera,
                        const ChangePoint& change) {
  std::vector<MoveSample> samples = MoveSamplesOf(trial, timeline, camera);
  const PoseStep one_step = FitStep(samples, 0, samples.size()).step;
  std::erase_if(samples,
                [&](const MoveSample& sample) { return IsLost(sample, one_step, change); });
  if (samples.empty()) return false;
  // Where it is back the time away is left out of the time of the rest.
  const int64_t last_ns = samples.back().time_ns + 1;
  const int64_t until_ns = std::min(change.until_ns, last_ns);
  const int64_t begins_ns[] = {samples.front().time_ns, change.time_ns};
  const int64_t ends_ns[] = {change.time_ns + last_ns - until_ns, until_ns};
  const auto block_of = [&](const MoveSample& sample) {
    const int part = change.HasMoved(sample.time_ns) ? 1 : 0;
    const int64_t away_ns = sample.time_ns >= until_ns ? until_ns - change.time_ns : 0;
    const double share = static_cast<double>(sample.time_ns - away_ns - begins_ns[part]) /
                         static_cast<double>(ends_ns[part] - begins_ns[part]);
    return part * kBlocksOfPart +
           std::min(kBlocksOfPart - 1, static_cast<int>(share * kBlocksOfPart));
  };
  std::vector<double> one_px(2 * kBlocksOfPart), two_px(2 * kBlocksOfPart);
  for (const int held_out : {0, 1}) {
    std::vector<MoveSample> all, of_part[2];
    for (const MoveSample& sample : samples) {
      const int block = block_of(sample);
      if (block % 2 == held_out) continue;
      all.push_back(sample);
      of_part[block / kBlocksOfPart].push_back(sample);
    }
    const Fit one = FitStep(all, 0, all.size());
    for (const int part : {0, 1}) {
      const Fit two = FitStep(of_part[part], 0, of_part[part].size());
      for (int block = part * kBlocksOfPart; block < (part + 1) * kBlocksOfPart; ++block) {
        if (block % 2 != held_out) continue;
        std::vector<MoveSample> own;
        std::ranges::copy_if(samples, std::back_inserter(own),
                             [&](const MoveSample& sample) { return block_of(sample) == block; });
        const bool enough = own.size() >= kMinMarkersOfBlock;
        const double count = static_cast<double>(own.size());
        const auto b = static_cast<size_t>(block);
        one_px[b] = enough ? CostOf(own, 0, own.size(), one.step) / count : INFINITY;
        two_px[b] = enough ? CostOf(own, 0, own.size(), two.step) / count : INFINITY;
      }
    }
  }
  const HeldOutGain gain = CompareByBlock(one_px, two_px);
  return gain.IsClear(kMinScanGain, kHeldOutSigmas);
}

double LargestErrorPx(const TrialProblem& trial, const SessionTimeline& timeline, int camera,
                      const ChangePoint& change) {
  double sums[2] = {0, 0}, counts[2] = {0, 0};
  for (const MoveSample& sample : MoveSamplesOf(trial, timeline, camera)) {
    const size_t part = change.HasMoved(sample.time_ns) ? 1 : 0;
    sums[part] += sample.residual.norm();
    ++counts[part];
  }
  return std::max(sums[0] / std::max(1.0, counts[0]), sums[1] / std::max(1.0, counts[1]));
}

}  // namespace rigcal::server
