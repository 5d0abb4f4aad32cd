// SPDX-License-Identifier: Apache-2.0
#include "server/live/clock_relation.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "absl/numeric/int128.h"
#include "absl/strings/str_format.h"
#include "common/statistics/robust_statistics.h"

namespace rigcal::server {
namespace {

constexpr size_t kMaxPoints = 64;
constexpr size_t kMaxAlignments = 16;
constexpr size_t kFewestForSpread = 4;
constexpr double kDefaultSampleSigmaS = 1e-3;
// No clock that runs drifts by so much between two samples, which are seconds apart.
constexpr double kJumpS = 0.05;
constexpr double kJumpSigmas = 6;

// What a clock says may be anything.
int64_t Difference(int64_t a, int64_t b) {
  constexpr absl::int128 kMost = int64_t{1} << 61;
  return static_cast<int64_t>(std::clamp<absl::int128>(absl::int128(a) - b, -kMost, kMost));
}

double SecondsBetween(int64_t a_ns, int64_t b_ns) {
  return 1e-9 * (static_cast<double>(a_ns) - static_cast<double>(b_ns));
}

}  // namespace

void ClockRelation::NoteJump(const Point& before, const Point& now) {
  const double bound_s = kJumpS + kJumpSigmas * std::hypot(before.uncertainty_s, now.uncertainty_s);
  // A forward jump of the camera's clock makes the difference smaller.
  const double camera_s =
      SecondsBetween(before.monotonic_minus_device_ns, now.monotonic_minus_device_ns);
  const double wall_s = SecondsBetween(now.utc_minus_monotonic_ns, before.utc_minus_monotonic_ns);
  if (std::abs(camera_s) > bound_s) {
    jump_ = absl::StrFormat("the camera's clock jumped by %+.3f s against its PC", camera_s);
    points_.clear();
  } else if (std::abs(wall_s) > bound_s) {
    jump_ = absl::StrFormat("the clock of its PC was set by %+.3f s", wall_s);
    points_.clear();
    alignments_.clear();
  }
}

void ClockRelation::AddSample(uint32_t clock_epoch, const ClockSample& sample) {
  if (!sample.IsOfHost()) return;
  if (epoch_ != clock_epoch) {
    points_.clear();
    epoch_ = clock_epoch;
  }
  if (points_.empty()) first_host_ns_ = sample.host_monotonic_ns;
  Point point;
  point.host_s = 1e-9 * static_cast<double>(Difference(sample.host_monotonic_ns, first_host_ns_));
  point.utc_minus_device_ns = Difference(sample.host_utc_ns, sample.device_ns);
  point.monotonic_minus_device_ns = Difference(sample.host_monotonic_ns, sample.device_ns);
  point.utc_minus_monotonic_ns = Difference(sample.host_utc_ns, sample.host_monotonic_ns);
  point.uncertainty_s =
      sample.uncertainty_ns == 0 ? kDefaultSampleSigmaS : 1e-9 * sample.uncertainty_ns;
  if (!points_.empty()) {
    const Point before = points_.back();
    NoteJump(before, point);
    if (points_.empty()) {
      first_host_ns_ = sample.host_monotonic_ns;
      point.host_s = 0;
    }
  }
  points_.push_back(point);
  if (points_.size() > kMaxPoints) points_.pop_front();
}

void ClockRelation::AddAlignment(const HostAlignment& alignment) {
  alignments_.push_back(alignment);
  if (alignments_.size() > kMaxAlignments) alignments_.pop_front();
}

std::optional<int64_t> ClockRelation::OffsetNs() const {
  if (points_.empty()) return std::nullopt;
  std::vector<int64_t> differences;
  for (const Point& point : points_) differences.push_back(point.utc_minus_device_ns);
  int64_t offset_ns = LowerMedian(std::move(differences));
  if (!alignments_.empty()) {
    const uint32_t best =
        std::ranges::min(alignments_, {}, &HostAlignment::uncertainty_ns).uncertainty_ns;
    std::vector<int64_t> corrections;
    for (const HostAlignment& alignment : alignments_) {
      if (alignment.uncertainty_ns / 2 <= best) {
        corrections.push_back(alignment.server_minus_host_ns);
      }
    }
    const int64_t correction_ns = LowerMedian(std::move(corrections));
    offset_ns = Difference(offset_ns, Difference(0, correction_ns));
  }
  return offset_ns;
}

std::optional<double> ClockRelation::SpreadS() const {
  if (points_.size() < kFewestForSpread) return std::nullopt;
  // A line by least squares; clocks of cameras and PCs differ by some ppm.
  double mean_x = 0;
  double mean_y = 0;
  const auto y_of = [&](const Point& point) {
    return SecondsBetween(point.monotonic_minus_device_ns,
                          points_.front().monotonic_minus_device_ns);
  };
  const auto count = static_cast<double>(points_.size());
  for (const Point& point : points_) {
    mean_x += point.host_s / count;
    mean_y += y_of(point) / count;
  }
  double xx = 0;
  double xy = 0;
  for (const Point& point : points_) {
    xx += (point.host_s - mean_x) * (point.host_s - mean_x);
    xy += (point.host_s - mean_x) * (y_of(point) - mean_y);
  }
  const double slope = xx > 0 ? xy / xx : 0;
  double squares = 0;
  for (const Point& point : points_) {
    const double residual = y_of(point) - mean_y - slope * (point.host_s - mean_x);
    squares += residual * residual;
  }
  return std::sqrt(squares / (count - 2));
}

bool HaveCommonTimebase(const Session& session) {
  return !session.cameras.empty() &&
         std::ranges::all_of(session.cameras, [&](const SessionCamera& camera) {
           const Clock& clock = camera.description.clock;
           return !clock.timebase.empty() &&
                  clock.timebase == session.cameras.front().description.clock.timebase;
         });
}

}  // namespace rigcal::server
