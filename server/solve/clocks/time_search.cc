// SPDX-License-Identifier: Apache-2.0
#include "server/solve/clocks/time_search.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>
#include <utility>

#include "common/statistics/robust_statistics.h"
#include "common/status/status_macros.h"
#include "server/solve/clocks/clock_groups.h"
#include "server/solve/clocks/epipolar_score.h"
#include "server/solve/clocks/motion_period.h"
#include "server/solve/clocks/pair_scores.h"
#include "server/solve/clocks/ray_paths.h"

namespace rigcal::server {
namespace {

constexpr double kReachS = 1.0;  // largest offset between two clocks that is tried step by step
constexpr double kStepS = 0.01;  // the solve needs about 10 ms
// An offset is accepted when its score is below this share of the score of wrong offsets.
constexpr double kConvincingShare = 0.3;
constexpr double kConvincingPx = 4;  // and it must score better than this
constexpr double kAlignedPx = 1.2;   // a nearby offset with this score is accepted at once
constexpr int kTriesPerJoin = 3;
constexpr int kPartners = 3;  // of each clock, whose agreements are compared
constexpr size_t kDescents = 8;
constexpr double kTellingS = 0.1;  // so far off a score must be worse
constexpr double kTellingPx = 0.1;
// Recordings that overlap by less, of the shorter one, do not have clocks that agree nearly.
constexpr double kMinSpanShare = 0.3;
// A clock that was found by its motion is named from here on.
constexpr double kNamedOffS = 0.05;
// Of a motion that repeats itself, an offset by more of its period could as well be one the other
// way.
constexpr double kDecidedPeriods = 0.25;

struct FoundOffset {
  double score_px, offset_s;
};

// Two offsets of one pair that do not say the same, and how much better one of them must fit.
constexpr double kSameS = 0.3, kFarBetterShare = 0.5;

// How far offsets are searched.
enum class Reach { kNearby, kAnySecond };

// The offset of b against a, if one convinces.
std::optional<FoundOffset> FindOffset(const TrackPaths& a, const TrackPaths& b, Reach reach) {
  PairScores scores(a, b, static_cast<int>(kMinMatchShare * CountMatches(a, b, 0)));
  // A wand at rest looks the same at any offset.
  const auto is_distinct = [&scores](double offset_s) {
    return scores.At(offset_s) + kTellingPx <
           std::max(scores.At(offset_s - kTellingS), scores.At(offset_s + kTellingS));
  };
  // Of clocks that agree nearly, the lowest score is nearby. One point that moves smoothly has low
  // scores elsewhere, too, so that all are looked at.
  const bool one_point = a.markers.size() == 1;
  const double near_s = scores.Descend(0, 0, kReachS);
  double best = scores.At(near_s), best_s = near_s;
  if (best >= kAlignedPx || one_point) {
    if (reach == Reach::kNearby && !one_point) return std::nullopt;
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
      const double bottom_s = scores.Descend(all[i].second, 0, kReachS);
      if (!(scores.At(bottom_s) < best)) continue;
      best = scores.At(bottom_s);
      best_s = bottom_s;
    }
    const bool convinces =
        best < kConvincingPx && best < kConvincingShare * all[all.size() / 2].first;
    if (reach == Reach::kNearby ? best >= kAlignedPx : !convinces) return std::nullopt;
  }
  if (best_s != 0 && !is_distinct(best_s)) return std::nullopt;
  return FoundOffset{best, OffsetToApply(best_s, a, b)};
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

std::vector<TrackPaths> AllPaths(const RigObservations& rig,
                                 const std::vector<std::vector<int64_t>>& times_ns) {
  std::vector<TrackPaths> paths;
  for (size_t t = 0; t < rig.tracks.size(); ++t) {
    // Of tracks of one session only differences matter; an origin keeps the digits of UTC.
    size_t first = 0;
    while (rig.tracks[first].track.session_id != rig.tracks[t].track.session_id) ++first;
    paths.push_back(PathsOf(rig.tracks[t], times_ns[t], times_ns[first].front(),
                            rig.TargetOf(t).marker_count()));
  }
  return paths;
}

// The share of the shorter recording, by its stamps, in which the other one ran too.
double SpanShare(const std::vector<int64_t>& a_ns, const std::vector<int64_t>& b_ns) {
  const auto span_s = [](int64_t from_ns, int64_t to_ns) {
    return 1e-9 * (static_cast<double>(to_ns) - static_cast<double>(from_ns));
  };
  const double common_s =
      span_s(std::max(a_ns.front(), b_ns.front()), std::min(a_ns.back(), b_ns.back()));
  const double shorter_s =
      std::min(span_s(a_ns.front(), a_ns.back()), span_s(b_ns.front(), b_ns.back()));
  return shorter_s > 0 ? common_s / shorter_s : 1;
}

// The hooks of a part of the search.
TimeSearchHooks Part(const TimeSearchHooks& hooks, double from, double to) {
  TimeSearchHooks part = hooks;
  if (hooks.progress) {
    part.progress = [progress = hooks.progress, from, to](double fraction) {
      progress(from + (to - from) * fraction);
    };
  }
  return part;
}

// First some partners of each clock, whose best agreements are joined: a wrong valley that
// convinces one pair is never as low as the right one of another. Then whatever joins the rest.
absl::Status JoinPairs(const RigObservations& rig, const std::vector<TrackPaths>& paths,
                       const std::vector<ClockPair>& pairs, Reach reach,
                       const TimeSearchHooks& hooks, ClockGroups* groups) {
  const size_t clocks = groups->size();
  std::vector<int> tries(clocks * clocks, 0), partners(clocks, 0);
  std::vector<std::pair<ClockPair, FoundOffset>> found;
  std::vector<bool> searched(pairs.size(), false);
  double done = 0;
  for (const bool is_first : {true, false}) {
    for (size_t p = 0; p < pairs.size(); ++p) {
      const auto a = static_cast<size_t>(pairs[p].a), b = static_cast<size_t>(pairs[p].b);
      const int clock_a = rig.index.clock_of_track[a], clock_b = rig.index.clock_of_track[b];
      const auto k = static_cast<size_t>(clock_a), l = static_cast<size_t>(clock_b);
      if (searched[p] || groups->Joined(clock_a, clock_b)) continue;
      if (is_first && partners[k] >= kPartners && partners[l] >= kPartners) continue;
      if (++tries[k * clocks + l] > kTriesPerJoin) continue;
      if (hooks.cancelled != nullptr && hooks.cancelled->load()) {
        return absl::CancelledError("the calibration was cancelled");
      }
      searched[p] = true;
      const std::optional<FoundOffset> offset = FindOffset(paths[a], paths[b], reach);
      if (hooks.progress) hooks.progress(std::min(1.0, ++done / static_cast<double>(pairs.size())));
      if (!offset) continue;
      if (is_first) {
        ++partners[k], ++partners[l];
        found.emplace_back(pairs[p], *offset);
      } else {
        groups->Join(clock_a, clock_b, offset->offset_s);
      }
    }
    if (!is_first) break;
    std::ranges::stable_sort(found, {}, [](const auto& pair) { return pair.second.score_px; });
    for (const auto& [pair, offset] : found) {
      const int clock_a = rig.index.clock_of_track[static_cast<size_t>(pair.a)];
      const int clock_b = rig.index.clock_of_track[static_cast<size_t>(pair.b)];
      if (!groups->Joined(clock_a, clock_b)) groups->Join(clock_a, clock_b, offset.offset_s);
    }
  }
  return absl::OkStatus();
}

// The clock that the others of a track's session are measured against.
int ClockMeasuredAgainst(const RigObservations& rig, size_t track, int reference_camera) {
  size_t reference = track;
  for (size_t r = 0; r < rig.tracks.size(); ++r) {
    if (rig.tracks[r].track.session_id != rig.tracks[track].track.session_id) continue;
    if (rig.index.camera_of_track[r] == reference_camera) reference = r;
  }
  return rig.index.clock_of_track[reference];
}

// The period of the motion as the camera saw it that saw most of it; 0 for none.
double PeriodOfMotion(const std::vector<TrackPaths>& paths) {
  const auto seen = [](const TrackPaths& track) {
    size_t rows = 0;
    for (const RayPath& path : track.markers) rows += path.ray.size();
    return rows;
  };
  return FindMotionPeriod(*std::ranges::max_element(paths, {}, seen)).value_or(0);
}

// One point that moves smoothly fits a wrong offset nearby, too. Whether for any two clocks the
// offsets that their motion says fit far better than the ones nearby.
bool MotionContradicts(const RigObservations& rig, const std::vector<TrackPaths>& paths,
                       const std::vector<ClockPair>& pairs, const ClockGroups& nearby,
                       const ClockGroups& by_motion) {
  return std::ranges::any_of(pairs, [&](const ClockPair& pair) {
    const auto a = static_cast<size_t>(pair.a), b = static_cast<size_t>(pair.b);
    const int clock_a = rig.index.clock_of_track[a], clock_b = rig.index.clock_of_track[b];
    if (!nearby.Joined(clock_a, clock_b) || !by_motion.Joined(clock_a, clock_b)) return false;
    const double nearby_s = nearby.Between(clock_a, clock_b);
    const double motion_s = by_motion.Between(clock_a, clock_b);
    if (std::abs(nearby_s - motion_s) < kSameS) return false;
    PairScores scores(paths[a], paths[b], 0);
    return scores.At(motion_s) < kFarBetterShare * scores.At(nearby_s);
  });
}

// What is left of the groups if offsets of more than `most_s` do not count.
ClockGroups Within(double most_s, const ClockGroups& groups) {
  ClockGroups kept(groups.size());
  for (int b = 1; b < static_cast<int>(groups.size()); ++b) {
    for (int a = 0; a < b; ++a) {
      if (kept.Joined(a, b) || !groups.Joined(a, b)) continue;
      if (std::abs(groups.Between(a, b)) <= most_s) kept.Join(a, b, groups.Between(a, b));
    }
  }
  return kept;
}

// Clocks of one session that the light code of one wand relates (AlignedTrack::wand).
void JoinByLight(const RigObservations& rig, ClockGroups* groups) {
  for (size_t a = 0; a < rig.tracks.size(); ++a) {
    for (size_t b = a + 1; b < rig.tracks.size(); ++b) {
      const AlignedTrack &one = rig.tracks[a], &other = rig.tracks[b];
      const int clock_a = rig.index.clock_of_track[a], clock_b = rig.index.clock_of_track[b];
      if (one.wand != 0 && one.wand == other.wand &&
          one.track.session_id == other.track.session_id && !groups->Joined(clock_a, clock_b)) {
        groups->Join(clock_a, clock_b, 0);
      }
    }
  }
}

// Clocks of one session are not all joined.
bool AnyApart(const RigObservations& rig, const ClockGroups& groups) {
  for (size_t a = 0; a < rig.tracks.size(); ++a) {
    for (size_t b = a + 1; b < rig.tracks.size(); ++b) {
      if (rig.tracks[a].track.session_id == rig.tracks[b].track.session_id &&
          !groups.Joined(rig.index.clock_of_track[a], rig.index.clock_of_track[b])) {
        return true;
      }
    }
  }
  return false;
}

// The clocks that only their motion has joined with others, and how far each was off the median
// clock of its session.
std::vector<ClockByMotion> FoundByMotion(const RigObservations& rig,
                                         const std::vector<ClockCorrection>& clocks,
                                         const ClockGroups& before, const ClockGroups& after) {
  std::vector<ClockByMotion> found;
  for (const auto& [session, members] : ClocksBySession(clocks)) {
    const int first = static_cast<int>(members.front());
    std::vector<double> offsets_s;
    bool is_new = false;
    for (const size_t k : members) {
      const int clock = static_cast<int>(k);
      is_new = is_new || (after.Joined(first, clock) && !before.Joined(first, clock));
      if (after.Joined(first, clock)) offsets_s.push_back(after.Between(first, clock));
    }
    if (!is_new) continue;
    const double median_s = LowerMedian(offsets_s);
    for (size_t t = 0; t < rig.tracks.size(); ++t) {
      const int clock = rig.index.clock_of_track[t];
      const auto k = static_cast<size_t>(clock);
      if (std::ranges::find(members, k) == members.end() || !after.Joined(first, clock)) continue;
      const double offset_s = after.Between(first, clock) - median_s;
      if (std::abs(offset_s) >= kNamedOffS) found.push_back({static_cast<int>(t), offset_s});
    }
  }
  return found;
}

}  // namespace

absl::Status SearchTimeOffsets(const RigObservations& rig, int reference_camera,
                               const TimeSearchHooks& hooks, std::vector<ClockCorrection>* clocks,
                               TimeSearchOutcome* outcome) {
  const auto times_ns = RigTimes(rig.tracks, rig.index, *clocks);
  const std::vector<TrackPaths> paths = AllPaths(rig, times_ns);
  const std::vector<ClockPair> pairs = PairsOf(rig, paths);
  std::vector<ClockPair> nearby;
  std::ranges::copy_if(pairs, std::back_inserter(nearby), [&](const ClockPair& pair) {
    return SpanShare(times_ns[static_cast<size_t>(pair.a)],
                     times_ns[static_cast<size_t>(pair.b)]) >= kMinSpanShare;
  });
  ClockGroups groups(clocks->size());
  RIGCAL_RETURN_IF_ERROR(
      JoinPairs(rig, paths, nearby, Reach::kNearby, Part(hooks, 0, 0.2), &groups));
  TimeSearchOutcome found;
  bool stamps_mislead = false;
  ClockGroups by_light(clocks->size());
  JoinByLight(rig, &by_light);
  JoinByLight(rig, &groups);
  // What the wand says needs no search, and no motion decides against it.
  if (!hooks.only_nearby && AnyApart(rig, by_light)) {
    // Clocks of one session, one of which could be another period off.
    if (AnyApart(rig, ClockGroups(clocks->size()))) found.period_s = PeriodOfMotion(paths);
    if (found.period_s > 0) groups = Within(kDecidedPeriods * found.period_s, groups);
    ClockGroups before = groups;
    const bool one_point = std::ranges::all_of(
        paths, [](const TrackPaths& track) { return track.markers.size() == 1; });
    if (one_point && found.period_s == 0 && AnyApart(rig, ClockGroups(clocks->size()))) {
      ClockGroups by_motion(clocks->size());
      RIGCAL_ASSIGN_OR_RETURN(
          found.ambiguous,
          JoinByMotion(rig, paths, {Part(hooks, 0.2, 0.5).progress, hooks.cancelled}, &by_motion));
      if (MotionContradicts(rig, paths, pairs, groups, by_motion)) {
        stamps_mislead = true;
        groups = by_motion;
        before = ClockGroups(clocks->size());
      } else {
        found.ambiguous.clear();
      }
    }
    if (AnyApart(rig, groups) && !stamps_mislead) {
      RIGCAL_ASSIGN_OR_RETURN(
          found.ambiguous,
          JoinByMotion(rig, paths, {Part(hooks, 0.5, 0.8).progress, hooks.cancelled}, &groups));
    }
    found.by_motion = FoundByMotion(rig, *clocks, before, groups);
  }
  if (AnyApart(rig, groups) && found.ambiguous.empty() && found.period_s == 0 && !stamps_mislead) {
    RIGCAL_RETURN_IF_ERROR(
        JoinPairs(rig, paths, pairs, Reach::kAnySecond, Part(hooks, 0.8, 1), &groups));
  }
  for (size_t t = 0; t < rig.tracks.size(); ++t) {
    const int from = ClockMeasuredAgainst(rig, t, reference_camera);
    const int to = rig.index.clock_of_track[t];
    // Once for each clock: by its first track.
    bool first = true;
    for (size_t r = 0; r < t; ++r) first = first && rig.index.clock_of_track[r] != to;
    if (first && groups.Joined(from, to)) {
      (*clocks)[static_cast<size_t>(to)].time_offset_s += groups.Between(from, to);
    }
  }
  if (outcome != nullptr) *outcome = std::move(found);
  return absl::OkStatus();
}

}  // namespace rigcal::server
