// SPDX-License-Identifier: Apache-2.0
#include "common/triangulate/triangulate_rows.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/associate/row_groups.h"
#include "common/camera/sphere_projection.h"
#include "common/statistics/robust_statistics.h"
#include "common/status/status_macros.h"
#include "common/triangulate/marker_track.h"

namespace rigcal {
namespace {

constexpr double kUnknownSigmaPx = 0.5;
constexpr size_t kMaxOddViews = 200;  // even; to see what the matter is

// One camera's rows, ready to be asked.
struct TriangulationTrack {
  int camera = 0;  // index in the calibration
  std::vector<Observation> rows;
  std::vector<MarkerTrack> markers;
};

double MedianPeriodS(const std::vector<Observation>& rows) {
  std::vector<int64_t> steps_ns;
  for (size_t i = 1; i < rows.size(); ++i) {
    if (rows[i].time_ns > rows[i - 1].time_ns) {
      steps_ns.push_back(rows[i].time_ns - rows[i - 1].time_ns);
    }
  }
  return steps_ns.empty() ? 0 : 1e-9 * static_cast<double>(UpperMedian(&steps_ns));
}

double SigmaPx(const CalibratedCamera& camera, const TriangulationOptions& options) {
  if (options.sigma_px > 0) return options.sigma_px;
  const double rms_px = camera.residuals.inlier.rms_px;
  return rms_px > 0 ? rms_px / std::sqrt(2.0) : kUnknownSigmaPx;
}

// Rig time of a row: that of the middle of what it shows.
int64_t RowTimeNs(const CalibratedCamera& camera, const Observation& row) {
  double y_px = 0;
  for (const MarkerObservation& marker : row.markers) {
    if (marker.visible) y_px += marker.centre_px.y();
  }
  return RigTimeNs(camera, row.time_ns) + LineDelayNs(camera, y_px / row.VisibleCount());
}

RowTimes SeenRowsOf(const CalibratedCamera& camera, const TriangulationTrack& track,
                    double period_s, int64_t from_ns) {
  RowTimes seen{camera.camera, period_s, {}, {}};
  for (size_t i = 0; i < track.rows.size(); ++i) {
    if (track.rows[i].VisibleCount() == 0) continue;
    const int64_t time_ns = RowTimeNs(camera, track.rows[i]);
    if (time_ns < from_ns) continue;
    seen.time_ns.push_back(time_ns);
    seen.row.push_back(static_cast<int>(i));
  }
  return seen;
}

absl::StatusOr<int> IndexOf(const CalibrationResult& calibration, const std::string& name) {
  std::vector<std::string> names;
  for (size_t i = 0; i < calibration.cameras.size(); ++i) {
    if (calibration.cameras[i].camera == name) return static_cast<int>(i);
    names.push_back(calibration.cameras[i].camera);
  }
  return absl::InvalidArgumentError(absl::StrCat("the calibration has no camera ", name,
                                                 "; it has ", absl::StrJoin(names, ", "),
                                                 ": take the rows of the rig that was calibrated"));
}

class RowTriangulator {
 public:
  RowTriangulator(const CalibrationResult& calibration, const TriangulationOptions& options)
      : cameras_(calibration.cameras),
        options_(options),
        covariance_(UnpackCameraCovariance(calibration)) {
    triangulation_.has_calibration_covariance = covariance_.matrix.size() > 0;
  }

  void Add(int camera, std::vector<Observation> rows) {
    const CalibratedCamera& calibrated = cameras_[static_cast<size_t>(camera)];
    const double sigma_px = SigmaPx(calibrated, options_);
    TriangulationTrack& track = tracks_.emplace_back();
    track.camera = camera;
    track.rows = std::move(rows);
    for (Observation& row : track.rows) {
      for (MarkerObservation& marker : row.markers) {
        marker.covariance_px2 = sigma_px * sigma_px * Eigen::Matrix2d::Identity();
      }
      marker_count_ = std::max(marker_count_, row.markers.size());
    }
  }

  Triangulation Run() && {
    std::vector<RowTimes> seen;
    for (TriangulationTrack& track : tracks_) {
      const CalibratedCamera& camera = cameras_[static_cast<size_t>(track.camera)];
      const double period_s = MedianPeriodS(track.rows);
      seen.push_back(SeenRowsOf(camera, track, period_s, options_.from_ns));
      for (size_t marker = 0; marker < marker_count_; ++marker) {
        track.markers.emplace_back(camera, track.rows, marker, period_s);
      }
    }
    memories_.resize(tracks_.size());
    for (const RowGroup& group : GroupRows(seen, options_.tolerance_s).groups) {
      const auto [first, last] = std::ranges::minmax_element(group, {}, &RowMember::time_ns);
      if (first->time_ns > options_.until_ns) continue;
      triangulation_.last_row_ns = std::max(triangulation_.last_row_ns, last->time_ns);
      const int64_t time_ns = MeanTimeNs(group);
      odd_cameras_.clear();
      for (size_t marker = 0; marker < marker_count_; ++marker) AddPoint(group, time_ns, marker);
      for (const int camera : odd_cameras_) {
        ++triangulation_.left_out_rows[cameras_[static_cast<size_t>(camera)].camera];
      }
    }
    std::ranges::stable_sort(triangulation_.points, {}, &TriangulatedPoint::rig_time_ns);
    return std::move(triangulation_);
  }

 private:
  void AddPoint(const RowGroup& group, int64_t time_ns, size_t marker) {
    std::vector<PixelView> views;
    std::vector<CentreKind> kinds;
    for (const RowMember& member : group) {
      const auto t = static_cast<size_t>(member.track);
      const auto centre = tracks_[t].markers[marker].At(member.row, time_ns, &memories_[t]);
      if (!centre) continue;
      views.push_back({tracks_[t].camera, centre->centre_px, centre->covariance_px2});
      kinds.push_back(centre->centre_kind);
    }
    if (views.empty()) return;
    if (views.size() < 2) {
      ++triangulation_.alone_count;
      return;
    }
    std::optional<FittedPoint> point = FitPoint(cameras_, views);
    if (point && CorrectSphereCentres(point->position_m, kinds, &views)) {
      point = FitPoint(cameras_, views);
    }
    // Rays of three cameras that meet nowhere may be two that do, and one that misses.
    if (!point && views.size() < 3) {
      ++triangulation_.no_ray_count;
      return;
    }
    if (views.size() > 2 && (!point || point->WorstSigmas() > options_.max_sigmas)) KeepOdd(views);
    while (!point || point->WorstSigmas() > options_.max_sigmas) {
      if (views.size() < 3 || !LeaveOut(&views, &point)) {
        ++triangulation_.disagree_count;
        return;
      }
    }
    TriangulatedPoint& added = triangulation_.points.emplace_back();
    added.rig_time_ns = time_ns;
    added.marker = static_cast<int>(marker);
    added.position_m = point->position_m;
    added.noise_m2 = added.covariance_m2 = point->noise_m2;
    added.error_px = point->RmsPx();
    if (triangulation_.has_calibration_covariance) {
      const Eigen::Matrix3Xd gain = PointGain(cameras_, covariance_, views, *point);
      added.covariance_m2 += gain * covariance_.matrix * gain.transpose();
    }
    added.covariance_m2 += covariance_.scale_sigma_rel * covariance_.scale_sigma_rel *
                           point->position_m * point->position_m.transpose();
    added.views = std::move(views);
  }

  // Every second one goes when there is no more room, and every second one that comes.
  void KeepOdd(const std::vector<PixelView>& views) {
    if (triangulation_.odd_count++ % odd_stride_ != 0) return;
    std::vector<std::vector<PixelView>>& kept = triangulation_.odd_views;
    if (kept.size() == kMaxOddViews) {
      for (size_t i = 0; i < kMaxOddViews / 2; ++i) kept[i] = std::move(kept[2 * i]);
      kept.resize(kMaxOddViews / 2);
      odd_stride_ *= 2;
    }
    kept.push_back(views);
  }

  // The view without which the others agree best is taken out.
  bool LeaveOut(std::vector<PixelView>* views, std::optional<FittedPoint>* point) {
    std::optional<FittedPoint> best;
    size_t best_view = 0;
    for (size_t out = 0; out < views->size(); ++out) {
      std::vector<PixelView> others = *views;
      others.erase(others.begin() + static_cast<std::ptrdiff_t>(out));
      std::optional<FittedPoint> fitted = FitPoint(cameras_, others);
      if (!fitted || (best && best->WorstSigmas() <= fitted->WorstSigmas())) continue;
      best = std::move(fitted);
      best_view = out;
    }
    if (!best) return false;
    const int camera = (*views)[best_view].camera;
    ++triangulation_.left_out[cameras_[static_cast<size_t>(camera)].camera];
    odd_cameras_.insert(camera);
    views->erase(views->begin() + static_cast<std::ptrdiff_t>(best_view));
    *point = std::move(best);
    return true;
  }

  // From the centres of the spheres' images to those of the spheres. False: nothing to do.
  bool CorrectSphereCentres(const Eigen::Vector3d& position_m, const std::vector<CentreKind>& kinds,
                            std::vector<PixelView>* views) const {
    if (options_.diameter_m <= 0) return false;
    bool moved = false;
    for (size_t i = 0; i < views->size(); ++i) {
      if (kinds[i] != CentreKind::kImageBlob) continue;
      PixelView& view = (*views)[i];
      const CalibratedCamera& camera = cameras_[static_cast<size_t>(view.camera)];
      const double distance_m = (camera.cam_from_rig * position_m).norm();
      moved |= SphereCentreFromCentroid(camera.intrinsics, view.centre_px, distance_m,
                                        options_.diameter_m, &view.centre_px);
    }
    return moved;
  }

  const std::vector<CalibratedCamera>& cameras_;
  TriangulationOptions options_;
  CameraCovariance covariance_;
  size_t marker_count_ = 0;
  std::vector<TriangulationTrack> tracks_;
  std::vector<MotionWeightsMemory> memories_;  // by track
  std::set<int> odd_cameras_;                  // of the instant: with centres that were left out
  uint32_t odd_stride_ = 1;
  Triangulation triangulation_;
};

}  // namespace

absl::StatusOr<Triangulation> TriangulateRows(const CalibrationResult& calibration,
                                              std::vector<CameraRows> rows,
                                              const TriangulationOptions& options) {
  if (!calibration.scale_known) {
    return absl::FailedPreconditionError(
        "the scale of the calibration is not known: its points have no place in metres; calibrate "
        "with a wand, a scale bar or a known distance");
  }
  RowTriangulator triangulator(calibration, options);
  std::vector<std::string> names;
  for (CameraRows& camera : rows) {
    RIGCAL_ASSIGN_OR_RETURN(const int index, IndexOf(calibration, camera.camera));
    names.push_back(camera.camera);
    triangulator.Add(index, std::move(camera.rows));
  }
  if (rows.size() < 2) {
    return absl::InvalidArgumentError(
        absl::StrCat("points are triangulated from two cameras at least, and there are rows of ",
                     names.empty() ? "none" : names[0]));
  }
  return std::move(triangulator).Run();
}

}  // namespace rigcal
