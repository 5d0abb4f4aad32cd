// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/event/blink_wand_track.h"

#include <cmath>

#include "agent/detect/event/wrapped_time.h"

namespace rigcal::agent {
namespace {

constexpr double kForgetTrackUs = 70'000;
// Of a marker that is followed: errors of its centres, what a hand accelerates it by (20 m/s^2 at 2
// m with a focal length of 1000 px), and the velocity where that is not known.
constexpr double kTrackPx = 3, kTrackPxPerUs2 = 1e-8, kUnknownPxPerUs = 1e-3;
// Velocities from places that are nearer in time are noise.
constexpr double kLeastApartUs = 500;

}  // namespace

void BlinkWandTrack::ForgetBefore(double time_us) {
  if (!empty() && SinceUs(last_us_, time_us) > kForgetTrackUs) Forget();
}

BlinkWandTrack::Prediction BlinkWandTrack::Predict(size_t marker, double time_us) const {
  const Marker& from = markers_[marker];
  const double since_us = SinceUs(from.last.time_us, time_us);
  Prediction prediction{.centre_px = from.last.centre_px,
                        .gate_px = kTrackPx + 0.5 * kTrackPxPerUs2 * since_us * since_us,
                        .radius_px = from.last.radius_px,
                        .frequency = from.last.frequency};
  if (from.velocity_px_us) {
    prediction.centre_px += since_us * *from.velocity_px_us;
  } else {
    prediction.gate_px += kUnknownPxPerUs * std::abs(since_us);
  }
  return prediction;
}

void BlinkWandTrack::Add(const std::vector<Sighting>& sightings, double label_confidence) {
  if (sightings.size() != markers_.size()) {
    markers_.clear();
    for (const Sighting& sighting : sightings) {
      if (!sighting.seen) return markers_.clear();
      markers_.push_back({.last = sighting, .velocity_px_us = {}});
    }
    last_us_ = sightings.front().time_us;
    label_confidence_ = label_confidence;
    return;
  }
  // By which those seen are away from where they were expected.
  Eigen::Vector2d ahead_px = Eigen::Vector2d::Zero(), faster = Eigen::Vector2d::Zero();
  int seen = 0, timed = 0;
  for (size_t k = 0; k < sightings.size(); ++k) {
    if (!sightings[k].seen) continue;
    Marker& marker = markers_[k];
    const Eigen::Vector2d expected_px = Predict(k, sightings[k].time_us).centre_px;
    const double since_us = SinceUs(marker.last.time_us, sightings[k].time_us);
    ahead_px += sightings[k].centre_px - expected_px;
    ++seen;
    if (since_us > kLeastApartUs) {
      const Eigen::Vector2d velocity = (sightings[k].centre_px - marker.last.centre_px) / since_us;
      if (marker.velocity_px_us) faster += velocity - *marker.velocity_px_us, ++timed;
      marker.velocity_px_us = velocity;
      last_us_ = sightings[k].time_us;
    }
  }
  for (size_t k = 0; k < sightings.size(); ++k) {
    Marker& marker = markers_[k];
    if (sightings[k].seen) {
      marker.last = sightings[k];
      continue;
    }
    if (seen == 0) continue;
    marker.last.centre_px = Predict(k, last_us_).centre_px + ahead_px / seen;
    marker.last.time_us = last_us_;
    if (marker.velocity_px_us && timed > 0) *marker.velocity_px_us += faster / timed;
  }
  label_confidence_ = label_confidence;
}

}  // namespace rigcal::agent
