// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "common/target/target.h"

namespace rigcal {

// A marker in the image of one camera, at one time or as the mean while it rests. The centre is
// that of the marker itself, corrected for the size of its sphere.
struct MarkerView {
  std::string camera;
  double x_px = 0, y_px = 0;
  double xx_px2 = 1, xy_px2 = 0, yy_px2 = 1;  // covariance

  friend bool operator==(const MarkerView&, const MarkerView&) = default;
};

// A marker as several cameras saw it.
struct MarkerViews {
  int marker = 0;  // of the target
  int place = 0;   // that a target was laid down at, from 0
  int64_t rig_time_ns = 0;
  std::vector<MarkerView> views;  // two or more

  friend bool operator==(const MarkerViews&, const MarkerViews&) = default;
};

// Where the frame of a calibration comes from (rigcal/v1/frame.proto).
enum class FrameSource : uint8_t {
  kReferenceCamera = 0,
  kFloor = 1,
  kPoints = 2,
  kPath = 3,
  kDown = 4,
  kTransform = 5,
  kKept = 6,     // that of an earlier calibration
  kNotKept = 7,  // it could not be kept: that of the reference camera
};

inline constexpr double kDefaultStillS = 0.5;
inline constexpr double kDefaultMaxResidualM = 0.005;
inline constexpr double kDefaultMaxRotationSigmaRad = 0.25 * 0.017453292519943295;

// What a new frame is made from.
struct OriginRequest {
  FrameSource source = FrameSource::kReferenceCamera;
  double height_m = 0;              // of the markers' centres above z = 0: floor, path
  std::vector<TargetPoint> points;  // of known coordinates, in the new frame
  std::array<double, 3> down = {0, 0, 0};
  // new_from_rig of a given transform; the quaternion has any length but 0.
  std::array<double, 3> translation_m = {0, 0, 0};
  std::array<double, 4> rotation_wxyz = {1, 0, 0, 0};
  std::vector<MarkerViews> measured;  // instead of rows of a session
  double still_s = 0;                 // 0: kDefaultStillS
  double max_residual_m = 0;          // 0: kDefaultMaxResidualM
  double max_rotation_sigma_rad = 0;  // 0: kDefaultMaxRotationSigmaRad
  bool cameras_below = false;

  friend bool operator==(const OriginRequest&, const OriginRequest&) = default;
  // Every fault.
  absl::Status Validate() const;
  // Rows are needed: of a session, or `measured`.
  bool NeedsRows() const;
};

// A measured length between two markers of the rows.
struct KnownLength {
  int marker_a = 0, marker_b = 0;
  double length_m = 0;  // > 0
  double sigma_m = 0;   // 0: kDefaultSigmaM
  std::string name;     // of the source; empty: "length A to B"

  static constexpr double kDefaultSigmaM = 0.0005;
  double SigmaM() const { return sigma_m > 0 ? sigma_m : kDefaultSigmaM; }
  friend bool operator==(const KnownLength&, const KnownLength&) = default;
};

// A measured distance between the optical centres of two cameras.
struct CameraDistance {
  std::string camera_a, camera_b;
  double distance_m = 0;  // > 0
  double sigma_m = 0;     // 0: kDefaultSigmaM

  static constexpr double kDefaultSigmaM = 0.002;
  double SigmaM() const { return sigma_m > 0 ? sigma_m : kDefaultSigmaM; }
  friend bool operator==(const CameraDistance&, const CameraDistance&) = default;
};

// The lengths that give a scale together with the target of a calibration.
struct ScaleRequest {
  std::vector<CameraDistance> distances;
  std::vector<KnownLength> lengths;
  std::vector<MarkerViews> measured;   // rows for the lengths, instead of those of a session
  std::vector<std::string> leave_out;  // names of sources

  friend bool operator==(const ScaleRequest&, const ScaleRequest&) = default;
  absl::Status Validate() const;
};

}  // namespace rigcal
