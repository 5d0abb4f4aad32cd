// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Core>
#include <cmath>

#include "tests/accuracy/detection/event_detection_experiment.h"

namespace rigcal::accuracy {

double WandLatencyUs(const std::vector<EventStreamResult>& results) {
  double delay = 0, speed_squares = 0;
  for (const EventStreamResult& result : results) {
    for (const EventCentre& centre : result.wands.centres) {
      delay -= centre.error_px.dot(centre.velocity_px_s);
      speed_squares += centre.velocity_px_s.squaredNorm();
    }
  }
  return speed_squares > 0 ? 1e6 * delay / speed_squares : 0;
}

EventCentreErrors CentreErrorsOf(const std::vector<EventStreamResult>& results,
                                 const EventCentreRange& range) {
  EventCentreErrors errors;
  double squares = 0;
  for (const EventStreamResult& result : results) {
    for (const EventCentre& centre : result.wands.centres) {
      const double speed = centre.velocity_px_s.norm();
      if (centre.radius_px < range.min_radius_px || centre.radius_px >= range.max_radius_px ||
          speed < range.min_px_s || speed >= range.max_px_s) {
        continue;
      }
      const Eigen::Vector2d along =
          speed > 0 ? Eigen::Vector2d(centre.velocity_px_s / speed) : Eigen::Vector2d::UnitX();
      const Eigen::Vector2d across(-along.y(), along.x());
      const Eigen::Vector2d& error = centre.error_px;
      const auto normalised = [&](const Eigen::Vector2d& axis) {
        return std::pow(error.dot(axis), 2) / axis.dot(centre.covariance_px2 * axis);
      };
      errors.nees_along += normalised(along);
      errors.nees_across += normalised(across);
      squares += error.squaredNorm();
      ++errors.centres;
    }
  }
  if (errors.centres == 0) return errors;
  errors.nees_along /= errors.centres;
  errors.nees_across /= errors.centres;
  errors.rms_px = std::sqrt(squares / (2 * errors.centres));
  return errors;
}

EventDetectionSummary Summarise(const std::vector<EventStreamResult>& results) {
  EventDetectionSummary summary;
  double delay = 0, speed_squares = 0, rendered_s = 0, wall_s = 0, events = 0;
  std::vector<const EventCentre*> centres;
  for (const EventStreamResult& result : results) {
    summary.failures += result.status.ok() ? 0 : 1;
    rendered_s += result.rendered_s;
    wall_s += result.render_wall_s;
    events += static_cast<double>(result.events);
    summary.detections += result.wands.detections;
    summary.wands_shown += result.wands.shown;
    summary.wands_found += result.wands.found;
    summary.false_wands += result.wands.false_wands;
    summary.ambiguous += result.wands.ambiguous;
    summary.spheres_shown += result.wands.spheres_shown;
    summary.spheres_found += result.wands.spheres_found;
    for (const EventOutput& output : result.outputs) {
      ++summary.outputs;
      summary.false_blobs += output.false_blobs;
      if (!output.shown) continue;
      ++summary.shown;
      summary.found += output.found ? 1 : 0;
      const auto markers = static_cast<int>(output.centres.size());
      summary.textbook_found += output.textbook_markers == markers ? 1 : 0;
      for (const EventCentre& centre : output.centres) {
        ++summary.markers;
        if (!centre.found) continue;
        ++summary.markers_found;
        centres.push_back(&centre);
        delay -= centre.error_px.dot(centre.velocity_px_s);
        speed_squares += centre.velocity_px_s.squaredNorm();
      }
    }
  }
  summary.mev_per_s = rendered_s > 0 ? 1e-6 * events / rendered_s : 0;
  summary.render_ratio = rendered_s > 0 ? wall_s / rendered_s : 0;
  summary.wands = CentreErrorsOf(results, {});
  summary.wand_latency_us = WandLatencyUs(results);
  if (centres.empty()) return summary;
  const double latency_s = speed_squares > 0 ? delay / speed_squares : 0;
  summary.latency_us = 1e6 * latency_s;
  double squares = 0, raw_squares = 0, along = 0;
  for (const EventCentre* centre : centres) {
    const Eigen::Vector2d error = centre->error_px + latency_s * centre->velocity_px_s;
    squares += error.squaredNorm();
    raw_squares += centre->error_px.squaredNorm();
    const double speed = centre->velocity_px_s.norm();
    if (speed < 450 || speed > 650) continue;
    along += error.dot(centre->velocity_px_s) / speed;
    ++summary.motion_centres;
  }
  const auto count = static_cast<double>(centres.size());
  summary.rms_px = std::sqrt(squares / (2 * count));
  summary.raw_rms_px = std::sqrt(raw_squares / (2 * count));
  if (summary.motion_centres > 0) summary.motion_bias_px = along / summary.motion_centres;
  return summary;
}

}  // namespace rigcal::accuracy
