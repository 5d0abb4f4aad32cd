// SPDX-License-Identifier: Apache-2.0
#include "server/solve/clocks/start_search.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <utility>

#include "absl/status/statusor.h"
#include "common/statistics/robust_statistics.h"
#include "server/solve/clocks/pair_scores.h"

namespace rigcal::server {
namespace {

constexpr double kFinestGridS = 0.02;
constexpr int kMotionPartners = 2;  // of each clock, that agree
constexpr int kMotionTries = 12;    // of each clock
constexpr double kAgreeS = 0.03;    // two ways to one offset
// Offsets of candidates are less certain; so many of them must agree, and outnumber any others.
constexpr double kCandidatesAgreeS = 0.1;
constexpr int kMinAgreeing = 2;

// Two tracks and the clocks they are on.
struct TrackPair {
  int track_a, track_b;
  int clock_a, clock_b;
};

struct FoundPair {
  TrackPair pair;
  MotionPeak peak;
};

// For each clock that is not joined with all others of its session, its track with most rows.
// By session, then clock.
std::vector<std::vector<int>> TracksBySession(const RigObservations& rig) {
  std::vector<std::vector<int>> sessions;
  std::vector<std::string> names;
  for (size_t t = 0; t < rig.tracks.size(); ++t) {
    const std::string& name = rig.tracks[t].track.session_id;
    size_t s = 0;
    while (s < names.size() && names[s] != name) ++s;
    if (s == names.size()) {
      names.push_back(name);
      sessions.emplace_back();
    }
    const auto same_clock = [&](int other) {
      return rig.index.clock_of_track[static_cast<size_t>(other)] == rig.index.clock_of_track[t];
    };
    const auto known = std::ranges::find_if(sessions[s], same_clock);
    if (known == sessions[s].end()) {
      sessions[s].push_back(static_cast<int>(t));
    } else if (rig.tracks[t].track.observations.size() >
               rig.tracks[static_cast<size_t>(*known)].track.observations.size()) {
      *known = static_cast<int>(t);
    }
  }
  return sessions;
}

// Of tracks whose clocks are not known to each other. By distance in the list, so that each track
// comes soon.
std::vector<TrackPair> PairsApart(const RigObservations& rig, const ClockGroups& groups) {
  std::vector<TrackPair> pairs;
  for (const std::vector<int>& tracks : TracksBySession(rig)) {
    for (size_t step = 1; step < tracks.size(); ++step) {
      for (size_t i = 0; i + step < tracks.size(); ++i) {
        const int a = tracks[i], b = tracks[i + step];
        const int clock_a = rig.index.clock_of_track[static_cast<size_t>(a)];
        const int clock_b = rig.index.clock_of_track[static_cast<size_t>(b)];
        if (!groups.Joined(clock_a, clock_b)) pairs.push_back({a, b, clock_a, clock_b});
      }
    }
  }
  return pairs;
}

// Spectra of the tracks that are asked for, made once.
class Spectra {
 public:
  explicit Spectra(const std::vector<TrackPaths>& paths) : paths_(paths), spectra_(paths.size()) {}
  // For the longest of all tracks that may be compared. False if that is too long.
  bool Prepare(const std::vector<TrackPair>& pairs) {
    double longest_s = 0;
    for (const TrackPair& pair : pairs) {
      for (const int track : {pair.track_a, pair.track_b}) {
        longest_s = std::max(longest_s, SpanS(paths_[static_cast<size_t>(track)]));
      }
    }
    const std::optional<double> step_s = GridStepS(longest_s, kFinestGridS);
    if (!step_s) return false;
    step_s_ = *step_s;
    fft_size_ = FftSizeFor(2 * (static_cast<int>(longest_s / step_s_) + 1));
    return true;
  }
  const MotionSpectrum& Of(int track) {
    auto& spectrum = spectra_[static_cast<size_t>(track)];
    if (!spectrum) {
      spectrum = SpectrumOf(paths_[static_cast<size_t>(track)], step_s_, fft_size_);
    }
    return *spectrum;
  }

 private:
  const std::vector<TrackPaths>& paths_;
  std::vector<std::optional<MotionSpectrum>> spectra_;
  double step_s_ = 0;
  int fft_size_ = 0;
};

// Joins along the pairs but one (-1: all), the best first.
ClockGroups JoinWithout(const std::vector<FoundPair>& found, int without, ClockGroups groups) {
  for (size_t i = 0; i < found.size(); ++i) {
    const TrackPair& pair = found[i].pair;
    if (static_cast<int>(i) == without || groups.Joined(pair.clock_a, pair.clock_b)) continue;
    groups.Join(pair.clock_a, pair.clock_b, found[i].peak.offset_s);
  }
  return groups;
}

// How many pairs the joined clocks agree with, and how many clocks are joined at all.
std::pair<int, int> Agreement(const std::vector<FoundPair>& found, const ClockGroups& groups) {
  int joined = 0, agreeing = 0;
  for (const FoundPair& entry : found) {
    const TrackPair& pair = entry.pair;
    if (!groups.Joined(pair.clock_a, pair.clock_b)) continue;
    ++joined;
    const double between_s = groups.Between(pair.clock_a, pair.clock_b);
    agreeing += std::abs(between_s - entry.peak.offset_s) < kAgreeS ? 1 : 0;
  }
  return {joined, agreeing};
}

// Joins clocks that no pair says clearly, where the candidates of several pairs agree. True if any.
bool JoinByCandidates(const std::vector<FoundPair>& candidates, ClockGroups* groups) {
  struct Proposal {
    int agreeing = 0, others = 0;
    int clock_a = 0, clock_b = 0;
    double offset_s = 0;
  };
  Proposal best;
  const auto shift_of = [&](const FoundPair& entry, int base_a, int base_b) {
    return groups->Between(base_a, entry.pair.clock_a) + entry.peak.offset_s +
           groups->Between(entry.pair.clock_b, base_b);
  };
  for (const FoundPair& entry : candidates) {
    const int a = entry.pair.clock_a, b = entry.pair.clock_b;
    if (groups->Joined(a, b)) continue;
    std::vector<double> agreeing_s;
    int others = 0;
    for (const FoundPair& other : candidates) {
      const int c = other.pair.clock_a, d = other.pair.clock_b;
      double offset_s = 0;
      if (groups->Joined(a, c) && groups->Joined(b, d)) {
        offset_s = shift_of(other, a, b);
      } else if (groups->Joined(a, d) && groups->Joined(b, c)) {
        offset_s = -shift_of(other, b, a);
      } else {
        continue;
      }
      if (std::abs(offset_s - entry.peak.offset_s) < kCandidatesAgreeS) {
        agreeing_s.push_back(offset_s);
      } else {
        ++others;
      }
    }
    const auto agreeing = static_cast<int>(agreeing_s.size());
    if (agreeing < kMinAgreeing || agreeing <= others || agreeing <= best.agreeing) continue;
    best = {agreeing, others, a, b, Median(agreeing_s)};
  }
  if (best.agreeing == 0) return false;
  groups->Join(best.clock_a, best.clock_b, best.offset_s);
  return true;
}

}  // namespace

absl::StatusOr<std::vector<AmbiguousMotion>> JoinByMotion(const RigObservations& rig,
                                                          const std::vector<TrackPaths>& paths,
                                                          const StartSearchHooks& hooks,
                                                          ClockGroups* groups) {
  const std::vector<TrackPair> pairs = PairsApart(rig, *groups);
  Spectra spectra(paths);
  if (!spectra.Prepare(pairs)) return std::vector<AmbiguousMotion>();
  std::vector<FoundPair> found, candidates;
  std::vector<AmbiguousMotion> ambiguous;
  std::vector<int> partners(rig.tracks.size(), 0), tries(rig.tracks.size(), 0);
  double done = 0;
  for (const TrackPair& pair : pairs) {
    const auto a = static_cast<size_t>(pair.track_a), b = static_cast<size_t>(pair.track_b);
    if (hooks.progress) hooks.progress(done++ / static_cast<double>(pairs.size()));
    if (partners[a] >= kMotionPartners && partners[b] >= kMotionPartners) continue;
    if (tries[a] >= kMotionTries && tries[b] >= kMotionTries) continue;
    if (hooks.cancelled != nullptr && hooks.cancelled->load()) {
      return absl::CancelledError("the calibration was cancelled");
    }
    ++tries[a], ++tries[b];
    const MotionMatch match =
        MatchMotion(paths[a], paths[b], spectra.Of(pair.track_a), spectra.Of(pair.track_b));
    if (match.verdict == MotionVerdict::kFound || match.verdict == MotionVerdict::kCandidate) {
      MotionPeak peak = match.peaks.front();
      peak.offset_s = OffsetToApply(peak.offset_s, paths[a], paths[b]);
      candidates.push_back({pair, peak});
      if (match.verdict == MotionVerdict::kCandidate) continue;
      ++partners[a], ++partners[b];
      found.push_back({pair, peak});
    } else if (match.verdict == MotionVerdict::kAmbiguous) {
      ambiguous.push_back({pair.track_a, pair.track_b, match.peaks});
    }
  }
  std::ranges::stable_sort(found, {}, [](const FoundPair& entry) { return entry.peak.score_px; });
  ClockGroups best = JoinWithout(found, -1, *groups);
  for (int without = 0; without < static_cast<int>(found.size()); ++without) {
    const ClockGroups other = JoinWithout(found, without, *groups);
    if (Agreement(found, other) > Agreement(found, best)) best = other;
  }
  while (JoinByCandidates(candidates, &best)) {
  }
  *groups = best;
  std::erase_if(ambiguous, [&](const AmbiguousMotion& pair) {
    return groups->Joined(rig.index.clock_of_track[static_cast<size_t>(pair.track_a)],
                          rig.index.clock_of_track[static_cast<size_t>(pair.track_b)]);
  });
  return ambiguous;
}

}  // namespace rigcal::server
