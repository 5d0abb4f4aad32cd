// SPDX-License-Identifier: Apache-2.0
#include "server/solve/rig/stamp_jitter.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>
#include <utility>

#include "common/statistics/robust_statistics.h"
#include "server/solve/bundle/marker_residual_px.h"
#include "server/solve/rig/shown_shifts.h"

namespace rigcal::server {
namespace {

constexpr double kMinJitterS = 2e-3;
constexpr double kOfMostJitter = 0.5;
constexpr int kFewestPairs = 60;
constexpr double kMostNoiseS = 3e-3;  // of a row's shift; slower rows tell nothing
constexpr double kMostShiftS = 0.1;   // more is an outlier
constexpr double kNeighbours = 2.5;   // median steps from row to row
constexpr double kMadOfNormal = 1.4826;
// Jitter against noise, and against what is linear in the image row.
constexpr double kOverNoise = 2, kOverLine = 1;

// A row of a camera: how far in time it is from where it fits.
struct RowShift {
  double time_s = 0;  // on its clock
  double shift_s = 0;
  double weight = 0;  // |L u'|^2, 1/s^2: its variance is that of a residual, by this
  double speed_px_s = 0;
  double image_row = 0;
};

double ScatterOf(std::vector<double> values) {
  for (double& value : values) value = std::abs(value);
  return values.empty() ? 0 : kMadOfNormal * UpperMedian(&values);
}

struct CameraShifts {
  std::map<int, std::vector<RowShift>> by_clock;
  std::vector<double> across;  // whitened residuals across the motion
};

std::vector<CameraShifts> ShiftsOf(const BundleProblem& problem) {
  std::vector<CameraShifts> all(problem.cameras.size());
  for (const BundleInstant& instant : problem.instants) {
    if (!instant.used || instant.is_rigid) continue;
    for (const BundleObservation& observation : problem.ObservationsOf(instant)) {
      CameraShifts& own = all[static_cast<size_t>(observation.camera)];
      RowShift row{.time_s = observation.clock_time_s};
      double along = 0;
      int count = 0;
      for (const BundleMarker& marker : problem.MarkersOf(observation)) {
        const auto residual = MarkerResidualPx(problem, instant, observation, marker);
        if (!residual) continue;
        const Eigen::Vector2d error = marker.sqrt_information * *residual;
        const Eigen::Vector2d motion = marker.sqrt_information * marker.velocity_px_s;
        const double speed2 = motion.squaredNorm();
        if (!(speed2 > 0)) continue;
        along -= motion.dot(error);
        row.weight += speed2;
        row.speed_px_s += marker.velocity_px_s.norm();
        row.image_row += marker.centre_px.y();
        if (marker.used) {
          own.across.push_back((motion.x() * error.y() - motion.y() * error.x()) /
                               std::sqrt(speed2));
        }
        ++count;
      }
      if (count == 0) continue;
      row.shift_s = along / row.weight;
      row.speed_px_s /= count;
      row.image_row /= count;
      own.by_clock[observation.clock].push_back(row);
    }
  }
  return all;
}

StampJitter Measure(CameraShifts shifts) {
  StampJitter jitter;
  const double noise = std::max(1.0, ScatterOf(shifts.across));
  std::vector<double> steps_s, shift_steps_s, image_steps, variances_s2, speeds;
  for (auto& [clock, rows] : shifts.by_clock) {
    std::ranges::stable_sort(rows, {}, &RowShift::time_s);
    std::vector<double> apart_s;
    for (size_t i = 1; i < rows.size(); ++i) {
      apart_s.push_back(rows[i].time_s - rows[i - 1].time_s);
    }
    if (apart_s.empty()) continue;
    const double near_s = kNeighbours * UpperMedian(apart_s);
    for (size_t i = 1; i < rows.size(); ++i) {
      const RowShift &a = rows[i - 1], &b = rows[i];
      const double variance_s2 = noise * noise * (1 / a.weight + 1 / b.weight);
      if (b.time_s - a.time_s > near_s || variance_s2 > 2 * kMostNoiseS * kMostNoiseS) continue;
      if (std::max(std::abs(a.shift_s), std::abs(b.shift_s)) > kMostShiftS) continue;
      shift_steps_s.push_back(b.shift_s - a.shift_s);
      image_steps.push_back(b.image_row - a.image_row);
      variances_s2.push_back(variance_s2);
      speeds.push_back(b.speed_px_s);
    }
  }
  jitter.row_count = static_cast<int>(shift_steps_s.size());
  if (jitter.row_count < kFewestPairs) return jitter;
  // Linear in the image row, without the pairs that are far out.
  const double limit_s = 4 * ScatterOf(shift_steps_s);
  double sum_xy = 0, sum_xx = 0, square_xx = 0;
  for (size_t i = 0; i < shift_steps_s.size(); ++i) {
    square_xx += image_steps[i] * image_steps[i];
    if (std::abs(shift_steps_s[i]) > limit_s) continue;
    sum_xy += image_steps[i] * shift_steps_s[i];
    sum_xx += image_steps[i] * image_steps[i];
  }
  const double slope = sum_xx > 0 ? sum_xy / sum_xx : 0;
  for (size_t i = 0; i < shift_steps_s.size(); ++i) shift_steps_s[i] -= slope * image_steps[i];
  const double rest_s = ScatterOf(shift_steps_s);
  const double noise_s2 = UpperMedian(&variances_s2);
  // Of two rows, which scatter independently of each other.
  const double excess_s2 = rest_s * rest_s - kOverNoise * noise_s2;
  jitter.shown_s = excess_s2 > 0 ? std::sqrt(0.5 * (rest_s * rest_s - noise_s2)) : 0;
  jitter.line_s =
      std::abs(slope) * std::sqrt(0.5 * square_xx / static_cast<double>(image_steps.size()));
  jitter.error_px = jitter.shown_s * UpperMedian(&speeds);
  return jitter;
}

}  // namespace

bool StampJitter::StandsOut() const {
  return shown_s > kMinJitterS && shown_s > kOverLine * line_s;
}

std::vector<StampJitter> MeasureStampJitter(const BundleProblem& problem) {
  std::vector<StampJitter> all;
  for (CameraShifts& shifts : ShiftsOf(problem)) all.push_back(Measure(std::move(shifts)));
  if (std::ranges::none_of(all, &StampJitter::StandsOut)) {
    for (StampJitter& jitter : all) jitter.jitter_s = jitter.shown_s;
    return all;
  }
  std::vector<double> shown_s2;
  for (const StampJitter& jitter : all) shown_s2.push_back(jitter.shown_s * jitter.shown_s);
  const std::vector<double> own_s2 = OwnVariances(ShownShares(problem), shown_s2);
  for (size_t c = 0; c < all.size(); ++c) all[c].jitter_s = std::sqrt(own_s2[c]);
  return all;
}

std::vector<bool> CamerasThatJitter(const std::vector<StampJitter>& jitter) {
  double most_s = 0;
  for (const StampJitter& own : jitter) most_s = std::max(most_s, own.shown_s);
  std::vector<bool> jitters;
  for (const StampJitter& own : jitter) {
    jitters.push_back(own.StandsOut() && own.shown_s >= kOfMostJitter * most_s);
  }
  return jitters;
}

}  // namespace rigcal::server
