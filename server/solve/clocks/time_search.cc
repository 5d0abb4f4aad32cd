// SPDX-License-Identifier: Apache-2.0
#include "server/solve/clocks/time_search.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <optional>
#include <utility>

#include "server/solve/clocks/epipolar_score.h"
#include "server/solve/clocks/ray_paths.h"

namespace rigcal::server {
namespace {

constexpr double kUnmatched = std::numeric_limits<double>::infinity();
constexpr double kReachS = 1.0;       // largest offset between two clocks
constexpr double kStepS = 0.01;       // first steps; the solve needs about 10 ms
constexpr double kFineStepS = 0.001;  // around the best of them
// An offset is accepted when its score is below this share of the score of wrong offsets.
constexpr double kConvincingShare = 0.3;
constexpr double kConvincingPx = 4;  // and it must score better than this
constexpr double kAlignedPx = 1.2;   // a nearby offset with this score is accepted at once
constexpr double kMinMatchShare = 0.6;
constexpr int kTriesPerJoin = 3;
constexpr int kPartners = 3;  // of each clock, whose agreements are compared
constexpr size_t kDescents = 8;
constexpr double kTellingS = 0.1;  // so far off a score must be worse
constexpr double kTellingPx = 0.1;
// Clocks that agree to this share of a period are left as they are: half the width of an instant.
constexpr double kLeftAlonePeriods = 0.125;

// Scores of a pair by offset, kept because searches overlap.
class PairScores {
 public:
  // A matrix with eight degrees of freedom fits few matches at any offset.
  PairScores(const TrackPaths& a, const TrackPaths& b)
      : a_(a),
        b_(b),
        min_matches_(std::max(kMinEpipolarMatches,
                              static_cast<int>(kMinMatchShare * CountMatches(a, b, 0)))) {}

  double At(double offset_s) {
    const auto [entry, inserted] = known_.try_emplace(std::llround(offset_s * 1e6), kUnmatched);
    if (inserted) entry->second = EpipolarScorePx(a_, b_, offset_s, min_matches_);
    return entry->second;
  }

  // Downhill from an offset by a step, then by ever smaller ones.
  double Descend(double offset_s) {
    for (double step_s = kStepS; step_s >= kFineStepS; step_s *= 0.5) {
      for (const double direction_s : {step_s, -step_s}) {
        while (std::abs(offset_s + direction_s) <= kReachS &&
               At(offset_s + direction_s) < At(offset_s)) {
          offset_s += direction_s;
        }
      }
    }
    return offset_s;
  }

 private:
  const TrackPaths& a_;
  const TrackPaths& b_;
  const int min_matches_;
  std::map<int64_t, double> known_;  // by microseconds
};

struct FoundOffset {
  double score_px, offset_s;
};

// The offset of b against a, if one convinces.
std::optional<FoundOffset> FindOffset(const TrackPaths& a, const TrackPaths& b) {
  PairScores scores(a, b);
  // A wand at rest looks the same at any offset.
  const auto is_distinct = [&scores](double offset_s) {
    return scores.At(offset_s) + kTellingPx <
           std::max(scores.At(offset_s - kTellingS), scores.At(offset_s + kTellingS));
  };
  // Of clocks that agree nearly, the lowest score is nearby.
  const double near_s = scores.Descend(0);
  double best = scores.At(near_s), best_s = near_s;
  if (best >= kAlignedPx) {
    std::vector<std::pair<double, double>> all;
    const int steps = static_cast<int>(kReachS / kStepS);
    for (int i = -steps; i <= steps; ++i) {
      const double value = scores.At(i * kStepS);
      if (std::isfinite(value)) all.emplace_back(value, i * kStepS);
    }
    if (all.empty()) return std::nullopt;
    std::ranges::sort(all);
    // At its first steps a narrow valley may look worse than a wide wrong one.
    for (size_t i = 0; i < std::min<size_t>(all.size(), kDescents); ++i) {
      const double bottom_s = scores.Descend(all[i].second);
      if (!(scores.At(bottom_s) < best)) continue;
      best = scores.At(bottom_s);
      best_s = bottom_s;
    }
    const bool convinces =
        best < kConvincingPx && best < kConvincingShare * all[all.size() / 2].first;
    if (!convinces) return std::nullopt;
  }
  if (best_s != 0 && !is_distinct(best_s)) return std::nullopt;
  const bool leave = std::abs(best_s) <= kLeftAlonePeriods * std::min(a.period_s, b.period_s);
  return FoundOffset{best, leave ? 0 : best_s};
}

// Two tracks on different clocks, and how much they have seen at the same time.
struct ClockPair {
  int weight;
  int a, b;
};

std::vector<ClockPair> PairsOf(const RigObservations& rig, const std::vector<TrackPaths>& paths) {
  std::vector<ClockPair> pairs;
  for (size_t a = 0; a < paths.size(); ++a) {
    for (size_t b = a + 1; b < paths.size(); ++b) {
      if (rig.tracks[a].track.session_id != rig.tracks[b].track.session_id ||
          rig.index.clock_of_track[a] == rig.index.clock_of_track[b]) {
        continue;
      }
      const int weight = CountMatches(paths[a], paths[b], 0);
      if (weight > 0) pairs.push_back({weight, static_cast<int>(a), static_cast<int>(b)});
    }
  }
  std::ranges::stable_sort(pairs, std::greater(), &ClockPair::weight);
  return pairs;
}

// Offsets of clocks within groups that are known to each other.
class ClockGroups {
 public:
  explicit ClockGroups(size_t clocks) : group_(clocks), offset_s_(clocks, 0) {
    std::iota(group_.begin(), group_.end(), 0);
  }
  bool Joined(int a, int b) const { return group_[Index(a)] == group_[Index(b)]; }
  // Rows of clock b are `offset_s` later than those of a, on top of what is known.
  void Join(int a, int b, double offset_s) {
    const int from = group_[Index(b)], to = group_[Index(a)];
    const double shift_s = offset_s_[Index(a)] + offset_s - offset_s_[Index(b)];
    for (size_t k = 0; k < group_.size(); ++k) {
      if (group_[k] != from) continue;
      group_[k] = to;
      offset_s_[k] += shift_s;
    }
  }
  double Between(int a, int b) const { return offset_s_[Index(b)] - offset_s_[Index(a)]; }

 private:
  static size_t Index(int clock) { return static_cast<size_t>(clock); }
  std::vector<int> group_;
  std::vector<double> offset_s_;
};

std::vector<TrackPaths> AllPaths(const RigObservations& rig,
                                 const std::vector<std::vector<int64_t>>& times_ns) {
  std::vector<TrackPaths> paths;
  for (size_t t = 0; t < rig.tracks.size(); ++t) {
    // Of tracks of one session only differences matter; an origin keeps the digits of UTC.
    size_t first = 0;
    while (rig.tracks[first].track.session_id != rig.tracks[t].track.session_id) ++first;
    paths.push_back(
        PathsOf(rig.tracks[t], times_ns[t], times_ns[first].front(), rig.target.marker_count()));
  }
  return paths;
}

}  // namespace

absl::Status SearchTimeOffsets(const RigObservations& rig, int reference_camera,
                               const TimeSearchHooks& hooks, std::vector<ClockCorrection>* clocks) {
  const std::vector<TrackPaths> paths = AllPaths(rig, RigTimes(rig.tracks, rig.index, *clocks));
  const std::vector<ClockPair> pairs = PairsOf(rig, paths);
  ClockGroups groups(clocks->size());
  std::vector<int> tries(clocks->size() * clocks->size(), 0), partners(clocks->size(), 0);
  std::vector<std::pair<ClockPair, FoundOffset>> found;
  std::vector<bool> searched(pairs.size(), false);
  double done = 0;
  // First some partners of each clock, whose best agreements are joined: a wrong valley that
  // convinces one pair is never as low as the right one of another. Then whatever joins the rest.
  for (const bool is_first : {true, false}) {
    for (size_t p = 0; p < pairs.size(); ++p) {
      const auto a = static_cast<size_t>(pairs[p].a), b = static_cast<size_t>(pairs[p].b);
      const int clock_a = rig.index.clock_of_track[a], clock_b = rig.index.clock_of_track[b];
      const auto k = static_cast<size_t>(clock_a), l = static_cast<size_t>(clock_b);
      if (searched[p] || groups.Joined(clock_a, clock_b)) continue;
      if (is_first && partners[k] >= kPartners && partners[l] >= kPartners) continue;
      if (++tries[k * clocks->size() + l] > kTriesPerJoin) continue;
      if (hooks.cancelled != nullptr && hooks.cancelled->load()) {
        return absl::CancelledError("the calibration was cancelled");
      }
      searched[p] = true;
      const std::optional<FoundOffset> offset = FindOffset(paths[a], paths[b]);
      if (hooks.progress) hooks.progress(std::min(1.0, ++done / static_cast<double>(pairs.size())));
      if (!offset) continue;
      if (is_first) {
        ++partners[k], ++partners[l];
        found.emplace_back(pairs[p], *offset);
      } else {
        groups.Join(clock_a, clock_b, offset->offset_s);
      }
    }
    if (!is_first) break;
    std::ranges::stable_sort(found, {}, [](const auto& pair) { return pair.second.score_px; });
    for (const auto& [pair, offset] : found) {
      const int clock_a = rig.index.clock_of_track[static_cast<size_t>(pair.a)];
      const int clock_b = rig.index.clock_of_track[static_cast<size_t>(pair.b)];
      if (!groups.Joined(clock_a, clock_b)) groups.Join(clock_a, clock_b, offset.offset_s);
    }
  }
  for (size_t t = 0; t < rig.tracks.size(); ++t) {
    // The clock the others of its session are measured against.
    size_t reference = t;
    for (size_t r = 0; r < rig.tracks.size(); ++r) {
      if (rig.tracks[r].track.session_id != rig.tracks[t].track.session_id) continue;
      if (rig.index.camera_of_track[r] == reference_camera) reference = r;
    }
    const int from = rig.index.clock_of_track[reference], to = rig.index.clock_of_track[t];
    // Once for each clock: by its first track.
    bool first = true;
    for (size_t r = 0; r < t; ++r) first = first && rig.index.clock_of_track[r] != to;
    if (first && groups.Joined(from, to)) {
      (*clocks)[static_cast<size_t>(to)].time_offset_s += groups.Between(from, to);
    }
  }
  return absl::OkStatus();
}

}  // namespace rigcal::server
