// SPDX-License-Identifier: Apache-2.0
#include "server/solve/diagnose/camera_change.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "common/status/status_macros.h"
#include "server/solve/evaluate/held_out_choice.h"

namespace rigcal::server {
namespace {

constexpr size_t kMinChangeMarkers = 240;
constexpr int kDriftBlocks = 12;
// Of a block: errors of neighbouring times have much in common, as LongBlocks has it.
constexpr int64_t kMinBlockNs = 2'000'000'000;
constexpr double kDriftSigmas = 2;
constexpr int kFitReweightings = 6;
constexpr int kTakeOutRounds = 4;

// ModelColumns of a linear model of the residuals.
using ModelColumns = Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::ColMajor, 2, 12>;
using ModelNumbers = Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, 12, 1>;

struct ModelRow {
  Eigen::Vector2d residual;
  ModelColumns columns;
};

double CappedPx(const ModelRow& row, const ModelNumbers& numbers) {
  return std::min(kMoveCapPx, (row.residual + row.columns * numbers).norm());
}

double CostOf(const std::vector<ModelRow>& rows, const ModelNumbers& numbers) {
  double cost = 0;
  for (const ModelRow& row : rows) cost += CappedPx(row, numbers);
  return cost;
}

// Least absolute errors by iterative reweighting.
ModelNumbers FitNumbers(const std::vector<ModelRow>& rows) {
  const Eigen::Index count = rows.front().columns.cols();
  ModelNumbers best = ModelNumbers::Zero(count), numbers = best;
  double best_cost = CostOf(rows, best);
  for (int round = 0; round < kFitReweightings; ++round) {
    Eigen::MatrixXd information = 1e-6 * Eigen::MatrixXd::Identity(count, count);
    Eigen::VectorXd gradient = Eigen::VectorXd::Zero(count);
    for (const ModelRow& row : rows) {
      const double norm = (row.residual + row.columns * numbers).norm();
      const double weight = (norm > 4 * kMoveCapPx ? 0.01 : 1) / std::max(norm, 0.1);
      information += weight * row.columns.transpose() * row.columns;
      gradient += weight * row.columns.transpose() * row.residual;
    }
    numbers = -information.ldlt().solve(gradient);
    if (!numbers.allFinite()) break;
    const double cost = CostOf(rows, numbers);
    if (cost >= best_cost) continue;
    best_cost = cost;
    best = numbers;
  }
  return best;
}

// Of the recording, from -1/2 at its first sample to 1/2 at its last.
struct Course {
  int64_t first_ns = 0, last_ns = 1;

  double At(int64_t time_ns) const {
    return static_cast<double>(time_ns - first_ns) / static_cast<double>(last_ns - first_ns) - 0.5;
  }
};

Course CourseOf(const TrialProblem& trial, const SessionTimeline& timeline) {
  Course course;
  bool any = false;
  for (size_t i = 0; i < trial.problem.instants.size(); ++i) {
    const int64_t time_ns = timeline.TimeNs(i);
    course.first_ns = any ? std::min(course.first_ns, time_ns) : time_ns;
    course.last_ns = any ? std::max(course.last_ns, time_ns) : time_ns + 1;
    any = true;
  }
  return course;
}

// What a change moves the image of a sample by, for unit numbers.
ModelColumns ChangeColumns(const MoveSample& sample, const CameraChange& change,
                           const Course& course) {
  if (change.form == CameraChange::Form::kZoom) {
    return change.when.HasMoved(sample.time_ns) ? ModelColumns(sample.from_principal_px)
                                                : ModelColumns(Eigen::Vector2d::Zero());
  }
  return course.At(sample.time_ns) * sample.jacobian;
}

// With one pose for all times beside the change: which of both the target's poses have taken in is
// not known.
std::vector<ModelRow> RowsOf(const std::vector<MoveSample>& samples, const CameraChange& change,
                             const Course& course) {
  std::vector<ModelRow> rows;
  for (const MoveSample& sample : samples) {
    const ModelColumns own = ChangeColumns(sample, change, course);
    ModelColumns columns(2, 6 + own.cols());
    columns.leftCols<6>() = sample.jacobian;
    columns.rightCols(own.cols()) = own;
    rows.push_back({sample.residual, columns});
  }
  return rows;
}

std::vector<ModelRow> WithoutChange(std::vector<ModelRow> rows) {
  for (ModelRow& row : rows) row.columns = row.columns.leftCols<6>().eval();
  return rows;
}

void SetNumbers(const ModelNumbers& numbers, CameraChange* change) {
  if (change->form == CameraChange::Form::kZoom) {
    change->zoom = numbers(6);
  } else {
    change->drift = numbers.tail<6>();
  }
}

Eigen::Vector2d MotionPx(const MoveSample& sample, const CameraChange& change,
                         const Course& course) {
  const ModelColumns columns = ChangeColumns(sample, change, course);
  if (change.form == CameraChange::Form::kZoom) return change.zoom * columns;
  return columns * change.drift;
}

bool HoldsForOtherBlocks(const std::vector<MoveSample>& samples, const std::vector<ModelRow>& rows,
                         const Course& course) {
  if (course.last_ns - course.first_ns < kDriftBlocks * kMinBlockNs) return false;
  const auto block_of = [&](size_t i) {
    const int block = static_cast<int>((course.At(samples[i].time_ns) + 0.5) * kDriftBlocks);
    return std::clamp(block, 0, kDriftBlocks - 1);
  };
  std::vector<double> without_px(kDriftBlocks, INFINITY), with_px(kDriftBlocks, INFINITY);
  for (const int held_out : {0, 1}) {
    std::vector<ModelRow> fitted;
    std::vector<std::vector<ModelRow>> others(kDriftBlocks);
    for (size_t i = 0; i < rows.size(); ++i) {
      const int block = block_of(i);
      if (block % 2 == held_out) {
        others[static_cast<size_t>(block)].push_back(rows[i]);
      } else {
        fitted.push_back(rows[i]);
      }
    }
    if (fitted.empty()) return false;
    const ModelNumbers with = FitNumbers(fitted), without = FitNumbers(WithoutChange(fitted));
    for (size_t b = 0; b < others.size(); ++b) {
      if (others[b].empty()) continue;
      const auto count = static_cast<double>(others[b].size());
      with_px[b] = CostOf(others[b], with) / count;
      without_px[b] = CostOf(WithoutChange(others[b]), without) / count;
    }
  }
  return CompareByBlock(without_px, with_px).IsClear(kMinScanGain, kDriftSigmas);
}

std::optional<CameraChange> FitChange(const TrialProblem& trial, const SessionTimeline& timeline,
                                      int camera, CameraChange change, bool must_hold) {
  const std::vector<MoveSample> samples = MoveSamplesOf(trial, timeline, camera);
  if (samples.size() < kMinChangeMarkers) return std::nullopt;
  const Course course = CourseOf(trial, timeline);
  const std::vector<ModelRow> rows = RowsOf(samples, change, course);
  const ModelNumbers numbers = FitNumbers(rows), one_pose = FitNumbers(WithoutChange(rows));
  SetNumbers(numbers, &change);
  // Beside false detections, which neither explains.
  double before = 0, after = 0;
  std::vector<MoveSample> kept_samples;
  std::vector<ModelRow> kept_rows;
  for (size_t i = 0; i < rows.size(); ++i) {
    const double own_px = CappedPx(rows[i], numbers);
    const double one_px = (rows[i].residual + samples[i].jacobian * one_pose).norm();
    if (own_px >= kMoveCapPx && one_px >= kMoveCapPx) continue;
    before += std::min(kMoveCapPx, one_px);
    after += own_px;
    kept_samples.push_back(samples[i]);
    kept_rows.push_back(rows[i]);
  }
  if (!(before > 0)) return std::nullopt;
  change.gain = 1 - after / before;
  if (change.gain < kMinScanGain) return std::nullopt;
  if (must_hold && !HoldsForOtherBlocks(kept_samples, kept_rows, course)) return std::nullopt;
  return change;
}

// The measured centres as the camera would have seen them without the change.
void TakeOut(const std::vector<MoveSample>& samples, const CameraChange& change,
             const Course& course, BundleProblem* problem) {
  for (const MoveSample& sample : samples) {
    BundleMarker& marker = problem->markers[sample.marker];
    marker.centre_px -= MotionPx(sample, change, course);
    marker.used = true;  // what was an outlier may fit now
  }
}

}  // namespace

std::optional<CameraChange> FitZoom(const TrialProblem& trial, const SessionTimeline& timeline,
                                    int camera, const ChangePoint& move) {
  CameraChange change;
  change.form = CameraChange::Form::kZoom;
  change.when = move;
  return FitChange(trial, timeline, camera, change, false);
}

std::optional<CameraChange> FitDrift(const TrialProblem& trial, const SessionTimeline& timeline,
                                     int camera) {
  CameraChange change;
  change.form = CameraChange::Form::kDrift;
  change.parameters = 6;
  return FitChange(trial, timeline, camera, change, true);
}

absl::StatusOr<TrialProblem> SolveWithout(const TrialProblem& trial,
                                          const SessionTimeline& timeline, int camera,
                                          CameraChange* change) {
  const Course course = CourseOf(trial, timeline);
  TrialProblem repaired = trial;
  CameraChange added = *change;
  for (int round = 0; round < kTakeOutRounds; ++round) {
    TakeOut(AllMoveSamplesOf(repaired, timeline, camera), added, course, &repaired.problem);
    RIGCAL_RETURN_IF_ERROR(SolveTrialFromAfar(repaired.bundle, &repaired.problem));
    const std::vector<MoveSample> samples = MoveSamplesOf(repaired, timeline, camera);
    const ModelNumbers numbers = FitNumbers(RowsOf(samples, added, course));
    SetNumbers(numbers, &added);
    if (round + 1 == kTakeOutRounds) break;
    change->zoom += added.zoom;
    change->drift += added.drift;
  }
  return repaired;
}

double ImageMotionPx(const TrialProblem& trial, const SessionTimeline& timeline, int camera,
                     const CameraChange& change) {
  double sum_px2 = 0, count = 0;
  for (const MoveSample& sample : MoveSamplesOf(trial, timeline, camera)) {
    if (change.form == CameraChange::Form::kZoom) {
      if (!change.when.HasMoved(sample.time_ns)) continue;
      sum_px2 += (change.zoom * sample.from_principal_px).squaredNorm();
    } else {
      sum_px2 += (sample.jacobian * change.drift).squaredNorm();
    }
    ++count;
  }
  return count > 0 ? std::sqrt(sum_px2 / count) : 0;
}

}  // namespace rigcal::server
