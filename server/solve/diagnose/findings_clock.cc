// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <set>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "common/statistics/robust_statistics.h"
#include "server/solve/diagnose/clock_reference.h"
#include "server/solve/diagnose/finding_causes.h"
#include "server/solve/diagnose/readable_time.h"

namespace rigcal::server {
namespace {

constexpr double kMinOffsetS = 1e-3;
constexpr double kClockSigmas = 5;
// Farther than this a view cannot be moved along its image velocity.
constexpr double kMaxExtrapolationS = 0.05;
// From so many cameras on, an offset is tried on so many observations, the other cameras held.
constexpr size_t kLargeRig = 10;
constexpr size_t kMaxOffsetObservations = 5000;

std::set<std::string> CamerasOfClock(const CauseInput& input, size_t clock) {
  std::set<std::string> cameras;
  for (size_t t = 0; t < input.rig.tracks.size(); ++t) {
    if (input.rig.index.clock_of_track[t] != static_cast<int>(clock)) continue;
    cameras.insert(input.rig.tracks[t].track.camera.camera);
  }
  return cameras;
}

struct ClockOffset {
  double offset_s = 0;  // on top of the coarse alignment, against the session's reference
  double sigma_s = 0;   // of the estimate and of the alignment
  std::string against;  // for people
  bool is_reference = false;
};

std::string DescribeReference(const CauseInput& input, const ClockReference& reference,
                              const std::vector<size_t>& clocks) {
  if (clocks.size() == 2) return "the other clock (of two, either may be the one that is off)";
  if (reference.members.empty()) return "the median clock";
  if (!reference.is_either) {
    return absl::StrFormat("the %d clocks that agree", reference.members.size());
  }
  std::set<std::string> cameras;
  for (const size_t i : reference.members) cameras.merge(CamerasOfClock(input, clocks[i]));
  return absl::StrCat("the clocks of ", absl::StrJoin(cameras, ", "),
                      " (as many agree with each other elsewhere: either may be off)");
}

// None where no sigma can be computed.
std::vector<ClockOffset> Offsets(const CauseInput& input, const BundleProblem& problem) {
  const RigSolution& solution = input.evaluated.solution;
  std::vector<ClockOffset> offsets(solution.clocks.size());
  // A clock that is held fixed is as good as the others make it; without a sigma none is known.
  std::vector<double> estimate_sigma_s(offsets.size(), 0);
  bool known = false;
  if (const auto sigmas = ComputeSigmas(input.trial.bundle, problem); sigmas.ok()) {
    known = true;
    for (size_t k = 0; k < offsets.size(); ++k) {
      const double sigma_s =
          sigmas->Of({ReducedParameterKind::kTimeOffset, static_cast<int>(k), 0});
      if (std::isfinite(sigma_s)) estimate_sigma_s[k] = sigma_s;
    }
  }
  if (!known) return {};
  for (const auto& [session, clocks] : ClocksBySession(solution.clocks)) {
    std::vector<double> values, sigmas;
    for (const size_t k : clocks) {
      values.push_back(solution.clocks[k].time_offset_s + problem.clocks[k].time_offset_s);
      sigmas.push_back(estimate_sigma_s[k]);
    }
    const double sigma_s = Median(sigmas);
    ClockReference reference =
        ReferenceOfClocks(values, std::max(kMinOffsetS, kClockSigmas * sigma_s));
    // Of two that disagree the first is taken for right.
    if (clocks.size() == 2 && reference.members.empty()) reference.offset_s = values.front();
    const std::string against = DescribeReference(input, reference, clocks);
    for (size_t i = 0; i < clocks.size(); ++i) {
      const bool is_member = std::ranges::count(reference.members, i) > 0;
      offsets[clocks[i]] = {values[i] - reference.offset_s, std::max(sigmas[i], sigma_s), against,
                            is_member};
    }
  }
  for (size_t t = 0; t < input.rig.tracks.size(); ++t) {
    ClockOffset& offset = offsets[static_cast<size_t>(input.rig.index.clock_of_track[t])];
    offset.sigma_s = std::hypot(offset.sigma_s, input.rig.tracks[t].offset_sigma_s);
  }
  return offsets;
}

// Leaves of a large rig's problem what tells how a clock's cameras fit: these cameras against the
// others, in some of the instants that they share. One camera does not move a large rig.
void Restrict(size_t clock, BundleProblem* problem) {
  if (problem->cameras.size() < kLargeRig) return;
  const auto is_of_clock = [clock](const BundleObservation& observation) {
    return observation.clock == static_cast<int>(clock);
  };
  std::vector<bool> own(problem->cameras.size(), false);
  for (BundleInstant& instant : problem->instants) {
    const auto members = problem->ObservationsOf(instant);
    instant.used = instant.used && std::ranges::any_of(members, is_of_clock);
    if (!instant.used) continue;
    for (const BundleObservation& observation : members) {
      if (is_of_clock(observation)) own[static_cast<size_t>(observation.camera)] = true;
    }
  }
  UseSome(kMaxOffsetObservations, problem);
  problem->target.fixed = true;
  for (size_t c = 0; c < own.size(); ++c) {
    if (own[c]) continue;
    problem->cameras[c].pose_fixed = true;
    problem->cameras[c].intrinsics_fixed = true;
  }
}

// The errors if the clock ran with those that it is compared with.
ErrorChange WithoutOffset(const CauseInput& input, const BundleProblem& corrected, size_t clock,
                          double offset_s, const std::string& camera) {
  ErrorChange change;
  if (std::abs(offset_s) > kMaxExtrapolationS) return change;
  BundleProblem without = corrected;
  for (BundleClock& entry : without.clocks) entry.offset_fixed = true;
  without.clocks[clock].time_offset_s -= offset_s;
  Restrict(clock, &without);
  if (!SolveTrial(input.trial.bundle, &without).ok()) return change;
  const std::vector<ErrorChange> changes = CompareErrors(without, corrected);
  for (size_t c = 0; c < changes.size(); ++c) {
    if (corrected.cameras[c].name == camera) change = changes[c];
  }
  return change;
}

std::string Advice(const std::set<std::string>& cameras, const ClockOffset& offset,
                   const ErrorChange& change, bool corrected) {
  std::string advice =
      absl::StrFormat("its rows show the wand %s %s than their stamps say (+-%.2f ms), against %s",
                      FormatTime(offset.offset_s), offset.offset_s < 0 ? "earlier" : "later",
                      1e3 * offset.sigma_s, offset.against);
  if (cameras.size() > 1) {
    absl::StrAppend(&advice, "; so do all on its clock: ", absl::StrJoin(cameras, ", "));
  }
  if (change.before_px > 0) {
    absl::StrAppendFormat(&advice,
                          "; its error is %.2f px without this correction, %.2f px with it",
                          change.before_px, change.after_px);
  }
  absl::StrAppend(&advice,
                  corrected ? "; the calibration has taken it out. "
                            : "; times were kept as given: calibrate with time offsets refined. ",
                  "Check its trigger, its exposure time and what its stamps mean, or use the "
                  "offset with its data");
  return advice;
}

// The clocks that are off in a problem whose times were estimated. `corrected`: by the solve, and
// not by a trial after it.
std::vector<Cause> CausesOf(const CauseInput& input, const BundleProblem& problem, bool corrected) {
  const std::vector<ClockOffset> offsets = Offsets(input, problem);
  std::vector<Cause> causes;
  if (offsets.empty()) return causes;
  for (const auto& [session, clocks] : ClocksBySession(input.evaluated.solution.clocks)) {
    for (const size_t k : clocks) {
      if (std::ranges::count(input.trial.uneven_clocks, static_cast<int>(k)) > 0) continue;
      const ClockOffset& offset = offsets[k];
      if (offset.is_reference) continue;
      if (std::abs(offset.offset_s) <= std::max(kMinOffsetS, kClockSigmas * offset.sigma_s))
        continue;
      const std::set<std::string> cameras = CamerasOfClock(input, k);
      if (cameras.empty()) continue;
      const ErrorChange change =
          WithoutOffset(input, problem, k, offset.offset_s, *cameras.begin());
      const ReadableTime readable = ReadableTimeOf(offset.offset_s);
      causes.push_back({{FindingKind::kClockOffset, *cameras.begin(), readable.value, readable.unit,
                         Advice(cameras, offset, change, corrected)},
                        std::max(0.0, change.gain_px())});
    }
  }
  return causes;
}

}  // namespace

std::vector<Cause> FindClockOffsets(const CauseInput& input) {
  if (!input.evaluated.options.estimate_time_offsets) return {};
  return CausesOf(input, input.trial.problem, true);
}

Repair RepairClocks(const CauseInput& input) {
  Repair repair;
  if (input.evaluated.options.estimate_time_offsets) return repair;
  repair.repaired = input.trial;
  BundleProblem& problem = repair.repaired.problem;
  for (const auto& [session, clocks] : ClocksBySession(input.evaluated.solution.clocks)) {
    for (const size_t k : clocks) {
      problem.clocks[k].offset_fixed = k == clocks.front();
      problem.clocks[k].offset_sigma_s = 0;
    }
  }
  if (SolveTrialFromAfar(input.trial.bundle, &problem).ok()) {
    repair.causes = CausesOf(input, problem, false);
  }
  return repair;
}

}  // namespace rigcal::server
