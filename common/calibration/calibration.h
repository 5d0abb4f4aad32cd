// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "common/calibration/calibration_frame.h"
#include "common/calibration/calibration_options.h"
#include "common/calibration/finding_kind.h"
#include "common/calibration/parameter_information.h"
#include "common/camera/intrinsics.h"
#include "common/geometry/rigid_transform.h"
#include "common/status/refusal.h"
#include "common/target/target.h"
#include "common/time/clock_course.h"

namespace rigcal {

// Figures of a set of reprojection errors; each error is a Euclidean distance in pixels.
struct ErrorFigures {
  double mean_px = 0;
  double rms_px = 0;
  double median_px = 0;
  double p95_px = 0;
  uint32_t marker_count = 0;
};

// Over all visible markers of the used instants, outliers included.
struct Residuals {
  ErrorFigures all;
  ErrorFigures inlier;  // markers that are not outliers
  uint32_t observation_count = 0;
  uint32_t outlier_count = 0;  // markers
};

// One sigma each, with the reference camera's pose held fixed.
struct CameraUncertainty {
  Eigen::Vector3d rotation_sigma_rad =
      Eigen::Vector3d::Zero();  // rotation vector in the camera frame
  Eigen::Vector3d position_sigma_m = Eigen::Vector3d::Zero();  // camera centre in the rig frame
  double time_offset_sigma_s = 0;
  double time_rate_sigma_ppm = 0;
  std::vector<double> intrinsics_sigma;  // fx fy cx cy and the coefficients; empty when fixed
};

// Residuals of one camera, projected minus measured centres: a part of them as vectors, the lengths
// of all of them as a histogram.
struct CameraResiduals {
  struct Vector {
    float x_px = 0, y_px = 0;    // measured, at the instant's time
    float dx_px = 0, dy_px = 0;  // projected minus measured
    bool outlier = false;        // left out of the solution
  };
  std::string camera;
  ImageSize image_size_px;
  std::vector<Vector> vectors;
  double bin_px = 0;  // of the histogram; the last bin also has everything beyond it
  std::vector<uint32_t> inlier_counts, outlier_counts;  // by bin
};

struct CalibratedCamera {
  std::string camera;
  ImageSize image_size_px;
  RigidTransform cam_from_rig;
  Intrinsics intrinsics;
  bool intrinsics_refined = false;
  // rig_time = camera_time + time_offset + time_rate * (camera_time - time_epoch)
  std::string clock_id;
  double time_offset_s = 0;  // against the median clock
  double time_rate_ppm = 0;
  double time_epoch_s = 0;
  bool time_offset_estimated = false;
  ClockCourseLine clock_course;  // to be added; not empty where the clock jumped or drifted
  // Rolling shutter: a marker in image row y is seen line_delay * (y - (height - 1) / 2) later than
  // the clock says. Negative where rows are read upwards; 0 unless estimated.
  double line_delay_s = 0;
  double line_delay_sigma_s = 0;  // one sigma; 0: not estimated, or held at the longest possible
  Residuals residuals;
  std::optional<CameraUncertainty> uncertainty;
  std::optional<ErrorFigures> held_out;
  std::optional<ErrorFigures> leave_one_out;
  uint32_t observation_count = 0;
  uint32_t wand_count = 0;
};

// Error of one span between neighbouring markers, triangulated without the wand constraint.
struct SpanError {
  double length_m = 0;
  double mean_error_m = 0;
  double error_rms_m = 0;
  uint32_t count = 0;
  double held_out_error_rms_m = 0;
  uint32_t held_out_count = 0;
};

// Where a static point was found, in the rig frame.
struct CalibratedPoint {
  std::string label;
  std::string session_id;
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
  uint32_t camera_count = 0;  // whose centres agree with it
};

struct CalibratedTarget {
  Target given;
  std::vector<double> marker_positions_m;
  bool marker_positions_estimated = false;
  std::vector<double> marker_position_sigma_m;
  double scale_sigma_rel = 0;     // 0: not computed
  double length_error_rms_m = 0;  // over all spans
  std::vector<SpanError> spans;
  std::vector<std::string> session_ids;  // in which it was seen; empty: all
  std::vector<CalibratedPoint> static_points;
};

// How much a finding matters: kWarning limits the quality grade to usable, kError makes it bad.
enum class FindingSeverity : uint8_t { kInfo = 1, kWarning = 2, kError = 3 };

struct Finding {
  FindingKind kind = FindingKind::kUnspecified;
  std::string camera;  // empty: the whole rig
  double value = 0;
  std::string unit;
  std::string advice;
  FindingSeverity severity = FindingSeverity::kInfo;
  // A possible cause of a result too bad for figures to hold: `value` is how much of the mean
  // reprojection error it would explain, pixels.
  bool candidate = false;
  // Of a kUnspecified of a later version: the number of its kind there.
  int unknown_kind = 0;
};

// Which solver adjusted a calibration: the kernel for lines and points, or the general one.
enum class SolverPath : uint8_t { kUnknown = 0, kLineKernel = 1, kGeneral = 2 };

// What was taken for the motion of the target between rows.
struct CalibratedTrajectory {
  enum class Kind : uint8_t { kUnknown = 0, kInterpolated = 1, kSpline = 2 };
  Kind kind = Kind::kUnknown;
  // Of a spline of its path: time from one knot to the next; root of the spectral density of its
  // jerk (m/s^2.5, in units of the result); rows that are part of it and of no instant.
  double knot_spacing_s = 0;
  double jerk_density = 0;
  uint32_t added_row_count = 0;
  // Mean held-out error with instants and with a spline; 0: not compared.
  double held_out_interpolated_px = 0;
  double held_out_spline_px = 0;
};

enum class QualityGrade : uint8_t { kNotEvaluated = 0, kGood = 1, kUsable = 2, kBad = 3 };

struct Quality {
  QualityGrade grade = QualityGrade::kNotEvaluated;
  std::vector<std::string> reasons;
  // Predicted error of the camera positions after the best rigid motion of the rig, one sigma, and
  // the largest that is acceptable
  // (CalibrationOptions::accept_m). In units of the result; 0: not known.
  double predicted_error_m = 0;
  double accepted_error_m = 0;
};

// What makes most of an expected error: the noise of the data, given intrinsics that were kept, or
// what parts of the data disagree by beyond their noise.
enum class ErrorBasis : uint8_t { kUnknown = 0, kCovariance = 1, kLenses = 2, kFolds = 3 };

// How good a calibration is, in few numbers.
struct Headline {
  // Of a point by the calibration alone, after the best alignment and at the right scale: 95 % of
  // the waved places have less. As likely too large as too small, and what it is below with a
  // probability of 95 %. 0: not known.
  double point_error_m = 0, point_error_bound_m = 0;
  double used_mean_px = 0;  // reprojection error of the markers that were used
  double unused_share = 0;  // of all cameras' wand views
  ErrorBasis point_error_basis = ErrorBasis::kUnknown;
};

// The box, along the axes of the rig frame, in which nearly all of the wand's ends were (the
// first to the 99th percentile of each coordinate).
struct WandVolume {
  Eigen::Vector3d min_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d max_m = Eigen::Vector3d::Zero();
};

// What a solve gives: everything of a calibration that depends on the observations and options
// alone. Two runs on the same set of observations agree in it bit for bit.
struct CalibrationResult {
  bool scale_known = false;
  // Where the scale is not known: its distance from the reference camera is 1, the unit of every
  // length of the result, whatever the field is called.
  std::string unit_camera;
  std::string reference_camera;  // its pose is the rig frame; empty: see `frame`
  uint32_t instant_count = 0;
  std::vector<CalibratedCamera> cameras;  // sorted by name
  CalibratedTarget target;                // of several the wand, if there is one
  std::vector<CalibratedTarget> other_targets;
  std::vector<Refusal> refused;
  std::vector<Finding> findings;
  Quality quality;
  std::optional<Headline> headline;
  std::string observation_digest;
  uint32_t iteration_count = 0;
  SolverPath solver_path = SolverPath::kUnknown;
  CalibratedTrajectory trajectory;
  std::optional<WandVolume> wand_volume;
  // Joint covariance of all cameras, scale excluded, lower triangle row by row. Rows, camera by
  // camera: rotation vector in the camera frame (3, applied from the left, radians) and translation
  // of cam_from_rig (3, metres) unless it is the reference camera; then, if they were refined, its
  // intrinsics (fx fy cx cy and the coefficients). Empty: not computed.
  std::vector<double> camera_covariance;
  std::vector<CameraResiduals> residuals;             // sorted by name; empty: not kept
  std::optional<CalibrationFrame> frame;              // none: that of the reference camera
  std::optional<CalibrationScale> scale;              // where only the scale was changed
  std::optional<CalibrationInformation> information;  // what holds the parameters
};

}  // namespace rigcal
