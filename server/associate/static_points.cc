// SPDX-License-Identifier: Apache-2.0
#include "server/associate/static_points.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <optional>
#include <span>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/statistics/robust_statistics.h"
#include "server/associate/clean_track.h"

namespace rigcal::server {
namespace {

// A row's centre farther than this from the median is an outlier.
constexpr double kOutlierSigmas = 6, kOutlierPx = 0.5;
constexpr int64_t kMinStepNs = 1'000'000'000;

// The time of the other sessions.
struct TimeSpan {
  int64_t from_ns = 0, length_ns = 0;
};

TimeSpan SpanOf(const std::vector<AlignedTrack>& tracks) {
  std::optional<int64_t> from_ns, to_ns;
  for (const AlignedTrack& track : tracks) {
    const ObservationTable& rows = track.track.observations;
    const int64_t first_ns = track.CoarseRigTimeNs(rows.time_ns(0));
    const int64_t last_ns = track.CoarseRigTimeNs(rows.time_ns(rows.size() - 1));
    from_ns = std::min(from_ns.value_or(first_ns), first_ns);
    to_ns = std::max(to_ns.value_or(last_ns), last_ns);
  }
  return from_ns ? TimeSpan{*from_ns, *to_ns - *from_ns} : TimeSpan{};
}

// Every centre of one point in one camera, of all clock epochs.
std::vector<MarkerObservation> CentresOf(std::span<const CleanTrack> epochs, size_t point) {
  std::vector<MarkerObservation> centres;
  for (const CleanTrack& track : epochs) {
    for (size_t row = 0; row < track.observations.size(); ++row) {
      if (!track.observations.IsVisible(row, point)) continue;
      centres.push_back(track.observations.Marker(row, point));
    }
  }
  return centres;
}

Eigen::Vector2d MedianCentre(const std::vector<MarkerObservation>& centres) {
  std::vector<double> x, y;
  for (const MarkerObservation& centre : centres) {
    x.push_back(centre.centre_px.x());
    y.push_back(centre.centre_px.y());
  }
  return {Median(x), Median(y)};
}

double SigmaPx(const MarkerObservation& centre) {
  return std::sqrt(0.5 * centre.covariance_px2.trace());
}

// One centre for all; not visible: the point moved.
MarkerObservation MeanCentre(const std::vector<MarkerObservation>& centres, size_t* outliers) {
  const Eigen::Vector2d median_px = MedianCentre(centres);
  MarkerObservation mean = centres.front();
  mean.visible = false;
  mean.time_delta_ns = 0;
  mean.centre_px = Eigen::Vector2d::Zero();
  mean.covariance_px2 = Eigen::Matrix2d::Zero();
  double count = 0, squares_px2 = 0;
  for (const MarkerObservation& centre : centres) {
    const Eigen::Vector2d off_px = centre.centre_px - median_px;
    if (off_px.norm() > kOutlierSigmas * SigmaPx(centre) + kOutlierPx) continue;
    mean.centre_px += off_px;  // from the median, which keeps the digits
    mean.covariance_px2 += centre.covariance_px2;
    squares_px2 += off_px.squaredNorm();
    ++count;
  }
  *outliers = centres.size() - static_cast<size_t>(count);
  if (2 * count <= static_cast<double>(centres.size())) return mean;
  mean.visible = true;
  mean.centre_px /= count;
  mean.covariance_px2 /= count;
  if (count > 1) {
    const double scatter_px2 = (squares_px2 - count * mean.centre_px.squaredNorm()) / (count - 1);
    mean.covariance_px2 *= std::max(1.0, scatter_px2 / mean.covariance_px2.trace());
  }
  mean.covariance_px2 /= std::min(count, kMaxRowsOfCentre);
  mean.centre_px += median_px;
  return mean;
}

// The centres of one camera, by point; none where it did not see the point, or the point moved.
std::vector<std::optional<MarkerObservation>> CentresOfCamera(std::span<const CleanTrack> epochs,
                                                              const Target& target,
                                                              RefusalCounter* refused) {
  std::vector<std::optional<MarkerObservation>> found;
  const std::string& camera = epochs.front().camera.camera;
  for (size_t p = 0; p < target.points.size(); ++p) {
    found.emplace_back();
    const std::vector<MarkerObservation> centres = CentresOf(epochs, p);
    if (centres.empty()) continue;
    size_t outliers = 0;
    const MarkerObservation mean = MeanCentre(centres, &outliers);
    if (mean.visible) {
      found.back() = mean;
      refused->Add(camera, RefusalReason::kOutlier, outliers,
                   absl::StrCat("centres of static point ", target.points[p].label,
                                " far from its others in this camera"));
    } else {
      refused->Add(camera, RefusalReason::kOutlier, centres.size(),
                   absl::StrCat("static point ", target.points[p].label,
                                " moved while it was recorded, or is not always the same point"));
    }
  }
  return found;
}

// Rows with times of their own, by the point that each shows.
ObservationTable RowsApart(const std::vector<std::optional<MarkerObservation>>& centres,
                           const TimeSpan& span, std::vector<int>* points) {
  const auto count = static_cast<int64_t>(centres.size());
  const int64_t step_ns = std::max(kMinStepNs, span.length_ns / count);
  std::vector<Observation> rows;
  for (int64_t p = 0; p < count; ++p) {
    const auto& centre = centres[static_cast<size_t>(p)];
    if (!centre) continue;
    rows.push_back({span.from_ns + step_ns / 2 + p * step_ns, 0, {*centre}});
    points->push_back(static_cast<int>(p));
  }
  return rows;
}

ObservationTable RowOfAll(const std::vector<std::optional<MarkerObservation>>& centres,
                          const TimeSpan& span) {
  Observation row;
  row.time_ns = span.from_ns + span.length_ns / 2;
  for (const auto& centre : centres) row.markers.push_back(centre.value_or(MarkerObservation()));
  return std::vector<Observation>{row};
}

}  // namespace

std::vector<AlignedTrack> GatherStaticPoints(const std::vector<CleanTrack>& tracks,
                                             const TargetOfSession& target_of,
                                             const std::vector<AlignedTrack>& moving,
                                             RefusalCounter* refused) {
  const TimeSpan span = SpanOf(moving);
  std::vector<AlignedTrack> gathered;
  for (size_t begin = 0; begin < tracks.size();) {
    const CleanTrack& first = tracks[begin];
    size_t end = begin + 1;
    while (end < tracks.size() && tracks[end].session_id == first.session_id &&
           tracks[end].camera.camera == first.camera.camera) {
      ++end;
    }
    const Target& target = target_of(first.session_id);
    const auto centres = CentresOfCamera({&first, end - begin}, target, refused);
    begin = end;
    if (std::ranges::none_of(centres, [](const auto& centre) { return centre.has_value(); })) {
      continue;
    }
    AlignedTrack track;
    track.track.session_id = first.session_id;
    track.track.camera = first.camera;
    track.is_static = true;
    track.track.observations = target.is_surveyed ? RowOfAll(centres, span)
                                                  : RowsApart(centres, span, &track.static_points);
    gathered.push_back(std::move(track));
  }
  return gathered;
}

std::vector<AlignedTrack> AlignTracks(std::vector<CameraTrack>* tracks,
                                      const TargetOfSession& target_of, RefusalCounter* refused,
                                      std::vector<StampFault>* faults) {
  const auto marker_count = [&target_of](const std::string& session_id) {
    return target_of(session_id).marker_count();
  };
  std::vector<CleanTrack> moving = CleanTracks(tracks, marker_count, refused);
  const auto first_static = std::stable_partition(
      moving.begin(), moving.end(),
      [&target_of](const CleanTrack& track) { return !target_of(track.session_id).IsStatic(); });
  const std::vector<CleanTrack> fixed(std::make_move_iterator(first_static),
                                      std::make_move_iterator(moving.end()));
  moving.erase(first_static, moving.end());
  std::vector<AlignedTrack> aligned = AlignClocks(*tracks, std::move(moving), refused, faults);
  std::ranges::move(GatherStaticPoints(fixed, target_of, aligned, refused),
                    std::back_inserter(aligned));
  return aligned;
}

}  // namespace rigcal::server
