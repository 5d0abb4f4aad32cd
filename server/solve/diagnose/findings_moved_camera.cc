// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include "absl/strings/str_format.h"
#include "common/camera/camera_model.h"
#include "common/status/status_macros.h"
#include "server/solve/bundle/marker_residual_px.h"
#include "server/solve/diagnose/finding_causes.h"
#include "server/solve/evaluate/held_out_choice.h"
#include "server/solve/rig/outliers.h"

namespace rigcal::server {
namespace {

constexpr double kMinScanGain = 0.05;
constexpr double kMinMoveGain = 0.08;
constexpr double kMinMovePx = 0.3;
// Of six numbers together; by chance below once in ten million.
constexpr double kMoveSigmas = 7;
constexpr double kDegreesPerRadian = 57.29577951308232;
// Of the scan for the time of the move.
constexpr double kCapPx = 60;
constexpr size_t kMaxMarkers = 1500;
constexpr size_t kMinMarkersOfPart = 60;
constexpr int kCoarseSteps = 20;
constexpr int kFineSteps = 8;
constexpr int kReweightings = 6;
constexpr int kLensRounds = 2;
constexpr int kBlocksOfPart = 6;
constexpr size_t kMinMarkersOfBlock = 5;
constexpr double kHeldOutSigmas = 2;
constexpr double kMaxMovePerError = 10;

// Step of a camera's pose as in ReducedParameter: rotation vector in the camera's frame from the
// left, then what is added to the translation.
using PoseStep = Eigen::Matrix<double, 6, 1>;

// The instants of all sessions in one order of time: each session behind the one before, whatever
// its clocks show, which may have been started anew in between. Sessions follow each other by time
// where none overlap, else by name.
class Timeline {
 public:
  explicit Timeline(const CauseInput& input) {
    const TrialProblem& trial = input.trial;
    const std::vector<ClockCorrection>& clocks = input.evaluated.solution.clocks;
    std::vector<std::string> session_of;
    std::map<std::string, Span> spans;
    for (size_t i = 0; i < trial.problem.instants.size(); ++i) {
      const BundleObservation& first =
          trial.problem.ObservationsOf(trial.problem.instants[i]).front();
      const std::string& session = clocks[static_cast<size_t>(first.clock)].session_id;
      const auto [span, inserted] =
          spans.try_emplace(session, Span{trial.instant_time_ns[i], trial.instant_time_ns[i]});
      span->second.first_ns = std::min(span->second.first_ns, trial.instant_time_ns[i]);
      span->second.last_ns = std::max(span->second.last_ns, trial.instant_time_ns[i]);
      session_of.push_back(session);
    }
    for (const auto& [session, span] : spans) sessions_.push_back({session, span, 0});
    if (!Overlap()) std::ranges::sort(sessions_, {}, [](const Part& p) { return p.span.first_ns; });
    int64_t next_ns = 0;
    std::map<std::string, int64_t> shifts_ns;
    for (Part& part : sessions_) {
      part.begin_ns = next_ns;
      shifts_ns[part.session] = next_ns - part.span.first_ns;
      next_ns += part.span.last_ns - part.span.first_ns + kBetweenSessionsNs;
    }
    for (size_t i = 0; i < session_of.size(); ++i) {
      time_ns_.push_back(trial.instant_time_ns[i] + shifts_ns[session_of[i]]);
    }
  }

  int64_t TimeNs(size_t instant) const { return time_ns_[instant]; }
  // Where sessions after the first begin.
  std::vector<int64_t> BeginsNs() const {
    std::vector<int64_t> begins;
    for (size_t s = 1; s < sessions_.size(); ++s) begins.push_back(sessions_[s].begin_ns);
    return begins;
  }
  // A change as near to the begin of a session as it can be told is a change between sessions.
  int64_t Snapped(int64_t change_ns) const {
    for (const int64_t begin_ns : BeginsNs()) {
      if (std::abs(change_ns - begin_ns) < kBetweenSessionsNs) return begin_ns;
    }
    return change_ns;
  }
  // "it moved 12.0 s after the first wand view".
  std::string Describe(int64_t change_ns) const {
    size_t s = 0;
    while (s + 1 < sessions_.size() && sessions_[s + 1].begin_ns <= change_ns) ++s;
    const Part& part = sessions_[s];
    if (s > 0 && change_ns == part.begin_ns) {
      return absl::StrFormat("it moved between session %s and session %s,",
                             sessions_[s - 1].session, part.session);
    }
    const double time_s = 1e-9 * static_cast<double>(change_ns - part.begin_ns);
    return sessions_.size() == 1
               ? absl::StrFormat("it moved %.1f s after the first wand view", time_s)
               : absl::StrFormat("it moved %.1f s after the first wand view of session %s", time_s,
                                 part.session);
  }

 private:
  static constexpr int64_t kBetweenSessionsNs = 1'000'000'000;
  struct Span {
    int64_t first_ns = 0, last_ns = 0;
  };
  struct Part {
    std::string session;
    Span span;
    int64_t begin_ns = 0;
  };

  bool Overlap() const {
    for (const Part& a : sessions_) {
      for (const Part& b : sessions_) {
        if (&a != &b && a.span.first_ns <= b.span.last_ns && b.span.first_ns <= a.span.last_ns) {
          return true;
        }
      }
    }
    return false;
  }

  std::vector<Part> sessions_;    // in their order
  std::vector<int64_t> time_ns_;  // by instant of the trial
};

struct ChangePoint {
  int64_t time_ns = 0;  // of the timeline, before the first instant of the second part
  PoseStep before = PoseStep::Zero();
  PoseStep after = PoseStep::Zero();
  // Share of the camera's residuals (sum of norms, each at most 60 px) that two poses instead of
  // one take away, the target's poses as they are.
  double gain = 0;
};

struct Sample {
  int64_t time_ns;
  Eigen::Vector2d residual;  // predicted minus measured
  Eigen::Matrix<double, 2, 6> jacobian;
};

std::vector<Sample> SamplesOf(const TrialProblem& trial, const Timeline& timeline, int camera) {
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
    Sample sample = {timeline.TimeNs(i), *residual, {}};
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

// The time at which a camera's residuals are best explained by its having moved: two pose steps,
// each linear and by least absolute errors, over a scan of times. Outliers take part, a camera that
// has moved far being nothing but outliers. None with too few markers.
std::optional<ChangePoint> ScanForMove(const TrialProblem& trial, const Timeline& timeline,
                                       int camera) {
  const std::vector<Sample> samples = SamplesOf(trial, timeline, camera);
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
  for (const int64_t begin_ns : timeline.BeginsNs()) {
    const auto first = std::ranges::lower_bound(samples, begin_ns, {}, &Sample::time_ns);
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
  return best;
}

// Do two poses also fit what they were not fitted to? Each part is cut into blocks of time, every
// other one is held out of the fits, in turns. Errors that neighbouring times have in common can be
// fitted by a pose that a few seconds say little about: it does not fit the next few.
bool HoldsForOtherTimes(const std::vector<Sample>& samples, int64_t change_ns) {
  if (samples.empty()) return false;
  const int64_t begins_ns[] = {samples.front().time_ns, change_ns};
  const int64_t ends_ns[] = {change_ns, samples.back().time_ns + 1};
  const auto block_of = [&](const Sample& sample) {
    const int part = sample.time_ns < change_ns ? 0 : 1;
    const double share = static_cast<double>(sample.time_ns - begins_ns[part]) /
                         static_cast<double>(ends_ns[part] - begins_ns[part]);
    return part * kBlocksOfPart +
           std::min(kBlocksOfPart - 1, static_cast<int>(share * kBlocksOfPart));
  };
  std::vector<double> one_px(2 * kBlocksOfPart), two_px(2 * kBlocksOfPart);
  for (const int held_out : {0, 1}) {
    std::vector<Sample> all, of_part[2];
    for (const Sample& sample : samples) {
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
        std::vector<Sample> own;
        std::ranges::copy_if(samples, std::back_inserter(own),
                             [&](const Sample& sample) { return block_of(sample) == block; });
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

// Mean error with one pose, of the part before the change or after it: the larger.
double LargestErrorPx(const std::vector<Sample>& samples, int64_t change_ns) {
  double sums[2] = {0, 0}, counts[2] = {0, 0};
  for (const Sample& sample : samples) {
    const size_t part = sample.time_ns < change_ns ? 0 : 1;
    sums[part] += sample.residual.norm();
    ++counts[part];
  }
  return std::max(sums[0] / std::max(1.0, counts[0]), sums[1] / std::max(1.0, counts[1]));
}

struct Candidate {
  size_t camera = 0;  // of the trial
  ChangePoint change;
};

// The camera whose residuals gain most in all.
std::optional<Candidate> BestCandidate(const CauseInput& input, const Timeline& timeline) {
  std::optional<Candidate> best;
  for (size_t c = 0; c < input.trial.problem.cameras.size(); ++c) {
    // One that was taken apart already is not looked at again.
    if (std::ranges::count(input.trial.rig_camera, input.trial.rig_camera[c]) > 1) continue;
    const std::optional<ChangePoint> change =
        ScanForMove(input.trial, timeline, static_cast<int>(c));
    if (!change || change->gain < kMinScanGain) continue;
    if (!best || change->gain > best->change.gain) best = Candidate{c, *change};
  }
  return best;
}

RigidTransform Moved(const RigidTransform& pose, const PoseStep& step) {
  const Eigen::Vector3d turn = step.head<3>();
  const double angle = turn.norm();
  RigidTransform moved = pose;
  if (angle > 0) {
    moved.rotation = (Eigen::AngleAxisd(angle, turn / angle) * pose.rotation).normalized();
  }
  moved.translation_m += step.tail<3>();
  return moved;
}

// The camera's observations from the change on belong to a camera of their own.
TrialProblem TakenApart(const TrialProblem& from, const Timeline& timeline,
                        const Candidate& candidate) {
  TrialProblem trial = from;
  BundleProblem& problem = trial.problem;
  BundleCamera after = problem.cameras[candidate.camera];
  BundleCamera& before = problem.cameras[candidate.camera];
  after.cam_from_rig = Moved(after.cam_from_rig, candidate.change.after);
  if (before.pose_fixed) {
    // The rig frame is the camera as it was before.
    const RigidTransform fixed = before.cam_from_rig;
    after.cam_from_rig =
        after.cam_from_rig * Moved(fixed, candidate.change.before).Inverse() * fixed;
  } else {
    before.cam_from_rig = Moved(before.cam_from_rig, candidate.change.before);
  }
  after.pose_fixed = false;
  after.intrinsics_fixed = true;  // the lens is that of the other part
  const auto part = static_cast<int>(problem.cameras.size());
  problem.cameras.push_back(after);
  trial.rig_camera.push_back(from.rig_camera[candidate.camera]);
  for (size_t i = 0; i < problem.instants.size(); ++i) {
    if (timeline.TimeNs(i) < candidate.change.time_ns) continue;
    const BundleInstant& instant = problem.instants[i];
    for (BundleObservation& observation : problem.ObservationsOf(instant)) {
      if (observation.camera == static_cast<int>(candidate.camera)) observation.camera = part;
    }
  }
  ClassifyOutliers(&problem);
  return trial;
}

// Solves a camera taken apart: two poses of one lens. Where it is refined, in turns with the poses,
// by the part before the move.
absl::Status SolveParts(const BundleOptions& how, size_t camera, BundleProblem* problem) {
  const bool refined = !problem->cameras[camera].intrinsics_fixed;
  for (int round = 0; round < (refined ? kLensRounds : 1); ++round) {
    problem->cameras[camera].intrinsics_fixed = true;
    RIGCAL_RETURN_IF_ERROR(SolveTrial(how, problem));
    if (!refined) break;
    problem->cameras[camera].intrinsics_fixed = false;
    RIGCAL_RETURN_IF_ERROR(SolveTrial(how, problem));
    problem->cameras.back().intrinsics = problem->cameras[camera].intrinsics;
  }
  return SolveTrial(how, problem);
}

struct Move {
  double rotation_rad = 0;
  double centre_m = 0;
  double image_px = 0;  // root mean square of how far the image moved, where the wand was
  double sigmas = 0;
};

Move MeasureMove(const TrialProblem& trial, size_t camera) {
  const BundleProblem& problem = trial.problem;
  const BundleCamera& before = problem.cameras[camera];
  const BundleCamera& after = problem.cameras.back();
  Move move;
  move.rotation_rad = before.cam_from_rig.rotation.angularDistance(after.cam_from_rig.rotation);
  move.centre_m = (before.cam_from_rig.SourceFromTargetTranslation() -
                   after.cam_from_rig.SourceFromTargetTranslation())
                      .norm();
  BundleProblem as_before = problem;
  as_before.cameras.back().cam_from_rig = before.cam_from_rig;
  const ErrorChange change = CompareErrors(problem, as_before).back();
  move.image_px = std::max(0.0, -change.gain_px());
  // Both parts with the freedom of the one lens.
  BundleProblem shared = problem;
  BundleCamera& copy = shared.cameras.back();
  copy.intrinsics_fixed = before.intrinsics_fixed;
  copy.intrinsics_mean = before.intrinsics_mean;
  copy.intrinsics_sigma = before.intrinsics_sigma;
  const std::pair<int, int> parts = {static_cast<int>(camera),
                                     static_cast<int>(problem.cameras.size()) - 1};
  if (const auto sigmas = ComputeSigmas(trial.bundle, shared, parts); sigmas.ok()) {
    const Eigen::AngleAxisd turn(after.cam_from_rig.rotation *
                                 before.cam_from_rig.rotation.conjugate());
    PoseStep difference;
    difference << turn.angle() * turn.axis(),
        after.cam_from_rig.translation_m - before.cam_from_rig.translation_m;
    move.sigmas = sigmas->PoseDistance(parts.first, parts.second, difference);
  }
  return move;
}

Repair TakeApart(const CauseInput& input, const Candidate& candidate) {
  const Timeline timeline(input);
  Repair repair;
  repair.repaired = TakenApart(input.trial, timeline, candidate);
  if (!SolveParts(input.trial.bundle, candidate.camera, &repair.repaired.problem).ok()) {
    return repair;
  }
  const std::vector<Sample> samples =
      SamplesOf(input.trial, timeline, static_cast<int>(candidate.camera));
  const ErrorChange change =
      CompareErrors(input.trial.problem, repair.repaired.problem)[candidate.camera];
  const Move move = MeasureMove(repair.repaired, candidate.camera);
  if (change.gain() < kMinMoveGain || move.sigmas < kMoveSigmas || move.image_px < kMinMovePx) {
    return repair;
  }
  // A pose that little data hold runs away from where the camera is: an image that really moved so
  // far would not fit so well with one pose.
  if (move.image_px > kMaxMovePerError * LargestErrorPx(samples, candidate.change.time_ns)) {
    return repair;
  }
  const bool metric =
      !input.trial.problem.distance || input.evaluated.options.known_distance.has_value();
  const std::string distance =
      metric ? absl::StrFormat("%.1f mm and ", 1e3 * move.centre_m) : std::string();
  const double angle_deg = kDegreesPerRadian * move.rotation_rad;
  repair.causes.push_back(
      {{FindingKind::kCameraMoved, input.trial.problem.cameras[candidate.camera].name,
        move.image_px, "px",
        absl::StrFormat(
            "%s by %s%.3f deg, which moved its "
            "image by %.1f px; its error is %.2f px, and %.2f px with a pose of its own from then "
            "on. Fix its mount and record again, or calibrate what was recorded after it moved",
            timeline.Describe(candidate.change.time_ns), distance, angle_deg, move.image_px,
            change.before_px, change.after_px)},
       change.gain_px()});
  repair.on_other = [candidate](const CauseInput& other) { return TakeApart(other, candidate); };
  return repair;
}

}  // namespace

Repair RepairMovedCamera(const CauseInput& input) {
  const Timeline timeline(input);
  const std::optional<Candidate> candidate = BestCandidate(input, timeline);
  if (!candidate) return {};
  const std::vector<Sample> samples =
      SamplesOf(input.trial, timeline, static_cast<int>(candidate->camera));
  if (!HoldsForOtherTimes(samples, candidate->change.time_ns)) return {};
  return TakeApart(input, *candidate);
}

}  // namespace rigcal::server
