// SPDX-License-Identifier: Apache-2.0
#include "common/triangulate/located_markers.h"

#include <algorithm>
#include <tuple>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/calibration/camera_covariance.h"
#include "common/triangulate/point_fit.h"

namespace rigcal {

absl::StatusOr<std::vector<LocatedMarker>> LocateMarkers(const CalibrationResult& calibration,
                                                         const std::vector<MarkerViews>& measured) {
  const CameraCovariance covariance = UnpackCameraCovariance(calibration);
  std::vector<LocatedMarker> located;
  for (const MarkerViews& marker : measured) {
    std::vector<PixelView> views;
    for (const MarkerView& view : marker.views) {
      const auto camera =
          std::ranges::find(calibration.cameras, view.camera, &CalibratedCamera::camera);
      if (camera == calibration.cameras.end()) {
        return absl::InvalidArgumentError(
            absl::StrCat("the calibration has no camera ", view.camera));
      }
      PixelView& pixel = views.emplace_back();
      pixel.camera = static_cast<int>(camera - calibration.cameras.begin());
      pixel.centre_px = {view.x_px, view.y_px};
      pixel.covariance_px2 << view.xx_px2, view.xy_px2, view.xy_px2, view.yy_px2;
    }
    const std::optional<FittedPoint> fitted = FitPoint(calibration.cameras, views);
    if (!fitted) continue;
    LocatedMarker& point = located.emplace_back();
    point.marker = marker.marker;
    point.place = marker.place;
    point.rig_time_ns = marker.rig_time_ns;
    point.position_m = fitted->position_m;
    point.noise_m2 = fitted->noise_m2;
    point.gain = covariance.matrix.size() > 0
                     ? PointGain(calibration.cameras, covariance, views, *fitted)
                     : Eigen::Matrix3Xd(3, 0);
    point.views = std::move(views);
  }
  return located;
}

Triangulation AsTriangulation(const std::vector<LocatedMarker>& markers) {
  Triangulation triangulation;
  for (const LocatedMarker& marker : markers) {
    TriangulatedPoint& point = triangulation.points.emplace_back();
    point.rig_time_ns = marker.rig_time_ns;
    point.marker = marker.marker;
    point.position_m = marker.position_m;
    point.noise_m2 = point.covariance_m2 = marker.noise_m2;
    point.views = marker.views;
  }
  std::ranges::stable_sort(triangulation.points, {}, [](const TriangulatedPoint& point) {
    return std::tuple(point.rig_time_ns, point.marker);
  });
  return triangulation;
}

std::vector<MarkerView> NamedViews(const CalibrationResult& calibration,
                                   const std::vector<PixelView>& views) {
  std::vector<MarkerView> named;
  for (const PixelView& view : views) {
    named.push_back({calibration.cameras[static_cast<size_t>(view.camera)].camera,
                     view.centre_px.x(), view.centre_px.y(), view.covariance_px2(0, 0),
                     view.covariance_px2(0, 1), view.covariance_px2(1, 1)});
  }
  return named;
}

}  // namespace rigcal
