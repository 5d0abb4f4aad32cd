// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "absl/status/statusor.h"
#include "common/camera/intrinsics_vector.h"

namespace rigcal {

// The projection of projection.h with its checks, and its inverse.
//
// Projects a point in frame `cam` (x right, y down, z forward, metres) to pixels. False, and
// `pixel` untouched, for a point that the model cannot see: z <= 0 with any model, at or beyond a
// pole of the rational model, not finite. Beyond the part in which a model is monotone a point
// still gets a pixel, often one inside the image; only Undistort tells. Allocates nothing.
// Brown-Conrady and rational: OpenCV, calib3d, "projectPoints"; fisheye: OpenCV, fisheye module
// (Kannala and Brandt 2006). `intrinsics` must be valid but for image size and focal lengths.
// d pixel / d x_in_cam on request.
bool Project(const Intrinsics& intrinsics, const Eigen::Vector3d& x_in_cam, Eigen::Vector2d* pixel,
             Eigen::Matrix<double, 2, 3>* d_pixel_d_point = nullptr);

// The same of intrinsics as IntrinsicsSize(model) plain values, with derivatives, each of which may
// be null; for the inner loop of a solver.
bool Project(DistortionModel model, const double* intrinsics, const Eigen::Vector3d& x_in_cam,
             Eigen::Vector2d* pixel, Eigen::Matrix<double, 2, 3>* d_pixel_d_point,
             IntrinsicsJacobian* d_pixel_d_intrinsics);

// The direction a pixel looks along, as normalised image coordinates (x/z, y/z) without distortion.
// OUT_OF_RANGE: the distortion model has no inverse there (the pixel is outside the part of the
// image in which the model is monotone, or not finite). Distorting the result gives the pixel back
// to 1e-9 in normalised coordinates.
absl::StatusOr<Eigen::Vector2d> Undistort(const Intrinsics& intrinsics,
                                          const Eigen::Vector2d& pixel);

}  // namespace rigcal
