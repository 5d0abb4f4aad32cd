// SPDX-License-Identifier: Apache-2.0
#include "server/solve/clocks/motion_evidence.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <utility>

#include "common/statistics/robust_statistics.h"
#include "server/solve/clocks/epipolar_score.h"
#include "server/solve/clocks/pair_scores.h"

namespace rigcal::server {
namespace {

constexpr size_t kPartnersAsked = 3;
constexpr double kOffReachS = 0.1;  // by which stamps may be off
constexpr double kFitsPx = 4;       // at the right time
constexpr double kRightShare = 0.5;
constexpr double kBetterThanElsewhere = 0.7;
constexpr double kMatchShare = 0.5;  // of the matches at the other time
// Farther from the session's first row a stamp is nothing but wrong.
constexpr int64_t kFarthestNs = 1'000'000'000'000'000;

bool IsUsable(const Observation& row, int64_t origin_ns, int marker_count) {
  int64_t since_ns = 0;
  if (row.markers.size() != static_cast<size_t>(marker_count) ||
      __builtin_sub_overflow(row.time_ns, origin_ns, &since_ns) ||
      std::abs(since_ns) > kFarthestNs) {
    return false;
  }
  return std::ranges::all_of(row.markers, [](const MarkerObservation& marker) {
    return !marker.visible || marker.centre_px.allFinite();
  });
}

TrackPaths PathsOfRows(const CameraDescription& camera, std::vector<const Observation*> rows,
                       int64_t origin_ns, int marker_count) {
  std::erase_if(rows,
                [&](const Observation* row) { return !IsUsable(*row, origin_ns, marker_count); });
  std::ranges::stable_sort(rows, {}, &Observation::time_ns);
  AlignedTrack track;
  track.track.camera = camera;
  track.track.observations.reserve(rows.size(), static_cast<size_t>(marker_count));
  std::vector<int64_t> times_ns;
  std::vector<double> steps_s;
  for (const Observation* row : rows) {
    track.track.observations.push_back(*row);
    if (!times_ns.empty() && row->time_ns > times_ns.back()) {
      steps_s.push_back(1e-9 * static_cast<double>(row->time_ns - times_ns.back()));
    }
    times_ns.push_back(row->time_ns);
  }
  if (!steps_s.empty()) track.period_s = UpperMedian(&steps_s);
  return PathsOf(track, times_ns, origin_ns, marker_count);
}

// What one other camera says.
std::optional<bool> Compare(const TrackPaths& own, const TrackPaths& other, double stay_s,
                            double moved_s) {
  // An offset of the other camera's clock is what these rows are moved by, the other way.
  const int matches =
      std::max(CountMatches(own, other, -stay_s), CountMatches(own, other, -moved_s));
  PairScores scores(own, other, static_cast<int>(kMatchShare * matches));
  const auto best_px = [&scores](double at_s) {
    return scores.At(scores.Descend(-at_s, -at_s, kOffReachS));
  };
  const double stay_px = best_px(stay_s), moved_px = best_px(moved_s);
  const double half_s = 0.5 * (moved_s - stay_s);
  double elsewhere_px = INFINITY;
  for (const double at_s : {stay_s + half_s, moved_s + half_s, stay_s - half_s}) {
    elsewhere_px = std::min(elsewhere_px, scores.At(-at_s));
  }
  const auto is_right = [elsewhere_px](double here_px, double there_px) {
    return here_px < kFitsPx && here_px < kRightShare * there_px &&
           here_px < kBetterThanElsewhere * elsewhere_px;
  };
  if (is_right(moved_px, stay_px)) return true;
  if (is_right(stay_px, moved_px)) return false;
  return std::nullopt;
}

}  // namespace

MotionEvidence::MotionEvidence(const std::vector<CameraTrack>& tracks, TargetOfSession target_of)
    : tracks_(tracks), target_of_(std::move(target_of)) {}

const MotionEvidence::Session& MotionEvidence::SessionOf(const std::string& session_id) {
  const auto [entry, is_new] = sessions_.try_emplace(session_id);
  Session& session = entry->second;
  if (!is_new || target_of_(session_id).IsStatic()) return session;
  std::map<std::string, std::vector<const Observation*>> rows;
  std::vector<int64_t> times_ns;
  for (const CameraTrack& track : tracks_) {
    if (track.session_id != session_id) continue;
    for (const Observation& row : track.observations) {
      rows[track.camera.camera].push_back(&row);
      times_ns.push_back(row.time_ns);
    }
  }
  if (times_ns.empty()) return session;
  session.origin_ns = LowerMedian(std::move(times_ns));
  for (const CameraTrack& track : tracks_) {
    const std::string& camera = track.camera.camera;
    if (track.session_id != session_id || session.paths.contains(camera)) continue;
    session.paths[camera] = PathsOfRows(track.camera, rows[camera], session.origin_ns,
                                        target_of_(session_id).marker_count());
  }
  return session;
}

std::optional<bool> MotionEvidence::operator()(const StepQuestion& question) {
  const Session& session = SessionOf(question.session_id);
  const auto track = std::ranges::find_if(tracks_, [&question](const CameraTrack& candidate) {
    return candidate.session_id == question.session_id &&
           candidate.camera.camera == question.camera;
  });
  if (track == tracks_.end() || session.paths.empty()) return std::nullopt;
  const TrackPaths own = PathsOfRows(track->camera, question.rows, session.origin_ns,
                                     target_of_(question.session_id).marker_count());
  const double stay_s = 1e-9 * static_cast<double>(question.stay_ns);
  const double moved_s = 1e-9 * static_cast<double>(question.moved_ns);
  std::vector<std::pair<int, const TrackPaths*>> partners;
  for (const auto& [camera, paths] : session.paths) {
    if (camera == question.camera) continue;
    const int matches = CountMatches(own, paths, -stay_s) + CountMatches(own, paths, -moved_s);
    if (matches >= kMinEpipolarMatches) partners.emplace_back(matches, &paths);
  }
  std::ranges::stable_sort(partners, std::greater(),
                           [](const auto& partner) { return partner.first; });
  partners.resize(std::min(partners.size(), kPartnersAsked));
  int votes = 0;
  for (const auto& [matches, paths] : partners) {
    if (const auto says = Compare(own, *paths, stay_s, moved_s)) votes += *says ? 1 : -1;
  }
  return votes == 0 ? std::nullopt : std::optional(votes > 0);
}

}  // namespace rigcal::server
