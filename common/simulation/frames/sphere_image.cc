// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/frames/sphere_image.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>

#include "common/camera/camera_model.h"

namespace rigcal {
namespace {

constexpr int kRimPoints = 16;
constexpr double kNearestRadii = 1.5;
// A spot smaller than the blur is no edge any more; it stays a spot.
constexpr double kMaxCurveShare = 0.4;
constexpr double kHaloReach = 5;  // radii; what is left is below one per cent

Eigen::Vector3d CentreAt(const SphereMotion& sphere, double dt_s) {
  return sphere.centre_m + dt_s * sphere.velocity_m_s +
         0.5 * dt_s * dt_s * sphere.acceleration_m_s2;
}

// How far inside a straight edge the light comes from, in the mean, that a Gaussian blur brings to
// a point `depth_px` inside of it (negative: outside).
double MeanDepth(double depth_px, double blur_px) {
  const double z = depth_px / blur_px;
  if (z < -5) return 0;
  const double density = std::exp(-0.5 * z * z) / std::sqrt(2 * std::numbers::pi);
  return depth_px + blur_px * density / (0.5 * std::erfc(-z / std::numbers::sqrt2));
}

// A sphere as rays see it. Distances between unit vectors stand for angles: near the rim of a small
// sphere they lose no digits, as cosines do.
struct Cone {
  Eigen::Vector3d axis;
  double rim = 0;  // |ray - axis| on the outline

  Cone(const Eigen::Vector3d& centre_in_cam, double radius_m) {
    const double distance = centre_in_cam.norm();
    axis = centre_in_cam / distance;
    rim = 2 * std::sin(0.5 * std::asin(std::min(1.0, radius_m / distance)));
  }
};

}  // namespace

absl::StatusOr<SphereImager> SphereImager::Create(const Intrinsics& intrinsics,
                                                  const ImageSize& image_size) {
  SphereImager imager(intrinsics, image_size);
  if (std::ranges::any_of(imager.grid_, &Eigen::Vector3d::allFinite)) return imager;
  return absl::InvalidArgumentError("the lens model gives no pixel of the image a direction");
}

SphereImager::SphereImager(const Intrinsics& intrinsics, const ImageSize& image_size)
    : intrinsics_(intrinsics),
      image_size_(image_size),
      grid_columns_(static_cast<int>(image_size.width) / kGridStep + 2) {
  const int rows = static_cast<int>(image_size.height) / kGridStep + 2;
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < grid_columns_; ++column) {
      const auto direction = Undistort(intrinsics, Eigen::Vector2d(column, row) * kGridStep);
      Eigen::Vector3d& ray = grid_.emplace_back();
      if (direction.ok()) {
        ray = direction->homogeneous().normalized();
      } else {
        ray.setConstant(std::numeric_limits<double>::quiet_NaN());
      }
    }
  }
}

ImagePatch SphereImager::PatchOf(const SphereMotion& sphere, std::span<const ExposurePart> parts,
                                 double radius_m, double margin_px) const {
  Eigen::Array2d low = Eigen::Array2d::Constant(std::numeric_limits<double>::infinity());
  Eigen::Array2d high = -low;
  for (const size_t index : {size_t{0}, parts.size() / 2, parts.size() - 1}) {
    const Eigen::Vector3d centre = CentreAt(sphere, parts[index].dt_s);
    const double distance = centre.norm();
    if (!(distance > kNearestRadii * radius_m)) return {};
    const Eigen::Vector3d axis = centre / distance;
    const Eigen::Vector3d across = axis.unitOrthogonal(), other = axis.cross(across);
    const double sine = radius_m / distance, cosine = std::sqrt(1 - sine * sine);
    for (int i = 0; i < kRimPoints; ++i) {
      const double turn = 2 * std::numbers::pi * i / kRimPoints;
      Eigen::Vector2d pixel;
      if (!Project(intrinsics_,
                   cosine * axis + sine * (std::cos(turn) * across + std::sin(turn) * other),
                   &pixel)) {
        continue;
      }
      low = low.min(pixel.array());
      high = high.max(pixel.array());
    }
  }
  // Between two points of the outline it bulges by less than two per cent of its width.
  const Eigen::Array2d margin = margin_px + 1 + 0.02 * (high - low);
  const Eigen::Array2d last(image_size_.width - 1.0, image_size_.height - 1.0);
  low = (low - margin).max(0.0);
  high = (high + margin).min(last);
  if (!((high - low) >= 0).all()) return {};
  ImagePatch patch;
  patch.x = static_cast<int>(low.x());
  patch.y = static_cast<int>(low.y());
  patch.width = static_cast<int>(high.x()) - patch.x + 1;
  patch.height = static_cast<int>(high.y()) - patch.y + 1;
  // Two columns and rows at least: the rays' slopes are their differences.
  if (patch.width < 2) patch.x -= patch.x > 0 ? 1 : 0, patch.width = 2;
  if (patch.height < 2) patch.y -= patch.y > 0 ? 1 : 0, patch.height = 2;
  return patch;
}

void SphereImager::ReadRays(const ImagePatch& patch) {
  rays_.resize(static_cast<size_t>(patch.width) * static_cast<size_t>(patch.height));
  size_t i = 0;
  for (int y = patch.y; y < patch.y + patch.height; ++y) {
    const Eigen::Vector3d* upper = &grid_[static_cast<size_t>(y / kGridStep * grid_columns_)];
    const Eigen::Vector3d* lower = upper + grid_columns_;
    const double down = static_cast<double>(y % kGridStep) / kGridStep;
    for (int x = patch.x; x < patch.x + patch.width; ++x, ++i) {
      const int cell = x / kGridStep;
      const double right = static_cast<double>(x % kGridStep) / kGridStep;
      rays_[i] = (1 - down) * ((1 - right) * upper[cell] + right * upper[cell + 1]) +
                 down * ((1 - right) * lower[cell] + right * lower[cell + 1]);
    }
  }
}

void SphereImager::AddPart(const Eigen::Vector3d& centre_in_cam, const ExposurePart& part,
                           const EdgeProfile& profile, const SphereImageOptions& options,
                           size_t first_row, size_t last_row, SphereImage* image) {
  const Cone cone(centre_in_cam, options.radius_m);
  const auto width = static_cast<size_t>(image->patch.width);
  const auto height = static_cast<size_t>(image->patch.height);
  const size_t middle = (height / 2) * width + width / 2;
  const double step = std::max((rays_[middle] - rays_[middle - 1]).norm(),
                               (rays_[middle] - rays_[middle - width]).norm());
  // Of rays that are surely beyond the blurred rim, or surely within; NaN is neither.
  const double band = 1.2 * (profile.reach_px() + 0.5) * step;
  const double outside = std::pow(cone.rim + band, 2);
  const double inside = std::pow(std::max(0.0, cone.rim - band), 2);
  const double rim_squared = cone.rim * cone.rim;
  const auto share = static_cast<float>(part.share);
  const auto lit = static_cast<float>(part.lit_share);
  const auto limb = static_cast<float>(options.limb);
  const bool uneven = options.led_gradient.squaredNorm() > 0;
  const bool spot = options.spot_direction.squaredNorm() > 0;
  const double blur_px = std::sqrt(profile.variance_px2());
  for (size_t row = first_row, i = first_row * width; row < last_row; ++row) {
    for (size_t column = 0; column < width; ++column, ++i) {
      const Eigen::Vector3d away = rays_[i] - cone.axis;
      const double squared = away.squaredNorm();
      if (!(squared < outside)) continue;
      float cover = 1;
      double from_px = std::numeric_limits<double>::infinity(), px_per_unit = 1;
      if (squared > inside) {
        const Eigen::Vector3d across =
            column > 0 ? rays_[i] - rays_[i - 1] : rays_[i + 1] - rays_[i];
        const Eigen::Vector3d down =
            row > 0 ? rays_[i] - rays_[i - width] : rays_[i + width] - rays_[i];
        const double slope_squared = std::pow(away.dot(across), 2) + std::pow(away.dot(down), 2);
        if (slope_squared > 0) {
          px_per_unit = std::sqrt(squared / slope_squared);
          from_px = (cone.rim - std::sqrt(squared)) * px_per_unit;
          const double radius_px = cone.rim * px_per_unit;
          const double curved_px =
              std::min(profile.variance_px2() / (2 * radius_px), kMaxCurveShare * radius_px);
          cover = profile.At(static_cast<float>(from_px - curved_px));
        }
      }
      const auto height_over_rim =
          static_cast<float>(std::sqrt(std::max(0.0, 1 - squared / rim_squared)));
      image->cover[i] += share * cover;
      float led = lit * cover * (1 - limb * (1 - height_over_rim));
      if (uneven || spot) {
        // The surface's normal there: the sphere is small against its distance. What blur spreads
        // over the rim comes from the sphere.
        Eigen::Vector3d lit_from = away;
        if (std::isfinite(from_px)) {
          const double lit_px = MeanDepth(from_px, blur_px);
          lit_from *= std::max(0.0, cone.rim - lit_px / px_per_unit) / std::sqrt(squared);
        }
        const double sine_squared = lit_from.squaredNorm() / rim_squared;
        const Eigen::Vector3d normal =
            lit_from / cone.rim - std::sqrt(std::max(0.0, 1 - sine_squared)) * cone.axis;
        if (uneven) {
          led *= static_cast<float>(std::max(0.0, 1 + options.led_gradient.dot(normal)));
        }
        if (spot) {
          image->spot[i] +=
              share * cover * static_cast<float>(std::max(0.0, options.spot_direction.dot(normal)));
        }
      }
      image->lit[i] += led;
    }
  }
}

void SphereImager::AddHalo(const Eigen::Vector3d& centre_in_cam, const SphereImageOptions& options,
                           SphereImage* image) {
  const Cone cone(centre_in_cam, options.radius_m);
  const auto width = static_cast<size_t>(image->patch.width);
  const auto height = static_cast<size_t>(image->patch.height);
  const size_t middle = (height / 2) * width + width / 2;
  const double step = 0.5 * ((rays_[middle] - rays_[middle - 1]).norm() +
                             (rays_[middle] - rays_[middle - width]).norm());
  for (size_t i = 0; i < rays_.size(); ++i) {
    const double beyond_px = ((rays_[i] - cone.axis).norm() - cone.rim) / step;
    if (!std::isfinite(beyond_px)) continue;
    image->halo[i] =
        static_cast<float>(std::exp(-std::max(0.0, beyond_px) / options.halo_radius_px));
  }
}

bool SphereImager::Draw(const SphereMotion& sphere, const RowTiming& timing,
                        const EdgeProfile& profile, const SphereImageOptions& options,
                        SphereImage* image) {
  const bool rolling = timing.line_delay_s != 0;
  std::vector<ExposurePart> parts = timing.parts_after(0);
  // Where the first and the last row could see it.
  std::vector<ExposurePart> reach = parts;
  if (rolling) {
    const double half_s = std::abs(timing.line_delay_s) * 0.5 * image_size_.height;
    reach.front().dt_s -= half_s;
    reach.back().dt_s += half_s;
    if (reach.size() == 1) reach.push_back(reach.front()), reach.back().dt_s += 2 * half_s;
  }
  image->patch = PatchOf(sphere, reach, options.radius_m,
                         std::max<double>(profile.reach_px(), kHaloReach * options.halo_radius_px));
  if (image->patch.empty()) return false;
  ReadRays(image->patch);
  image->cover.assign(rays_.size(), 0);
  image->lit.assign(rays_.size(), 0);
  image->spot.assign(rays_.size(), 0);
  image->halo.assign(rays_.size(), 0);
  const auto height = static_cast<size_t>(image->patch.height);
  if (!rolling) {
    for (const ExposurePart& part : parts) {
      AddPart(CentreAt(sphere, part.dt_s), part, profile, options, 0, height, image);
    }
  } else {
    for (size_t row = 0; row < height; ++row) {
      const double delay_s =
          timing.line_delay_s * (image->patch.y + static_cast<double>(row) - timing.middle_row);
      parts = timing.parts_after(delay_s);
      for (const ExposurePart& part : parts) {
        AddPart(CentreAt(sphere, delay_s + part.dt_s), part, profile, options, row, row + 1, image);
      }
    }
  }
  if (options.halo_radius_px > 0) AddHalo(sphere.centre_m, options, image);
  return true;
}

bool SphereImager::Draw(const SphereMotion& sphere, std::span<const ExposurePart> parts,
                        const EdgeProfile& profile, const SphereImageOptions& options,
                        SphereImage* image) {
  RowTiming timing;
  timing.parts_after = [parts](double) {
    return std::vector<ExposurePart>(parts.begin(), parts.end());
  };
  return Draw(sphere, timing, profile, options, image);
}

}  // namespace rigcal
