// SPDX-License-Identifier: Apache-2.0
#include "server/associate/unseen_markers.h"

#include <cstddef>
#include <map>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"

namespace rigcal::server {
namespace {

constexpr size_t kFewestAtOrigin = 20;

struct MarkerCounts {
  size_t visible = 0, at_origin = 0;
};

bool IsAtOrigin(const MarkerObservation& marker) {
  return marker.visible && marker.centre_px == Eigen::Vector2d::Zero();
}

}  // namespace

std::vector<StampFault> HideMarkersAtOrigin(std::vector<CameraTrack>* tracks) {
  std::map<std::pair<std::string, std::string>, MarkerCounts> cameras;
  for (const CameraTrack& track : *tracks) {
    MarkerCounts& counts = cameras[{track.session_id, track.camera.camera}];
    for (const Observation& row : track.observations) {
      for (const MarkerObservation& marker : row.markers) {
        counts.visible += marker.visible ? 1 : 0;
        counts.at_origin += IsAtOrigin(marker) ? 1 : 0;
      }
    }
  }
  for (CameraTrack& track : *tracks) {
    if (cameras[{track.session_id, track.camera.camera}].at_origin < kFewestAtOrigin) continue;
    for (Observation& row : track.observations) {
      for (MarkerObservation& marker : row.markers) marker.visible &= !IsAtOrigin(marker);
    }
  }
  std::vector<StampFault> faults;
  for (const auto& [key, counts] : cameras) {
    if (counts.at_origin < kFewestAtOrigin) continue;
    faults.push_back({StampFault::Kind::kAtOrigin, key.first, key.second,
                      static_cast<double>(counts.at_origin),
                      absl::StrCat(counts.at_origin, " of its ", counts.visible,
                                   " markers are at (0, 0), exactly, and were taken as not seen: "
                                   "write -1 for a marker that was not seen")});
  }
  return faults;
}

}  // namespace rigcal::server
