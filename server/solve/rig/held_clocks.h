// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <vector>

#include "server/associate/align_clocks.h"
#include "server/solve/bundle/bundle_problem.h"
#include "server/solve/rig/problem_builder.h"

namespace rigcal::server {

// Some session has so many clocks that others than the references are held on the way.
bool HasManyClocks(const std::vector<ClockCorrection>& clocks);

// The clock of each session that keeps its correction, because time has no origin: the reference
// camera's or else the first. While many clocks are on their way, another one may be held. Image
// velocities are noisy, so that a round moves a clock by less than it is off, and many clocks away
// from the one that is held by far less: where that one is off, they would hardly ever reach it.
class HeldClocks {
 public:
  HeldClocks(const std::vector<AlignedTrack>& tracks, const RigIndex& index,
             const std::vector<ClockCorrection>& clocks, int reference_camera);

  bool IsReference(size_t clock) const;
  bool IsHeld(size_t clock) const;
  // The references may be free.
  bool HoldsOthers() const { return !held_.empty(); }

  // Decides which clocks the next adjustment holds: the references, or where `others`, in a session
  // of many clocks, the one that the last adjustment moved by the median. True: not those of the
  // last one.
  bool Choose(const BundleProblem& problem, bool others);

  // Moves all other clocks so that a held one stays where it is among them. What all others are
  // moved by alike is the noise of their image velocities, which is that of their centres: it would
  // move the held one, too.
  void LetFollow(BundleProblem* problem) const;

  // What the references' clocks were moved by, since `before`, goes to the others.
  void KeepReferences(const std::vector<ClockCorrection>& before,
                      std::vector<ClockCorrection>* clocks) const;

 private:
  using BySession = std::map<std::string, int>;

  std::vector<std::string> session_of_clock_;
  std::map<std::string, std::vector<size_t>> clocks_;
  BySession reference_;
  BySession held_;  // instead of the references; empty: those
};

// How far the bundle adjustment moved the clock that moved most, over its rows; and how far that
// moved a marker in its cameras' images.
struct ClockMovement {
  double s = 0;
  double px = 0;
};
ClockMovement FindClockMovement(const BundleProblem& problem);

}  // namespace rigcal::server
