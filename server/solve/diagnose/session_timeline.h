// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "server/solve/diagnose/trial_solve.h"
#include "server/solve/rig/problem_builder.h"

namespace rigcal::server {

// The instants of all sessions of a trial in one order of time: each session behind the one before,
// whatever its clocks show, which may have been started anew in between. Sessions follow each other
// by time where none overlap, else by name. Times are nanoseconds from the first instant.
class SessionTimeline {
 public:
  // `clocks` of the trial's problem, by index: they say which session an instant is of.
  SessionTimeline(const TrialProblem& trial, const std::vector<ClockCorrection>& clocks);

  int64_t TimeNs(size_t instant) const { return time_ns_[instant]; }
  // Where sessions after the first begin.
  std::vector<int64_t> BeginsNs() const;
  // A change as near to the begin of a session as it can be told is a change between sessions.
  int64_t Snapped(int64_t change_ns) const;
  // "12.0 s after the first wand view".
  std::string Describe(int64_t change_ns) const;

 private:
  struct Span {
    int64_t first_ns = 0, last_ns = 0;
  };
  struct Part {
    std::string session;
    Span span;
    int64_t begin_ns = 0;
  };

  bool Overlap() const;

  std::vector<Part> sessions_;    // in their order
  std::vector<int64_t> time_ns_;  // by instant of the trial
};

}  // namespace rigcal::server
