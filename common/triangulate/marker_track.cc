// SPDX-License-Identifier: Apache-2.0
#include "common/triangulate/marker_track.h"

#include <algorithm>
#include <cmath>

#include "common/associate/outlier_centres.h"
#include "common/time/clock_course.h"

namespace rigcal {
namespace {

// As the solver does (server/solve/rig/image_motion.cc): rows so near take part in the fit, and a
// longer pause ends it.
constexpr double kFitWindowS = 0.045;
constexpr double kFitWindowPeriods = 2.5;
constexpr double kFitGapPeriods = 3.5;
constexpr double kDistinctPeriods = 0.1;
// A shift in which nothing moves by a thousandth of a pixel.
constexpr int64_t kNoShiftNs = 1000;

}  // namespace

int64_t RigTimeNs(const CalibratedCamera& camera, int64_t camera_time_ns) {
  const double camera_s = 1e-9 * static_cast<double>(camera_time_ns);
  const double correction_s = camera.time_offset_s +
                              1e-6 * camera.time_rate_ppm * (camera_s - camera.time_epoch_s) +
                              ClockCourseOffsetS(camera.clock_course, camera_time_ns);
  return camera_time_ns + std::llround(1e9 * correction_s);
}

int64_t LineDelayNs(const CalibratedCamera& camera, double y_px) {
  if (camera.line_delay_s == 0) return 0;
  const double middle_row = 0.5 * (camera.image_size_px.height - 1.0);
  return std::llround(1e9 * camera.line_delay_s * (y_px - middle_row));
}

MarkerTrack::MarkerTrack(const CalibratedCamera& camera, const std::vector<Observation>& rows,
                         size_t marker, double period_s)
    : rows_(&rows), marker_(marker), period_s_(period_s), sample_of_row_(rows.size(), -1) {
  std::vector<int64_t> times_ns;
  std::vector<Eigen::Vector2d> centres_px;
  for (size_t row = 0; row < rows.size(); ++row) {
    if (marker >= rows[row].markers.size() || !rows[row].markers[marker].visible) continue;
    const MarkerObservation& seen = rows[row].markers[marker];
    const int64_t time_ns = RigTimeNs(camera, rows[row].time_ns + seen.time_delta_ns) +
                            LineDelayNs(camera, seen.centre_px.y());
    sample_of_row_[row] = static_cast<int>(samples_.size());
    samples_.push_back({time_ns, static_cast<int>(row), false});
    times_ns.push_back(time_ns);
    centres_px.push_back(seen.centre_px);
  }
  const std::vector<bool> outlier =
      FindOutlierCentres(times_ns, centres_px, kFitGapPeriods * period_s_);
  for (size_t i = 0; i < samples_.size(); ++i) samples_[i].outlier = outlier[i];
}

std::optional<MovedCentre> MarkerTrack::At(int row, int64_t rig_time_ns,
                                           MotionWeightsMemory* memory) const {
  const int own_sample = sample_of_row_[static_cast<size_t>(row)];
  if (own_sample < 0) return std::nullopt;
  const auto own = static_cast<size_t>(own_sample);
  const MarkerObservation& seen = Marker(samples_[own]);
  MovedCentre moved{seen.centre_px, seen.covariance_px2, seen.centre_kind};
  const int64_t own_ns = samples_[own].time_ns;
  if (std::abs(rig_time_ns - own_ns) <= kNoShiftNs) return moved;
  if (samples_[own].outlier) return std::nullopt;

  // The neighbours that take part, ascending.
  const double window_s = std::max(kFitWindowS, kFitWindowPeriods * period_s_);
  const double gap_s = kFitGapPeriods * period_s_;
  const auto seconds = [](int64_t from_ns, int64_t to_ns) {
    return 1e-9 * static_cast<double>(to_ns - from_ns);
  };
  constexpr size_t kReach = static_cast<size_t>(kMaxMotionPoints) / 2;
  size_t first = own, last = own;
  while (first > 0 && own - first < kReach &&
         seconds(samples_[first - 1].time_ns, own_ns) <= window_s &&
         seconds(samples_[first - 1].time_ns, samples_[first].time_ns) <= gap_s) {
    --first;
  }
  while (last + 1 < samples_.size() && last - own < kReach &&
         seconds(own_ns, samples_[last + 1].time_ns) <= window_s &&
         seconds(samples_[last].time_ns, samples_[last + 1].time_ns) <= gap_s) {
    ++last;
  }
  std::vector<size_t> points;
  Eigen::Index before = 0, after = 0, own_index = 0;
  for (size_t i = first; i <= last; ++i) {
    if (samples_[i].outlier) continue;
    if (i == own) own_index = static_cast<Eigen::Index>(points.size());
    before += i < own ? 1 : 0;
    after += i > own ? 1 : 0;
    points.push_back(i);
  }
  PointWeights times(static_cast<Eigen::Index>(points.size()));
  for (size_t i = 0; i < points.size(); ++i) {
    times[static_cast<Eigen::Index>(i)] = seconds(own_ns, samples_[points[i]].time_ns);
  }
  const Eigen::Index distinct = CountDistinct(times, kDistinctPeriods * period_s_);
  if (distinct < 2) return std::nullopt;
  // High orders are for rows between neighbours; at an end they run away.
  const Eigen::Index max_degree = 2 + std::min<Eigen::Index>(2, std::min(before, after));
  const MotionWeights& weights = memory->Of(
      {times, std::min(distinct - 1, max_degree), seconds(own_ns, rig_time_ns), own_index});
  Eigen::Vector2d displacement = Eigen::Vector2d::Zero(), lower = Eigen::Vector2d::Zero();
  moved.covariance_px2.setZero();
  for (size_t i = 0; i < points.size(); ++i) {
    const auto at = static_cast<Eigen::Index>(i);
    const MarkerObservation& point = Marker(samples_[points[i]]);
    const Eigen::Vector2d value = point.centre_px - seen.centre_px;
    displacement += weights.displacement[at] * value;
    lower += weights.lower_displacement[at] * value;
    moved.covariance_px2 += weights.centre[at] * weights.centre[at] * point.covariance_px2;
  }
  moved.centre_px += displacement;
  const double left_out_px = 0.5 * (displacement - lower).norm();
  moved.covariance_px2 += left_out_px * left_out_px * Eigen::Matrix2d::Identity();
  return moved;
}

}  // namespace rigcal
