// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "common/camera/intrinsics.h"
#include "common/geometry/rigid_transform.h"
#include "common/time/clock_course.h"
#include "rigcal/v1/calibration.pb.h"

namespace rigcal {

// One sigma of a camera, with the reference camera held fixed and without the scale's.
struct ExportedSigma {
  Eigen::Vector3d rotation_rad;    // rotation vector in the camera's frame
  Eigen::Vector3d position_m;      // camera centre in the rig frame
  std::vector<double> intrinsics;  // fx fy cx cy and the coefficients, pixels; empty: kept as given
};

// Which axis of the rig frame points up, for formats that have an up.
enum class UpAxis : uint8_t {
  kAsItIs,  // the axes of the rig frame are those of the format
  kY,
  kZ,
};
// "y" or "z". INVALID_ARGUMENT: neither.
absl::StatusOr<UpAxis> ParseUpAxis(std::string_view text);

// A camera as every writer gets it.
struct ExportedCamera {
  std::string name;  // letters, digits, '_', '-' and '.'; not beginning with '.'
  ImageSize image_size_px;
  Intrinsics intrinsics;        // pixels, the centre of the first pixel is (0, 0)
  RigidTransform cam_from_rig;  // metres; `cam`: x right, y down, z forward
  // rig_time = camera_time + time_offset + time_rate * (camera_time - time_epoch)
  double time_offset_s = 0;
  double time_rate_ppm = 0;
  double time_epoch_s = 0;
  ClockCourseLine clock_course;  // to be added; not empty where the clock jumped or drifted
  double line_delay_s = 0;       // rolling shutter, from one row to the next; 0: none is known
  double mean_error_px = 0;      // reprojection error of the markers used
  // By how much a lens that the format can say shows the image wrong; 0: it is the lens itself.
  double refit_error_px = 0;
  std::optional<ExportedSigma> sigma;

  // The coefficients of the model, zeros where the intrinsics have none.
  std::vector<double> Coefficients() const;
  bool HasDistortion() const;
};

// A calibrated rig as every writer gets it: in metres, every value finite, every name fit for a
// file name.
struct ExportedRig {
  std::string calibration_id;
  int64_t create_utc_ns = 0;
  double scale_sigma_rel = 0;           // one sigma of every length, as a share of it; 0: not known
  std::vector<ExportedCamera> cameras;  // sorted by name
  UpAxis up = UpAxis::kAsItIs;
  bool has_poses = true;  // false: lenses alone, and each pose is the identity
};

// FAILED_PRECONDITION: the calibration has no result, or no metric scale. DATA_LOSS: a camera has
// values that no file can hold; it is named, with every fault.
absl::StatusOr<ExportedRig> RigOf(const rigcal::v1::Calibration& calibration);

// FAILED_PRECONDITION "camera left: WHY": the format cannot hold this camera.
absl::Status CannotHold(const ExportedCamera& camera, const std::string& why);

// By how much a single focal length, the mean of both, shows the image wrong at worst, in pixels
// (at one of its corners).
double SingleFocalErrorPx(const ExportedCamera& camera);

// The most by which a format that holds less may show a point of the image wrong.
inline constexpr double kHeldWithinPx = 0.05;

}  // namespace rigcal
