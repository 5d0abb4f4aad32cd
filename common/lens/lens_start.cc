// SPDX-License-Identifier: Apache-2.0
#include "common/lens/lens_start.h"

#include <Eigen/Eigenvalues>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "common/camera/camera_model.h"
#include "common/statistics/robust_statistics.h"

namespace rigcal {
namespace {

constexpr double kShortestFocal = 0.2;  // of the longer side of the image
constexpr double kLongestFocal = 8;     // likewise
constexpr int kFocalLengths = 30;
constexpr size_t kViewsForFocal = 16;
constexpr double kStartLossPx = 5;
constexpr double kWidestTheta = 1.35;  // beyond, tan() spoils a homography
constexpr size_t kLeastCornersForPose = 6;

// x / z, y / z of where a pixel looks.
std::optional<Eigen::Vector2d> RayOf(const Intrinsics& lens, const Eigen::Vector2d& pixel) {
  const bool is_plain = std::all_of(lens.distortion.begin(), lens.distortion.end(),
                                    [](double coefficient) { return coefficient == 0; });
  if (!is_plain) {
    const absl::StatusOr<Eigen::Vector2d> ray = Undistort(lens, pixel);
    if (!ray.ok() || ray->norm() > std::tan(kWidestTheta)) return std::nullopt;
    return *ray;
  }
  const Eigen::Vector2d bent((pixel.x() - lens.cx_px) / lens.fx_px,
                             (pixel.y() - lens.cy_px) / lens.fy_px);
  if (lens.model != DistortionModel::kFisheye) return bent;
  const double theta = bent.norm();
  if (theta > kWidestTheta) return std::nullopt;
  return theta < 1e-9 ? bent : Eigen::Vector2d(bent * (std::tan(theta) / theta));
}

// The plane's pose from the homography, by the direct linear transform.
std::optional<RigidTransform> PoseFromHomography(const BoardView& view, const Intrinsics& lens) {
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const BoardCorner& corner : view.corners) middle += corner.x_in_board_m;
  middle /= static_cast<double>(view.corners.size());
  double size = 0;
  for (const BoardCorner& corner : view.corners) {
    size = std::max(size, (corner.x_in_board_m - middle).norm());
  }
  if (size <= 0) return std::nullopt;
  Eigen::Matrix<double, 9, 9> sum = Eigen::Matrix<double, 9, 9>::Zero();
  size_t count = 0;
  for (const BoardCorner& corner : view.corners) {
    const std::optional<Eigen::Vector2d> ray = RayOf(lens, corner.pixel);
    if (!ray) continue;
    ++count;
    const Eigen::Vector3d plane((corner.x_in_board_m.x() - middle.x()) / size,
                                (corner.x_in_board_m.y() - middle.y()) / size, 1);
    Eigen::Matrix<double, 2, 9> rows;
    rows.setZero();
    rows.block<1, 3>(0, 0) = plane.transpose();
    rows.block<1, 3>(0, 6) = -ray->x() * plane.transpose();
    rows.block<1, 3>(1, 3) = plane.transpose();
    rows.block<1, 3>(1, 6) = -ray->y() * plane.transpose();
    sum += rows.transpose() * rows / (1 + ray->squaredNorm());
  }
  if (count < kLeastCornersForPose) return std::nullopt;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 9, 9>> solver(sum);
  const Eigen::Matrix<double, 9, 1> h = solver.eigenvectors().col(0);
  Eigen::Matrix3d homography;
  homography << h.segment<3>(0).transpose(), h.segment<3>(3).transpose(),
      h.segment<3>(6).transpose();
  if (homography(2, 2) < 0) homography = -homography;
  const double scale = std::sqrt(homography.col(0).norm() * homography.col(1).norm());
  if (!(scale > 0)) return std::nullopt;
  homography /= scale;
  Eigen::Matrix3d axes;
  axes << homography.col(0), homography.col(1), homography.col(0).cross(homography.col(1));
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(axes, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Matrix3d rotation = svd.matrixU() * svd.matrixV().transpose();
  if (!rotation.allFinite() || rotation.determinant() < 0.5) return std::nullopt;
  RigidTransform pose;
  pose.rotation = Eigen::Quaterniond(rotation);
  pose.translation_m = size * homography.col(2) - rotation * middle;
  return pose;
}

Intrinsics PlainLens(LensModel model, const ImageSize& image, double focal_px) {
  Intrinsics lens;
  lens.model = DistortionModelOf(model);
  lens.fx_px = lens.fy_px = focal_px;
  lens.cx_px = 0.5 * (image.width - 1.0);
  lens.cy_px = 0.5 * (image.height - 1.0);
  lens.distortion.assign(static_cast<size_t>(CoefficientCount(lens.model)), 0.0);
  return lens;
}

}  // namespace

PlacedBoard PlaceBoard(LensModel model, const BoardView& view, const Intrinsics& lens) {
  PlacedBoard placed;
  placed.cam_from_board.translation_m = Eigen::Vector3d(0, 0, 1);
  const std::optional<RigidTransform> pose = PoseFromHomography(view, lens);
  if (!pose) return placed;
  LensAdjustmentOptions options;
  options.fix_intrinsics = true;
  options.loss_px = kStartLossPx;
  options.max_steps = 15;
  const LensAdjustment adjusted =
      AdjustLens({view}, {.model = model, .intrinsics = lens, .cam_from_board = {*pose}}, options);
  placed.cam_from_board = adjusted.estimate.cam_from_board[0];
  placed.error_px = UpperMedian(CornerErrors(view, lens, placed.cam_from_board));
  return placed;
}

absl::StatusOr<LensEstimate> StartLens(LensModel model, const ImageSize& image_size_px,
                                       const std::vector<BoardView>& views) {
  const double side = std::max(image_size_px.width, image_size_px.height);
  const size_t stride = std::max<size_t>(1, views.size() / kViewsForFocal);
  double least = std::numeric_limits<double>::infinity();
  double best_focal = 0;
  for (int i = 0; i < kFocalLengths; ++i) {
    const double share = static_cast<double>(i) / (kFocalLengths - 1);
    const double focal = side * kShortestFocal * std::pow(kLongestFocal / kShortestFocal, share);
    const Intrinsics lens = PlainLens(model, image_size_px, focal);
    std::vector<double> errors;
    for (size_t v = 0; v < views.size(); v += stride) {
      errors.push_back(PlaceBoard(model, views[v], lens).error_px);
    }
    if (errors.empty()) break;
    const double error = UpperMedian(std::move(errors));
    if (error >= least) continue;
    least = error;
    best_focal = focal;
  }
  if (!(least < 0.1 * side)) {
    return absl::FailedPreconditionError(
        "no focal length places the boards before the camera: do the pictures show this board, and "
        "are they neither mirrored nor cropped differently?");
  }
  LensEstimate start;
  start.model = model;
  start.intrinsics = PlainLens(model, image_size_px, best_focal);
  for (const BoardView& view : views) {
    start.cam_from_board.push_back(PlaceBoard(model, view, start.intrinsics).cam_from_board);
  }
  return start;
}

}  // namespace rigcal
