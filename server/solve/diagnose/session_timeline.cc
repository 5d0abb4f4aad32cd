// SPDX-License-Identifier: Apache-2.0
#include "server/solve/diagnose/session_timeline.h"

#include <algorithm>
#include <cstdlib>
#include <map>

#include "absl/strings/str_format.h"

namespace rigcal::server {
namespace {

constexpr int64_t kBetweenSessionsNs = 1'000'000'000;

}  // namespace

SessionTimeline::SessionTimeline(const TrialProblem& trial,
                                 const std::vector<ClockCorrection>& clocks) {
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

std::vector<int64_t> SessionTimeline::BeginsNs() const {
  std::vector<int64_t> begins;
  for (size_t s = 1; s < sessions_.size(); ++s) begins.push_back(sessions_[s].begin_ns);
  return begins;
}

int64_t SessionTimeline::Snapped(int64_t change_ns) const {
  for (const int64_t begin_ns : BeginsNs()) {
    if (std::abs(change_ns - begin_ns) < kBetweenSessionsNs) return begin_ns;
  }
  return change_ns;
}

std::string SessionTimeline::Describe(int64_t change_ns) const {
  size_t s = 0;
  while (s + 1 < sessions_.size() && sessions_[s + 1].begin_ns <= change_ns) ++s;
  const Part& part = sessions_[s];
  if (s > 0 && change_ns == part.begin_ns) {
    return absl::StrFormat("between session %s and session %s,", sessions_[s - 1].session,
                           part.session);
  }
  const double time_s = 1e-9 * static_cast<double>(change_ns - part.begin_ns);
  return sessions_.size() == 1 ? absl::StrFormat("%.1f s after the first wand view", time_s)
                               : absl::StrFormat("%.1f s after the first wand view of session %s",
                                                 time_s, part.session);
}

bool SessionTimeline::Overlap() const {
  for (const Part& a : sessions_) {
    for (const Part& b : sessions_) {
      if (&a != &b && a.span.first_ns <= b.span.last_ns && b.span.first_ns <= a.span.last_ns) {
        return true;
      }
    }
  }
  return false;
}

}  // namespace rigcal::server
