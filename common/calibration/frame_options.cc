// SPDX-License-Identifier: Apache-2.0
#include "common/calibration/frame_options.h"

#include <algorithm>
#include <cmath>

#include "common/status/fault_list.h"
#include "common/status/validate_name.h"

namespace rigcal {
namespace {

constexpr double kMaxLengthM = 1e6;
constexpr int kMaxPlaces = 1000;

bool AllFinite(const double* values, size_t count) {
  return std::all_of(values, values + count, [](double value) { return std::isfinite(value); });
}

bool IsPositive(const MarkerView& view) {
  return std::isfinite(view.xx_px2) && std::isfinite(view.yy_px2) && view.xx_px2 > 0 &&
         view.yy_px2 > 0 && view.xx_px2 * view.yy_px2 > view.xy_px2 * view.xy_px2;
}

// The first fault is enough: there may be thousands of them.
void CheckMeasured(const char* name, const std::vector<MarkerViews>& measured, FaultList* faults) {
  for (size_t i = 0; i < measured.size(); ++i) {
    const MarkerViews& marker = measured[i];
    if (marker.marker < 0 || marker.marker >= kMaxMarkers || marker.place < 0 ||
        marker.place >= kMaxPlaces) {
      faults->Add(name, "[", i, "]: marker ", marker.marker, " at place ", marker.place,
                  " is out of range");
      return;
    }
    if (marker.views.size() < 2) {
      faults->Add(name, "[", i, "] has ", marker.views.size(), " views; a point needs two");
      return;
    }
    for (const MarkerView& view : marker.views) {
      const absl::Status named = ValidateName("camera", view.camera);
      if (!named.ok()) {
        faults->Add(name, "[", i, "]: ", std::string(named.message()));
        return;
      }
      if (std::isfinite(view.x_px) && std::isfinite(view.y_px) && IsPositive(view)) continue;
      faults->Add(name, "[", i, "]: the view of camera ", view.camera,
                  " is not finite, or its covariance is not positive");
      return;
    }
  }
}

// Of a measured length and its sigma.
void CheckLength(const char* name, double length_m, double sigma_m, FaultList* faults) {
  if (!(length_m > 0 && length_m < kMaxLengthM)) {
    faults->Add(name, " is ", length_m, " m, it must be positive and below ", kMaxLengthM);
  } else if (!(sigma_m >= 0 && sigma_m < length_m)) {
    faults->Add("one sigma of a ", name, " of ", length_m, " m is ", sigma_m,
                " m, it must be 0 (the default) or positive and below the length");
  }
}

void CheckLimit(const char* name, double value, double high, FaultList* faults) {
  if (value >= 0 && value <= high) return;
  faults->Add(name, " is ", value, ", it must be 0 (the default) or positive and at most ", high);
}

}  // namespace

bool OriginRequest::NeedsRows() const {
  return source == FrameSource::kFloor || source == FrameSource::kPath;
}

absl::Status OriginRequest::Validate() const {
  FaultList faults;
  if (source < FrameSource::kFloor || source > FrameSource::kTransform) {
    faults.Add("source is none of floor, points, path, down and transform");
  }
  faults.CheckRange("height_m", height_m, -100, 100, " m");
  CheckLimit("still_s", still_s, 3600, &faults);
  CheckLimit("max_residual_m", max_residual_m, 1000, &faults);
  CheckLimit("max_rotation_sigma_rad", max_rotation_sigma_rad, 3.15, &faults);
  if ((source == FrameSource::kPoints) == points.empty()) {
    faults.Add(points.empty() ? "points is empty: name points with their coordinates"
                              : "points goes with the source points");
  }
  if (points.size() > static_cast<size_t>(kMaxMarkers)) {
    faults.Add("points has ", points.size(), " points, at most ", kMaxMarkers, " are allowed");
  }
  for (const TargetPoint& point : points) {
    const double values[] = {point.x_m, point.y_m, point.z_m, point.sigma_m};
    if (point.label.empty() || !AllFinite(values, 4) || point.sigma_m < 0) {
      faults.Add("point '", point.label,
                 "': it needs a label, finite coordinates and a sigma that is not negative");
      break;
    }
  }
  if (source == FrameSource::kDown &&
      (!AllFinite(down.data(), 3) || std::hypot(down[0], down[1], down[2]) < 1e-9)) {
    faults.Add("down is no direction");
  }
  const std::array<double, 4>& q = rotation_wxyz;
  const double length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  if (source == FrameSource::kTransform &&
      (!AllFinite(translation_m.data(), 3) || !(std::abs(length - 1) < 1e-3))) {
    faults.Add("new_from_rig: the translation must be finite, and the quaternion has the length ",
               length, ", not 1");
  }
  CheckMeasured("measured", measured, &faults);
  return faults.Result("origin: ");
}

absl::Status ScaleRequest::Validate() const {
  FaultList faults;
  if (distances.empty() && lengths.empty()) {
    faults.Add("there is no length: give distances between cameras, or lengths between markers");
  }
  for (const CameraDistance& distance : distances) {
    faults.Add(ValidateName("camera", distance.camera_a));
    faults.Add(ValidateName("camera", distance.camera_b));
    if (distance.camera_a == distance.camera_b) {
      faults.Add("a distance names camera ", distance.camera_a, " twice");
    }
    CheckLength("distance", distance.distance_m, distance.sigma_m, &faults);
  }
  for (const KnownLength& length : lengths) {
    if (length.marker_a == length.marker_b || length.marker_a < 0 || length.marker_b < 0 ||
        length.marker_a >= kMaxMarkers || length.marker_b >= kMaxMarkers) {
      faults.Add("a length is between markers ", length.marker_a, " and ", length.marker_b,
                 ": it needs two markers of the target");
    }
    CheckLength("length", length.length_m, length.sigma_m, &faults);
  }
  CheckMeasured("measured", measured, &faults);
  return faults.Result("scale: ");
}

}  // namespace rigcal
