// SPDX-License-Identifier: Apache-2.0
#include "server/solve/diagnose/clock_course.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

#include "common/camera/camera_model.h"
#include "common/statistics/robust_statistics.h"
#include "server/solve/diagnose/clock_course_model.h"
#include "server/solve/diagnose/others_points.h"

namespace rigcal::server {
namespace {

// Around what its cameras saw: the course of a clock lies within it.
constexpr int64_t kSightReachNs = 2'000'000'000;
constexpr size_t kMaxPoints = 6000;
constexpr size_t kMaxBlocks = 20, kMinBlocks = 6;
constexpr size_t kMinSightsOfBlock = 45;
constexpr double kReachS = 0.6, kScanStepS = 0.01;
constexpr double kCourseCapPx = 30;
// A block that fits this well where it is needs no search, one that fits worse is not believed.
constexpr double kContentPx = 3;
constexpr double kDerivativeS = 0.002;
constexpr double kMaxStepS = 0.01;
constexpr int kOffsetIterations = 10, kPoseIterations = 6, kRounds = 3;
constexpr double kMinScalePx = 0.1;
constexpr size_t kCurvePieces = 16;  // a parabola, by straight lines to a 1000th of its height

// A point as the track's camera saw it at some time, and where it should be.
struct Sight {
  int marker;
  double time_s;
  Eigen::Vector3d x_in_rig;
  size_t part;  // of the camera
  Eigen::Vector2d predicted_px;
  bool in_view;
};

// A camera as it stood from some time on; a trial that took it apart has several, by time.
struct CameraPart {
  double begin_s;
  BundleCamera camera;
};

class CourseMeter {
 public:
  CourseMeter(std::vector<CameraPart> parts, const Intrinsics& given, TrackPaths paths,
              const std::vector<TimedMarker>& points, int64_t origin_ns)
      : parts_(std::move(parts)), given_(given), paths_(std::move(paths)) {
    size_t part = 0;  // points ascend by time
    for (const TimedMarker& point : points) {
      const double time_s = 1e-9 * static_cast<double>(point.rig_time_ns - origin_ns);
      while (part + 1 < parts_.size() && parts_[part + 1].begin_s <= time_s) ++part;
      Sight sight = {point.marker, time_s, point.x_in_rig, part, Eigen::Vector2d::Zero(), false};
      if (SeenPx(sight, 0)) sights_.push_back(sight);
    }
    Predict();
  }

  size_t size() const { return sights_.size(); }
  double time_s(size_t i) const { return sights_[i].time_s; }
  TrackPaths TakePaths() && { return std::move(paths_); }

  // Error of a sight at an offset, at most the cap.
  double ErrorPx(size_t i, double offset_s) const {
    const auto residual = ResidualPx(sights_[i], offset_s);
    return residual ? std::min(kCourseCapPx, residual->norm()) : kCourseCapPx;
  }
  double MeanErrorPx(size_t begin, size_t end, double offset_s) const {
    double sum = 0;
    for (size_t i = begin; i < end; ++i) sum += ErrorPx(i, offset_s);
    return sum / static_cast<double>(end - begin);
  }

  // The best offset of some sights: from `near_s`, or where that does not fit from anywhere.
  CourseBlock Fit(size_t begin, size_t end, double near_s, bool search) const {
    CourseBlock block = Refine(begin, end, near_s);
    if (search && !(block.error_px < kContentPx)) {
      double best_px = MeanErrorPx(begin, end, block.offset_s), best_s = block.offset_s;
      const int steps = static_cast<int>(kReachS / kScanStepS);
      for (int i = -steps; i <= steps; ++i) {
        const double error_px = MeanErrorPx(begin, end, near_s + i * kScanStepS);
        if (error_px < best_px) {
          best_px = error_px;
          best_s = near_s + i * kScanStepS;
        }
      }
      block = Refine(begin, end, best_s);
    }
    block.time_s = sights_[(begin + end) / 2].time_s;
    return block;
  }

  // Fits each part's pose to its sights, each at its own offset.
  void FitPoses(const std::vector<double>& offsets_s, const std::vector<bool>& use) {
    for (size_t part = 0; part < parts_.size(); ++part) FitPose(part, offsets_s, use);
  }

 private:
  void FitPose(size_t part, const std::vector<double>& offsets_s, const std::vector<bool>& use) {
    BundleCamera& camera = parts_[part].camera;
    for (int iteration = 0; iteration < kPoseIterations; ++iteration) {
      Eigen::Matrix<double, 6, 6> normal = 1e-9 * Eigen::Matrix<double, 6, 6>::Identity();
      Eigen::Matrix<double, 6, 1> gradient = Eigen::Matrix<double, 6, 1>::Zero();
      std::vector<double> norms;
      for (size_t i = 0; i < sights_.size(); ++i) {
        if (use[i] && sights_[i].part == part) norms.push_back(ErrorPx(i, offsets_s[i]));
      }
      if (norms.size() < kMinSightsOfBlock) return;
      const double scale = std::max(kMinScalePx, UpperMedian(&norms) / kMedianOfRayleigh);
      for (size_t i = 0; i < sights_.size(); ++i) {
        if (!use[i] || sights_[i].part != part) continue;
        const auto residual = ResidualPx(sights_[i], offsets_s[i]);
        if (!residual) continue;
        const Eigen::Vector3d rotated = camera.cam_from_rig.rotation * sights_[i].x_in_rig;
        Eigen::Vector2d pixel;
        Eigen::Matrix<double, 2, 3> d_point;
        if (!Project(camera.model, camera.intrinsics.data(),
                     rotated + camera.cam_from_rig.translation_m, &pixel, &d_point, nullptr)) {
          continue;
        }
        Eigen::Matrix3d cross;
        cross << 0, -rotated.z(), rotated.y(), rotated.z(), 0, -rotated.x(), -rotated.y(),
            rotated.x(), 0;
        Eigen::Matrix<double, 2, 6> jacobian;
        jacobian << d_point * cross, -d_point;  // of seen minus predicted
        const double weight = 1 / (1 + residual->squaredNorm() / (4 * scale * scale));
        normal += weight * jacobian.transpose() * jacobian;
        gradient += weight * jacobian.transpose() * *residual;
      }
      const Eigen::Matrix<double, 6, 1> step = -normal.ldlt().solve(gradient);
      if (!step.allFinite()) return;
      const double angle = step.head<3>().norm();
      if (angle > 0) {
        camera.cam_from_rig.rotation =
            (Eigen::AngleAxisd(angle, step.head<3>() / angle) * camera.cam_from_rig.rotation)
                .normalized();
      }
      camera.cam_from_rig.translation_m += step.tail<3>();
      Predict();
    }
  }

  void Predict() {
    for (Sight& sight : sights_) {
      const BundleCamera& camera = parts_[sight.part].camera;
      sight.in_view =
          Project(camera.model, camera.intrinsics.data(), camera.cam_from_rig * sight.x_in_rig,
                  &sight.predicted_px, nullptr, nullptr);
    }
  }

  std::optional<Eigen::Vector2d> SeenPx(const Sight& sight, double offset_s) const {
    const auto ray = At(paths_.markers[static_cast<size_t>(sight.marker)], sight.time_s - offset_s,
                        paths_.gap_s);
    Eigen::Vector2d pixel;
    if (!ray || !Project(given_, ray->homogeneous(), &pixel)) return std::nullopt;
    return pixel;
  }

  std::optional<Eigen::Vector2d> ResidualPx(const Sight& sight, double offset_s) const {
    const auto seen_px = SeenPx(sight, offset_s);
    if (!seen_px || !sight.in_view) return std::nullopt;
    return Eigen::Vector2d(*seen_px - sight.predicted_px);
  }

  CourseBlock Refine(size_t begin, size_t end, double offset_s) const {
    CourseBlock block;
    block.offset_s = offset_s;
    block.error_px = block.sigma_s = std::numeric_limits<double>::infinity();
    for (int iteration = 0; iteration < kOffsetIterations; ++iteration) {
      std::vector<std::pair<Eigen::Vector2d, Eigen::Vector2d>> terms;
      std::vector<double> norms;
      for (size_t i = begin; i < end; ++i) {
        const auto residual = ResidualPx(sights_[i], block.offset_s);
        const auto later = ResidualPx(sights_[i], block.offset_s + kDerivativeS);
        const auto earlier = ResidualPx(sights_[i], block.offset_s - kDerivativeS);
        if (!residual || !later || !earlier) continue;
        terms.emplace_back(*residual, (*later - *earlier) / (2 * kDerivativeS));
        norms.push_back(residual->norm());
      }
      if (2 * norms.size() < end - begin) return block;
      block.error_px = UpperMedian(&norms);
      const double scale = std::max(kMinScalePx, block.error_px / kMedianOfRayleigh);
      double information = 0, gradient = 0;
      for (const auto& [residual, slope] : terms) {
        const double weight = 1 / (1 + residual.squaredNorm() / (4 * scale * scale));
        information += weight * slope.squaredNorm();
        gradient += weight * slope.dot(residual);
      }
      if (!(information > 0)) return block;
      block.sigma_s = scale / std::sqrt(information);
      const double step_s = std::clamp(-gradient / information, -kMaxStepS, kMaxStepS);
      block.offset_s += step_s;
      if (std::abs(step_s) < 1e-7) break;
    }
    return block;
  }

  std::vector<CameraPart> parts_;
  const Intrinsics& given_;
  TrackPaths paths_;
  std::vector<Sight> sights_;
};

// The time of a step to a sight, between the blocks around it.
void RefineStepTime(const CourseMeter& meter, size_t step, ClockCourse* course) {
  const ClockStep found = course->steps[step];
  const auto next = static_cast<size_t>(
      std::ranges::lower_bound(course->blocks, found.time_s, {}, &CourseBlock::time_s) -
      course->blocks.begin());
  const double from_s = course->blocks[next >= 1 ? next - 1 : 0].time_s;
  const double to_s = course->blocks[std::min(next + 1, course->blocks.size() - 1)].time_s;
  // Errors as if the step came first; each sight passed goes to the other side.
  ClockCourse without = *course;
  without.steps.erase(without.steps.begin() + static_cast<std::ptrdiff_t>(step));
  double cost = 0, best = 0;
  double best_s = from_s;
  for (size_t i = 0; i < meter.size(); ++i) {
    const double time_s = meter.time_s(i);
    if (time_s < from_s || time_s > to_s) continue;
    const double before_s = without.OffsetAt(time_s);
    cost += meter.ErrorPx(i, before_s) - meter.ErrorPx(i, before_s + found.size_s);
    if (cost < best) {
      best = cost;
      best_s = i + 1 < meter.size() ? 0.5 * (time_s + meter.time_s(i + 1)) : time_s;
    }
  }
  course->steps[step].time_s = best_s;
}

// The course at some of the track's rows, whose rig times are `times_ns`. The straight line below
// steps or corners is left out: most of it is what a rate took of them, and the rate is estimated
// again. Empty where a step has no row on one of its sides.
ClockCourseLine LineOf(ClockCourse course, const ObservationTable& rows,
                       const std::vector<int64_t>& times_ns, int64_t origin_ns) {
  const auto seconds = [&](size_t row) {
    return 1e-9 * static_cast<double>(times_ns[row] - origin_ns);
  };
  const auto first_from = [&](double time_s) {
    size_t row = 0;
    while (row < rows.size() && seconds(row) < time_s) ++row;
    return row;
  };
  if (!course.steps.empty() || !course.corners.empty()) course.coefficients.clear();
  std::vector<size_t> ends = {0, rows.size() - 1};
  for (const ClockStep& step : course.steps) {
    const size_t after = first_from(step.time_s);
    if (after == 0 || after == rows.size()) return {};
    ends.push_back(after - 1);
    ends.push_back(after);
  }
  for (const ClockCorner& corner : course.corners) {
    ends.push_back(std::min(first_from(corner.time_s), rows.size() - 1));
  }
  if (course.kind == CourseKind::kCurve) {
    for (size_t i = 1; i < kCurvePieces; ++i) ends.push_back(i * (rows.size() - 1) / kCurvePieces);
  }
  std::ranges::sort(ends);
  ClockCourseLine line;
  for (const size_t row : ends) {
    const ClockCoursePoint point = {rows.time_ns(row),
                                    course.OffsetAt(seconds(row)) - course.OffsetAt(seconds(0))};
    if (line.empty() || point.camera_time_ns > line.back().camera_time_ns) line.push_back(point);
  }
  return line;
}

// The track on a clock with the most instants; -1 for none.
int MainTrack(const RigObservations& rig, const RigSolution& solution, int clock) {
  int best = -1;
  uint32_t most = 0;
  for (size_t t = 0; t < rig.tracks.size(); ++t) {
    if (rig.index.clock_of_track[t] != clock || solution.instants.instant_count[t] <= most) {
      continue;
    }
    best = static_cast<int>(t);
    most = solution.instants.instant_count[t];
  }
  return best;
}

// By time; those that saw anything on the clock, or where none did the first. One that is back
// where it was begins again.
std::vector<CameraPart> PartsOf(const TrialProblem& trial, size_t rig_camera, int clock,
                                int64_t origin_ns) {
  const BundleProblem& problem = trial.problem;
  size_t last = problem.cameras.size();
  std::vector<CameraPart> parts;
  for (size_t i = 0; i < problem.instants.size(); ++i) {
    for (const BundleObservation& observation : problem.ObservationsOf(problem.instants[i])) {
      const auto camera = static_cast<size_t>(observation.camera);
      if (trial.rig_camera[camera] != rig_camera || observation.clock != clock) continue;
      if (camera == last) continue;
      last = camera;
      parts.push_back({1e-9 * static_cast<double>(trial.instant_time_ns[i] - origin_ns),
                       problem.cameras[camera]});
    }
  }
  if (parts.empty()) {
    const auto first = std::ranges::find(trial.rig_camera, rig_camera) - trial.rig_camera.begin();
    parts.push_back({0, problem.cameras[static_cast<size_t>(first)]});
  }
  return parts;
}

// Instants within reach of those at which a clock's cameras saw the target: in a large rig, whose
// cameras see the target in a part of the room alone, others say nothing of that clock.
std::vector<size_t> NearSights(const TrialProblem& trial, int clock) {
  std::vector<int64_t> sights_ns;
  const std::vector<BundleInstant>& instants = trial.problem.instants;
  for (size_t i = 0; i < instants.size(); ++i) {
    const auto observations = trial.problem.ObservationsOf(instants[i]);
    if (std::ranges::any_of(observations, [clock](const BundleObservation& observation) {
          return observation.clock == clock;
        })) {
      sights_ns.push_back(trial.instant_time_ns[i]);
    }
  }
  std::ranges::sort(sights_ns);
  std::vector<size_t> near;
  for (size_t i = 0; i < instants.size(); ++i) {
    const int64_t time_ns = trial.instant_time_ns[i];
    const auto after = std::ranges::lower_bound(sights_ns, time_ns - kSightReachNs);
    if (after != sights_ns.end() && *after <= time_ns + kSightReachNs) near.push_back(i);
  }
  return near;
}

}  // namespace

double ClockCourse::OffsetAt(double time_s) const {
  double offset_s = 0;
  for (const ClockStep& step : steps) offset_s += time_s >= step.time_s ? step.size_s : 0;
  for (const ClockCorner& corner : corners) {
    offset_s += corner.slope * std::max(0.0, time_s - corner.time_s);
  }
  for (size_t i = 0; i < coefficients.size(); ++i) {
    offset_s += coefficients[i] * std::pow(time_s - middle_s, static_cast<double>(i));
  }
  return offset_s;
}

std::optional<ClockCourse> MeasureClockCourse(const RigObservations& rig,
                                              const RigSolution& solution,
                                              const TrialProblem& trial, int clock) {
  const int track = MainTrack(rig, solution, clock);
  if (track < 0 || solution.built.instant_time_ns.empty()) return std::nullopt;
  const auto t = static_cast<size_t>(track);
  const auto c = static_cast<size_t>(rig.index.camera_of_track[t]);
  const int64_t origin_ns = solution.built.instant_time_ns.front();
  const auto session_of = [&solution](int k) -> const std::string& {
    return solution.clocks[static_cast<size_t>(k)].session_id;
  };
  const std::vector<size_t> near =
      trial.shares_few ? NearSights(trial, clock) : std::vector<size_t>();
  const std::vector<TimedMarker> points = MarkersSeenBy(
      trial.problem, trial.instant_time_ns,
      [&](const BundleObservation& seen) {
        return seen.clock != clock && session_of(seen.clock) == session_of(clock);
      },
      kMaxPoints, trial.shares_few ? &near : nullptr);
  // As the trial corrects them: what a cause had spoilt that is taken out is no course.
  std::vector<ClockCorrection> clocks = solution.clocks;
  for (size_t k = 0; k < clocks.size(); ++k) {
    clocks[k].time_offset_s += trial.problem.clocks[k].time_offset_s;
    clocks[k].time_rate += trial.problem.clocks[k].time_rate;
  }
  RigIndex alone;
  alone.clock_of_track = {0};
  const auto times = RigTimes({rig.tracks[t]}, alone, {clocks[static_cast<size_t>(clock)]});
  CourseMeter meter(
      PartsOf(trial, c, clock, origin_ns), *rig.index.cameras[c].intrinsics,
      PathsOf(rig.tracks[t], times.front(), origin_ns, rig.TargetOf(t).marker_count()), points,
      origin_ns);
  const size_t count = std::min(kMaxBlocks, meter.size() / kMinSightsOfBlock);
  if (count < kMinBlocks) return std::nullopt;
  const auto first = [&](size_t b) { return b * meter.size() / count; };
  ClockCourse course;
  course.track = track;
  std::vector<CourseBlock> blocks(count);
  std::vector<double> offsets_s(meter.size(), 0);
  std::vector<bool> use(meter.size(), true);
  for (int round = 0; round < kRounds; ++round) {
    for (size_t b = 0; b < count; ++b) {
      blocks[b] = meter.Fit(first(b), first(b + 1), blocks[b].offset_s, true);
      for (size_t i = first(b); i < first(b + 1); ++i) {
        offsets_s[i] = blocks[b].offset_s;
        use[i] = blocks[b].error_px < 2 * kContentPx;
      }
    }
    if (round + 1 < kRounds) meter.FitPoses(offsets_s, use);
  }
  for (const CourseBlock& block : blocks) {
    if (block.error_px < kContentPx && std::isfinite(block.sigma_s)) course.blocks.push_back(block);
  }
  if (course.blocks.size() < kMinBlocks || 3 * course.blocks.size() < 2 * count) {
    return std::nullopt;
  }
  ChooseCourseModel(course.blocks, &course);
  for (size_t i = 0; i < course.steps.size(); ++i) RefineStepTime(meter, i, &course);
  if (course.kind != CourseKind::kConstant) {
    std::vector<double> values_s;
    for (const CourseBlock& block : course.blocks) values_s.push_back(block.offset_s);
    const double constant_s = Median(values_s);
    for (size_t i = 0; i < meter.size(); ++i) {
      const double share = 1 / static_cast<double>(meter.size());
      course.before_px += share * meter.ErrorPx(i, constant_s);
      course.after_px += share * meter.ErrorPx(i, course.OffsetAt(meter.time_s(i)));
    }
  }
  course.paths = std::move(meter).TakePaths();
  if (course.kind != CourseKind::kConstant) {
    course.line = LineOf(course, rig.tracks[t].track.observations, times.front(), origin_ns);
  }
  return course;
}

}  // namespace rigcal::server
