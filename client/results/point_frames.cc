// SPDX-License-Identifier: Apache-2.0
#include "client/results/point_frames.h"

#include <algorithm>
#include <cmath>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/statistics/robust_statistics.h"

namespace rigcal::client {
namespace {

constexpr double kMostBesideFrame = 0.25;  // periods
constexpr double kMostPlaces = 1e8;        // frames times markers

absl::Status NoFrames(const std::string& why) {
  return absl::FailedPreconditionError(
      absl::StrCat("frames of TRC and C3D follow each other at one rate, and ", why,
                   "; write CSV or Parquet, which have a time for each point"));
}

// Ascending.
std::vector<int64_t> InstantsOf(const Triangulation& triangulation) {
  std::vector<int64_t> times_ns;
  for (const TriangulatedPoint& point : triangulation.points) {
    times_ns.push_back(point.rig_time_ns);
  }
  std::ranges::sort(times_ns);
  times_ns.erase(std::ranges::unique(times_ns).begin(), times_ns.end());
  return times_ns;
}

// How many periods are between the first and the last, with those of missing instants.
double PeriodsOf(const std::vector<int64_t>& times_ns) {
  std::vector<int64_t> steps_ns;
  for (size_t i = 1; i < times_ns.size(); ++i) {
    steps_ns.push_back(times_ns[i] - times_ns[i - 1]);
  }
  const std::vector<int64_t> steps = steps_ns;
  const auto period_ns = static_cast<double>(UpperMedian(&steps_ns));
  double periods = 0;
  for (const int64_t step_ns : steps) {
    periods += std::max(1.0, std::round(static_cast<double>(step_ns) / period_ns));
  }
  return periods;
}

}  // namespace

absl::StatusOr<PointFrames> FramesOf(const Triangulation& triangulation,
                                     const std::vector<std::string>& labels) {
  const std::vector<int64_t> times_ns = InstantsOf(triangulation);
  if (times_ns.size() < 2) {
    return NoFrames(absl::StrCat("of ", times_ns.size(), " instants there is none"));
  }
  const double periods = PeriodsOf(times_ns);
  if ((periods + 1) * static_cast<double>(labels.size()) > kMostPlaces) {
    return NoFrames(absl::StrCat("there is a pause of ", periods, " periods"));
  }
  PointFrames frames;
  frames.labels = labels;
  frames.first_ns = times_ns.front();
  frames.rate_hz = 1e9 * periods / static_cast<double>(times_ns.back() - times_ns.front());
  frames.frame_count = static_cast<size_t>(periods) + 1;
  frames.points.resize(frames.frame_count * labels.size());
  for (const TriangulatedPoint& point : triangulation.points) {
    const double place =
        1e-9 * static_cast<double>(point.rig_time_ns - frames.first_ns) * frames.rate_hz;
    const double frame = std::round(place);
    if (!(std::abs(place - frame) < kMostBesideFrame)) {
      return NoFrames(absl::StrFormat(
          "these instants do not: one is %.0f %% of a period of %.4g ms beside its frame",
          100 * std::abs(place - frame), 1e3 / frames.rate_hz));
    }
    const TriangulatedPoint*& kept =
        frames
            .points[static_cast<size_t>(frame) * labels.size() + static_cast<size_t>(point.marker)];
    if (kept != nullptr) {
      return NoFrames(absl::StrFormat("these instants do not: two are within one period of %.4g ms",
                                      1e3 / frames.rate_hz));
    }
    kept = &point;
  }
  return frames;
}

}  // namespace rigcal::client
