// SPDX-License-Identifier: Apache-2.0
#include "server/solve/diagnose/wand_shape.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include "common/camera/camera_model.h"
#include "common/statistics/robust_statistics.h"
#include "server/solve/bundle/marker_residual_px.h"

namespace rigcal::server {
namespace {

constexpr double kLostPx = 60;
constexpr double kPriorM = 0.1;  // of a marker's place beside the straight wand
constexpr double kPriorNoisePx = 0.5;
constexpr double kLeastNormPx = 0.3;  // of the weights
constexpr size_t kMinShapesOfPart = 20;
constexpr int kSagRounds = 5;
constexpr double kLeastSagM = 5e-4;

// The samples of one instant.
struct Run {
  size_t begin = 0, end = 0;
};

std::vector<Run> RunsOf(const std::vector<WandSample>& samples) {
  std::vector<Run> runs;
  for (size_t i = 0; i < samples.size(); ++i) {
    if (i == 0 || samples[i].instant != samples[i - 1].instant) runs.push_back({i, i});
    runs.back().end = i + 1;
  }
  return runs;
}

// What cameras say of where a marker is, beside the straight wand.
struct PlaceSums {
  Eigen::Matrix3d information = std::pow(kPriorNoisePx / kPriorM, 2) * Eigen::Matrix3d::Identity();
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
  int cameras = 0;

  void Add(const WandSample& sample, double sign) {
    information += sign * sample.by_point.transpose() * sample.by_point;
    gradient += sign * sample.by_point.transpose() * sample.residual;
    cameras += sign > 0 ? 1 : -1;
  }
  Eigen::Vector3d Place() const { return -information.ldlt().solve(gradient); }
};

// Of the three markers.
using WandSums = std::array<PlaceSums, 3>;

template <typename Takes>
WandSums SumsOf(const std::vector<WandSample>& samples, const Run& run, const Takes& takes) {
  WandSums sums;
  for (size_t i = run.begin; i < run.end; ++i) {
    if (takes(samples[i].camera)) sums[static_cast<size_t>(samples[i].place)].Add(samples[i], 1);
  }
  return sums;
}

// Of the way from the first marker to the last.
double MiddleShare(const BundleProblem& problem) {
  const std::vector<double>& at_m = problem.target.marker_positions_m;
  return (at_m[1] - at_m[0]) / (at_m[2] - at_m[0]);
}

// The straight line that fits three points of which the middle one is off by one: what is left at
// each of them. Least squares over the three.
std::array<double, 3> LeftOfFittedLine(double middle_share) {
  const std::array<double, 3> at = {0, middle_share, 1};
  const double mean = (at[0] + at[1] + at[2]) / 3;
  double squares = 0;
  for (const double x : at) squares += (x - mean) * (x - mean);
  std::array<double, 3> left{};
  for (size_t m = 0; m < 3; ++m) {
    const double fitted = 1.0 / 3 + (at[m] - mean) * (at[1] - mean) / squares;
    left[m] = (m == 1 ? 1 : 0) - fitted;
  }
  return left;
}

// Across the wand; none where a marker is seen by fewer than two cameras.
std::optional<Eigen::Vector3d> OffLine(const WandSums& sums, const Eigen::Vector3d& axis,
                                       double middle_share) {
  if (std::ranges::any_of(sums, [](const PlaceSums& own) { return own.cameras < 2; })) {
    return std::nullopt;
  }
  const Eigen::Vector3d off =
      sums[1].Place() - (1 - middle_share) * sums[0].Place() - middle_share * sums[2].Place();
  return (off - axis.dot(off) * axis).eval();
}

constexpr auto kAll = [](int) { return true; };

Eigen::Vector3d AcrossOf(const Eigen::Vector3d& vector, const Eigen::Vector3d& axis) {
  return vector - axis.dot(vector) * axis;
}

// Standard error of a mean whose terms scatter by `values`, by their median.
double SigmaOfMean(std::vector<double> values) {
  if (values.size() < 2) return std::numeric_limits<double>::infinity();
  const double middle = UpperMedian(values);
  for (double& value : values) value = std::abs(value - middle);
  return 1.4826 * UpperMedian(values) / std::sqrt(static_cast<double>(values.size()));
}

double MedianOf(const std::vector<WandShape>& shapes, size_t begin, size_t end, int span) {
  std::vector<double> values;
  for (size_t i = begin; i < end; ++i) values.push_back(shapes[i].span_m[span]);
  return UpperMedian(values);
}

double DistanceFrom(const std::vector<WandShape>& shapes, size_t begin, size_t end, int span,
                    double value_m) {
  double sum = 0;
  for (size_t i = begin; i < end; ++i) sum += std::abs(shapes[i].span_m[span] - value_m);
  return sum;
}

// Both spans' absolute deviations from their medians before and after.
double SplitCost(const std::vector<WandShape>& shapes, size_t split) {
  double cost = 0;
  for (const int span : {0, 1}) {
    cost += DistanceFrom(shapes, 0, split, span, MedianOf(shapes, 0, split, span));
    cost += DistanceFrom(shapes, split, shapes.size(), span,
                         MedianOf(shapes, split, shapes.size(), span));
  }
  return cost;
}

}  // namespace

std::vector<WandSample> WandSamplesOf(const TrialProblem& trial) {
  const BundleProblem& problem = trial.problem;
  std::vector<WandSample> samples;
  if (problem.HasRigidTarget() || problem.HasSeveralWands() ||
      problem.target.marker_positions_m.size() != 3) {
    return samples;
  }
  ForEachMarker(problem, [&](size_t i, const BundleObservation& observation, size_t m) {
    const BundleInstant& instant = problem.instants[i];
    const BundleMarker& marker = problem.markers[m];
    const BundleCamera& camera = problem.CameraOf(observation);
    const auto residual = MarkerResidualPx(problem, instant, observation, marker);
    Eigen::Vector2d pixel;
    Eigen::Matrix<double, 2, 3> d_point;
    if (!residual || residual->norm() > kLostPx ||
        !Project(camera.model, camera.intrinsics.data(),
                 camera.cam_from_rig * problem.PointOf(instant, marker), &pixel, &d_point,
                 nullptr)) {
      return;
    }
    samples.push_back({i, m, observation.camera, marker.marker, *residual,
                       d_point * camera.cam_from_rig.rotation.toRotationMatrix()});
  });
  return samples;
}

std::vector<WandShape> WandShapesOf(const TrialProblem& trial, const SessionTimeline& timeline,
                                    const std::vector<WandSample>& samples) {
  const double middle_share = MiddleShare(trial.problem);
  std::vector<WandShape> shapes;
  for (const Run& run : RunsOf(samples)) {
    const size_t instant = samples[run.begin].instant;
    WandShape shape{instant, timeline.TimeNs(instant), trial.problem.instants[instant].direction,
                    Eigen::Vector3d::Zero()};
    const WandSums sums = SumsOf(samples, run, kAll);
    const auto off = OffLine(sums, shape.axis, middle_share);
    if (!off) continue;
    shape.off_line_m = *off;
    double along_m[3];
    for (int m = 0; m < 3; ++m) along_m[m] = shape.axis.dot(sums[static_cast<size_t>(m)].Place());
    shape.span_m[0] = along_m[1] - along_m[0];
    shape.span_m[1] = along_m[2] - along_m[1];
    shapes.push_back(shape);
  }
  std::ranges::stable_sort(shapes, {}, &WandShape::time_ns);
  return shapes;
}

double BendGainPx(const TrialProblem& trial, const std::vector<WandSample>& samples) {
  if (samples.empty()) return 0;
  const double middle_share = MiddleShare(trial.problem);
  const std::array<double, 3> left = LeftOfFittedLine(middle_share);
  double gain_px = 0;
  for (const Run& run : RunsOf(samples)) {
    const Eigen::Vector3d axis = trial.problem.instants[samples[run.begin].instant].direction;
    const WandSums all = SumsOf(samples, run, kAll);
    for (size_t begin = run.begin, end = begin; begin < run.end; begin = end) {
      WandSums others = all;
      while (end < run.end && samples[end].camera == samples[begin].camera) {
        others[static_cast<size_t>(samples[end].place)].Add(samples[end], -1);
        ++end;
      }
      const auto off = OffLine(others, axis, middle_share);
      for (size_t i = begin; off && i < end; ++i) {
        const WandSample& sample = samples[i];
        const Eigen::Vector2d moved =
            sample.residual + sample.by_point * left[static_cast<size_t>(sample.place)] * *off;
        gain_px += sample.residual.norm() - moved.norm();
      }
    }
  }
  return gain_px / static_cast<double>(samples.size());
}

WandFault BendOf(const TrialProblem& trial, const std::vector<WandSample>& samples,
                 const std::vector<WandShape>& shapes) {
  WandFault fault;
  fault.form = WandFault::Form::kBends;
  fault.shapes = shapes;
  const double middle_share = MiddleShare(trial.problem);
  std::vector<double> squares_m2;
  for (const Run& run : RunsOf(samples)) {
    const Eigen::Vector3d& axis = trial.problem.instants[samples[run.begin].instant].direction;
    std::vector<int> cameras;
    for (size_t i = run.begin; i < run.end; ++i) {
      if (cameras.empty() || cameras.back() != samples[i].camera) {
        cameras.push_back(samples[i].camera);
      }
    }
    const auto is_odd = [&cameras](int camera) {
      return (std::ranges::find(cameras, camera) - cameras.begin()) % 2 == 1;
    };
    const auto odd = OffLine(SumsOf(samples, run, is_odd), axis, middle_share);
    const auto even = OffLine(SumsOf(samples, run, [&](int camera) { return !is_odd(camera); }),
                              axis, middle_share);
    if (odd && even) squares_m2.push_back(odd->dot(*even));
  }
  if (squares_m2.size() < kMinShapesOfPart) return fault;
  double sum_m2 = 0, sum_m4 = 0;
  for (const double square_m2 : squares_m2) {
    sum_m2 += square_m2;
    sum_m4 += square_m2 * square_m2;
  }
  const auto count = static_cast<double>(squares_m2.size());
  const double mean_m2 = sum_m2 / count;
  fault.size_m = std::sqrt(std::max(0.0, mean_m2));
  const double sigma_m2 = std::sqrt(std::max(0.0, sum_m4 / count - mean_m2 * mean_m2) / count);
  fault.sigma_m = sigma_m2 / (2 * std::max(fault.size_m, std::sqrt(sigma_m2)));
  return fault;
}

WandFault SagOf(const std::vector<WandShape>& shapes) {
  WandFault fault;
  fault.form = WandFault::Form::kSags;
  fault.shapes = shapes;
  // Least absolute errors of off_line = across(sag).
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  for (int round = 0; round < kSagRounds; ++round) {
    information = 1e-9 * Eigen::Matrix3d::Identity();
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (const WandShape& shape : shapes) {
      const Eigen::Vector3d left = shape.off_line_m - AcrossOf(fault.sag_m, shape.axis);
      const double weight = 1 / std::max(left.norm(), kLeastSagM);
      information += weight * (Eigen::Matrix3d::Identity() - shape.axis * shape.axis.transpose());
      sum += weight * shape.off_line_m;
    }
    fault.sag_m = information.ldlt().solve(sum);
  }
  fault.size_m = fault.sag_m.norm();
  std::vector<double> along;
  for (const WandShape& shape : shapes) {
    along.push_back(
        fault.sag_m.normalized().dot(shape.off_line_m - AcrossOf(fault.sag_m, shape.axis)));
  }
  fault.sigma_m = SigmaOfMean(along);
  return fault;
}

std::optional<WandFault> SlipOf(const std::vector<WandShape>& shapes) {
  if (shapes.size() < 4 * kMinShapesOfPart) return std::nullopt;
  size_t best = 0;
  double least = std::numeric_limits<double>::infinity();
  const size_t stride = std::max<size_t>(1, shapes.size() / 40);
  const auto look = [&](size_t split) {
    if (split < kMinShapesOfPart || split + kMinShapesOfPart > shapes.size()) return;
    const double cost = SplitCost(shapes, split);
    if (cost >= least) return;
    least = cost;
    best = split;
  };
  for (size_t split = stride; split < shapes.size(); split += stride) look(split);
  for (size_t fine = stride / 2; fine > 0; fine /= 2) {
    const size_t around = best;
    if (around > fine) look(around - fine);
    look(around + fine);
  }
  if (best == 0) return std::nullopt;
  double longer_m[2];
  for (const int span : {0, 1}) {
    longer_m[span] = MedianOf(shapes, best, shapes.size(), span) - MedianOf(shapes, 0, best, span);
  }
  WandFault fault;
  fault.form = WandFault::Form::kSlips;
  fault.shapes = shapes;
  fault.time_ns = shapes[best].time_ns;
  // What each marker alone would do to the two spans: least squares.
  constexpr double kSpansOf[3][2] = {{-1, 0}, {1, -1}, {0, 1}};
  double left_m2 = std::numeric_limits<double>::infinity();
  for (int place = 0; place < 3; ++place) {
    const double* by = kSpansOf[place];
    const double size_m =
        (by[0] * longer_m[0] + by[1] * longer_m[1]) / (by[0] * by[0] + by[1] * by[1]);
    const double own_m2 =
        std::pow(longer_m[0] - size_m * by[0], 2) + std::pow(longer_m[1] - size_m * by[1], 2);
    if (own_m2 >= left_m2) continue;
    left_m2 = own_m2;
    fault.place = place;
    fault.size_m = size_m;
  }
  std::vector<double> spans;
  const int span = fault.place == 0 ? 0 : 1;
  const double before_m = MedianOf(shapes, 0, best, span);
  for (size_t i = 0; i < shapes.size(); ++i) {
    spans.push_back(shapes[i].span_m[span] - (i < best ? before_m : before_m + longer_m[span]));
  }
  fault.sigma_m = 2 * SigmaOfMean(spans);
  return fault;
}

void Straighten(const WandFault& fault, const std::vector<WandSample>& samples,
                const SessionTimeline& timeline, TrialProblem* trial) {
  BundleProblem& problem = trial->problem;
  std::vector<const WandShape*> shape_of(problem.instants.size(), nullptr);
  for (const WandShape& shape : fault.shapes) shape_of[shape.instant] = &shape;
  for (const WandSample& sample : samples) {
    const Eigen::Vector3d& axis = problem.instants[sample.instant].direction;
    Eigen::Vector3d moved_m = Eigen::Vector3d::Zero();
    switch (fault.form) {
      case WandFault::Form::kBends:
        if (sample.place == 1 && shape_of[sample.instant]) {
          moved_m = shape_of[sample.instant]->off_line_m;
        }
        break;
      case WandFault::Form::kSags:
        if (sample.place == 1) moved_m = AcrossOf(fault.sag_m, axis);
        break;
      case WandFault::Form::kSlips:
        if (sample.place == fault.place && timeline.TimeNs(sample.instant) >= fault.time_ns) {
          moved_m = fault.size_m * axis;
        }
        break;
    }
    if (moved_m.isZero()) continue;
    BundleMarker& marker = problem.markers[sample.marker];
    marker.centre_px -= sample.by_point * moved_m;
    marker.used = true;
  }
}

}  // namespace rigcal::server
