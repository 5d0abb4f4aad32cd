// SPDX-License-Identifier: Apache-2.0
#include "server/associate/clean_track.h"

#include <Eigen/LU>
#include <algorithm>
#include <map>
#include <numeric>
#include <tuple>
#include <utility>

#include "absl/strings/str_cat.h"

namespace rigcal::server {
namespace {

// Every value of a marker in one order, so that "equal" and "before" mean the same thing.
auto Key(const MarkerObservation& marker) {
  return std::make_tuple(marker.visible, marker.centre_px.x(), marker.centre_px.y(),
                         marker.covariance_px2(0, 0), marker.covariance_px2(0, 1),
                         marker.covariance_px2(1, 1), marker.time_delta_ns, marker.label_confidence,
                         marker.centre_kind);
}

// Why an observation is unusable; kUnspecified: it is usable.
RefusalReason Fault(const Observation& observation, int marker_count) {
  // A source that saw nothing may leave the markers out.
  if (!observation.markers.empty() &&
      observation.markers.size() != static_cast<size_t>(marker_count)) {
    return RefusalReason::kMarkerCountMismatch;
  }
  for (const MarkerObservation& marker : observation.markers) {
    if (!marker.visible) continue;
    if (!marker.centre_px.allFinite() || !marker.covariance_px2.allFinite()) {
      return RefusalReason::kValueNotFinite;
    }
    const double variance = marker.covariance_px2(0, 0);
    if (variance <= 0 || marker.covariance_px2.determinant() <= 0)
      return RefusalReason::kCovarianceNotPositive;
  }
  return RefusalReason::kUnspecified;
}

std::string Example(const CleanTrack& track, const Observation& observation) {
  // Not the session's id: the same observations in another session give the same calibration.
  return absl::StrCat("time ", observation.time_ns, " ns, clock epoch ", track.clock_epoch);
}

// True: in strictly ascending order, as cameras deliver them.
bool IsStrictlyAscending(const ObservationTable& rows) {
  for (size_t i = 1; i < rows.size(); ++i) {
    if (rows.time_ns(i) <= rows.time_ns(i - 1)) return false;
  }
  return true;
}

void RemoveDuplicates(CleanTrack* track, RefusalCounter* refused) {
  const ObservationTable& all = track->observations;
  if (IsStrictlyAscending(all)) return;
  std::vector<uint32_t> order(all.size());
  std::iota(order.begin(), order.end(), 0u);
  std::ranges::stable_sort(order, {}, [&all](uint32_t row) { return all.time_ns(row); });
  std::vector<uint32_t> kept;
  kept.reserve(order.size());
  for (size_t begin = 0; begin < order.size();) {
    size_t end = begin + 1;
    bool equal = true;
    const Observation first = all[order[begin]];
    while (end < order.size() && all.time_ns(order[end]) == first.time_ns) {
      equal = equal && SameValues(first, all[order[end]]);
      ++end;
    }
    refused->Add(track->camera.camera,
                 equal ? RefusalReason::kDuplicateEqual : RefusalReason::kDuplicateConflict,
                 end - begin - (equal ? 1 : 0), Example(*track, first));
    if (equal) kept.push_back(order[begin]);
    begin = end;
  }
  track->observations = all.Select(kept);
}

}  // namespace

bool SameValues(const Observation& a, const Observation& b) {
  return std::ranges::equal(a.markers, b.markers,
                            [](const MarkerObservation& left, const MarkerObservation& right) {
                              return (!left.visible && !right.visible) || Key(left) == Key(right);
                            });
}

std::vector<CleanTrack> CleanTracks(std::vector<CameraTrack>* tracks, int marker_count,
                                    RefusalCounter* refused) {
  return CleanTracks(
      tracks, [marker_count](const std::string&) { return marker_count; }, refused);
}

std::vector<CleanTrack> CleanTracks(std::vector<CameraTrack>* tracks,
                                    const MarkerCountOfSession& marker_count_of,
                                    RefusalCounter* refused) {
  std::map<std::tuple<std::string, std::string, uint32_t>, CleanTrack> by_key;
  // What is refused for its values is counted here and named after sorting, so that the example
  // does not depend on the order of arrival.
  std::map<std::pair<std::string, RefusalReason>, std::pair<uint32_t, std::string>> faults;
  for (CameraTrack& track : *tracks) {
    const int marker_count = marker_count_of(track.session_id);
    std::map<uint32_t, size_t> rows_of_epoch;
    for (const Observation& observation : track.observations) {
      ++rows_of_epoch[observation.clock_epoch];
    }
    for (const Observation& observation : track.observations) {
      CleanTrack& clean = by_key[{track.session_id, track.camera.camera, observation.clock_epoch}];
      clean.session_id = track.session_id;
      clean.camera = track.camera;
      clean.clock_epoch = observation.clock_epoch;
      const RefusalReason fault = Fault(observation, marker_count);
      if (fault == RefusalReason::kUnspecified) {
        if (clean.observations.empty()) {
          clean.observations.reserve(rows_of_epoch[observation.clock_epoch],
                                     static_cast<size_t>(marker_count));
        }
        clean.observations.push_back(observation);
        continue;
      }
      auto& [count, example] = faults[{track.camera.camera, fault}];
      const std::string words = Example(clean, observation);
      if (count == 0 || words < example) example = words;
      ++count;
    }
    track.observations = std::vector<Observation>();  // which frees them, as {} does not
  }
  for (const auto& [key, fault] : faults) {
    refused->Add(key.first, key.second, fault.first, fault.second);
  }
  std::vector<CleanTrack> clean_tracks;
  for (auto& [key, track] : by_key) {
    RemoveDuplicates(&track, refused);
    if (!track.observations.empty()) clean_tracks.push_back(std::move(track));
  }
  return clean_tracks;
}

}  // namespace rigcal::server
