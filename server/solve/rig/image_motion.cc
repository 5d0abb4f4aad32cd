// SPDX-License-Identifier: Apache-2.0
#include "server/solve/rig/image_motion.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/statistics/robust_statistics.h"

namespace rigcal::server {
namespace {

constexpr double kWindowS = 0.045;
constexpr double kWindowPeriods = 2.5;
constexpr double kMaxGapPeriods = 3.5;  // a longer pause ends the neighbourhood
// Markers with times of their own can come closer than rows; points nearer than this determine no
// further term.
constexpr double kMinApartPeriods = 0.1;

}  // namespace

ImageMotion::ImageMotion(const AlignedTrack& track, int marker_count, std::vector<bool> flipped)
    : rows_(&track.track.observations),
      marker_count_(static_cast<size_t>(marker_count)),
      period_s_(track.period_s),
      middle_row_(MiddleRow(track.track.camera)),
      flipped_(std::move(flipped)),
      excluded_(rows_->size() * marker_count_, false) {
  std::vector<double> speeds;
  for (size_t label = 0; label < marker_count_; ++label) {
    std::vector<int64_t> times_ns;
    std::vector<size_t> places;
    std::vector<Eigen::Vector2d> centres_px;
    for (size_t row = 0; row < rows_->size(); ++row) {
      const auto sample = SampleAt(row, label);
      if (!sample) continue;
      times_ns.push_back(sample->time_ns);
      places.push_back(Place(row, label));
      centres_px.push_back(rows_->centre_px(row, sample->column));
    }
    const std::vector<bool> is_outlier =
        FindOutlierCentres(times_ns, centres_px, kMaxGapPeriods * period_s_);
    for (size_t i = 0; i < places.size(); ++i) excluded_[places[i]] = is_outlier[i];
    for (size_t i = 1; i < places.size(); ++i) {
      const double step_s = 1e-9 * static_cast<double>(times_ns[i] - times_ns[i - 1]);
      if (step_s <= 0 || step_s > kMaxGapPeriods * period_s_) continue;
      speeds.push_back((centres_px[i] - centres_px[i - 1]).norm() / step_s);
    }
  }
  if (!speeds.empty()) typical_speed_px_s_ = UpperMedian(&speeds);
}

std::optional<ImageMotion::Sample> ImageMotion::SampleAt(size_t row, size_t label) const {
  const size_t count = rows_->MarkerCount(row);
  if (label >= count) return std::nullopt;
  const size_t column = IsFlipped(static_cast<int>(row)) ? count - 1 - label : label;
  if (!rows_->IsVisible(row, column)) return std::nullopt;
  return Sample{row, column, TimeNs(row, column)};
}

int64_t ImageMotion::TimeNs(size_t row, size_t column) const {
  const int64_t time_ns = rows_->time_ns(row) + rows_->time_delta_ns(row, column);
  if (line_delay_s_ == 0) return time_ns;
  return time_ns +
         std::llround(1e9 * line_delay_s_ * (rows_->centre_px(row, column).y() - middle_row_));
}

int64_t ImageMotion::MeanDelayNs(size_t row) const {
  if (line_delay_s_ == 0) return 0;
  double rows_late = 0;
  int count = 0;
  for (size_t column = 0; column < rows_->MarkerCount(row); ++column) {
    if (!rows_->IsVisible(row, column)) continue;
    rows_late += rows_->centre_px(row, column).y() - middle_row_;
    ++count;
  }
  return count == 0 ? 0 : std::llround(1e9 * line_delay_s_ * rows_late / count);
}

std::optional<ImageMotion::Sample> ImageMotion::Next(size_t row, size_t label, int step) const {
  // Where rows end, the number wraps past the last one.
  for (row += static_cast<size_t>(step); row < rows_->size(); row += static_cast<size_t>(step)) {
    if (const auto sample = SampleAt(row, label)) return sample;
  }
  return std::nullopt;
}

void ImageMotion::Exclude(int observation, int marker) {
  const auto row = static_cast<size_t>(observation), label = static_cast<size_t>(marker);
  if (SampleAt(row, label)) excluded_[Place(row, label)] = true;
}

ImageMotion::Neighbourhood ImageMotion::Around(const Sample& own, size_t label) const {
  const double window_s = std::max(kWindowS, kWindowPeriods * period_s_);
  const double gap_s = kMaxGapPeriods * period_s_;
  const auto seconds = [](const Sample& a, const Sample& b) {
    return 1e-9 * static_cast<double>(b.time_ns - a.time_ns);
  };
  constexpr size_t kReach = static_cast<size_t>(kMaxMotionPoints) / 2;
  Neighbourhood around;
  // Those before, the nearest first, are turned round below.
  around.own = 0;
  for (Sample last = own; around.own < kReach; ++around.own) {
    const auto next = Next(last.row, label, -1);
    if (!next || seconds(*next, own) > window_s || seconds(*next, last) > gap_s) break;
    around.samples[around.own] = last = *next;
  }
  std::reverse(around.samples.begin(),
               around.samples.begin() + static_cast<std::ptrdiff_t>(around.own));
  around.samples[around.own] = own;
  around.count = around.own + 1;
  for (Sample last = own; around.count - around.own <= kReach; ++around.count) {
    const auto next = Next(last.row, label, 1);
    if (!next || seconds(own, *next) > window_s || seconds(last, *next) > gap_s) break;
    around.samples[around.count] = last = *next;
  }
  return around;
}

MarkerMotion ImageMotion::At(int observation, int marker, double shift_s,
                             MotionWeightsMemory* memory) const {
  const auto label = static_cast<size_t>(marker);
  const Sample own = *SampleAt(static_cast<size_t>(observation), label);
  const Eigen::Vector2d own_px = rows_->centre_px(own.row, own.column);
  const Eigen::Matrix2d own_covariance_px2 = rows_->covariance_px2(own.row, own.column);
  const Neighbourhood around = Around(own, label);
  std::array<const Sample*, kMaxMotionPoints> points;
  size_t point_count = 0;
  Eigen::Index before = 0, after = 0, own_index = -1;
  for (size_t i = 0; i < around.count; ++i) {
    const Sample& sample = around.samples[i];
    // An outlying row moves with its neighbours, and stays an outlier.
    if (excluded_[Place(sample.row, label)]) continue;
    if (i == around.own) own_index = static_cast<Eigen::Index>(point_count);
    before += i < around.own ? 1 : 0;
    after += i > around.own ? 1 : 0;
    points[point_count++] = &sample;
  }
  MarkerMotion motion;
  motion.centre_px = own_px;
  motion.covariance_px2 = own_covariance_px2;
  const auto count = static_cast<Eigen::Index>(point_count);
  PointWeights times(count);
  for (Eigen::Index i = 0; i < count; ++i) {
    times[i] = 1e-9 * static_cast<double>(points[static_cast<size_t>(i)]->time_ns - own.time_ns);
  }
  const Eigen::Index distinct = CountDistinct(times, kMinApartPeriods * period_s_);
  if (distinct < 2) {
    const double drift_px = typical_speed_px_s_ * shift_s;
    motion.covariance_px2 += drift_px * drift_px * Eigen::Matrix2d::Identity();
    return motion;
  }
  // High orders are for rows between neighbours; at an end they run away.
  const Eigen::Index max_degree = 2 + std::min<Eigen::Index>(2, std::min(before, after));
  const Eigen::Index degree = std::min(distinct - 1, max_degree);
  const MotionQuery query = {times, degree, shift_s, own_index};
  MotionWeightsMemory own_memory;
  const MotionWeights& weights = (memory != nullptr ? memory : &own_memory)->Of(query);
  Eigen::Vector2d lower = Eigen::Vector2d::Zero(), displacement = Eigen::Vector2d::Zero();
  Eigen::Matrix2d own_noise = Eigen::Matrix2d::Zero();
  for (Eigen::Index i = 0; i < count; ++i) {
    const Sample& point = *points[static_cast<size_t>(i)];
    // Differences to the own row: the weights sum to zero, and small numbers keep their digits.
    const Eigen::Vector2d value = rows_->centre_px(point.row, point.column) - own_px;
    displacement += weights.displacement[i] * value;
    motion.velocity_px_s += weights.velocity[i] * value;
    lower += weights.lower_displacement[i] * value;
    own_noise +=
        weights.centre[i] * weights.centre[i] * rows_->covariance_px2(point.row, point.column);
  }
  if (own_index < 0) own_noise += own_covariance_px2;
  motion.centre_px += displacement;
  const double share = own_noise.trace() / motion.covariance_px2.trace();
  motion.covariance_px2 *= std::max(1.0, share);
  motion.noise_share = std::min(1.0, share);
  const double left_out_px = 0.5 * (displacement - lower).norm();
  motion.covariance_px2 += left_out_px * left_out_px * Eigen::Matrix2d::Identity();
  return motion;
}

}  // namespace rigcal::server
