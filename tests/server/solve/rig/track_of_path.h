// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <functional>

#include "server/associate/align_clocks.h"

namespace rigcal::server {

// A track with one marker per row, at path(t) for t = 0, period_s, ...; one sigma of `sigma_px`.
inline AlignedTrack TrackOfPath(const std::function<Eigen::Vector2d(double)>& path, int rows,
                                double period_s, double sigma_px) {
  AlignedTrack track;
  track.period_s = period_s;
  for (int i = 0; i < rows; ++i) {
    Observation row;
    row.time_ns = std::llround(1e9 * i * period_s);
    MarkerObservation marker;
    marker.visible = true;
    marker.centre_px = path(i * period_s);
    marker.covariance_px2 = sigma_px * sigma_px * Eigen::Matrix2d::Identity();
    row.markers.push_back(marker);
    track.track.observations.push_back(row);
  }
  return track;
}

}  // namespace rigcal::server
