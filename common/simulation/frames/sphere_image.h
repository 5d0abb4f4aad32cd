// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <functional>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "common/camera/intrinsics.h"
#include "common/simulation/frames/edge_profile.h"
#include "common/simulation/frames/exposure_plan.h"

namespace rigcal {

// A sphere's centre around the middle of an exposure, frame `cam`: at dt seconds from it
// centre_m + dt * velocity_m_s + dt^2 / 2 * acceleration_m_s2.
struct SphereMotion {
  Eigen::Vector3d centre_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d velocity_m_s = Eigen::Vector3d::Zero();
  Eigen::Vector3d acceleration_m_s2 = Eigen::Vector3d::Zero();
};

// A part of an image: columns [x, x + width), rows [y, y + height).
struct ImagePatch {
  int x = 0;
  int y = 0;
  int width = 0;
  int height = 0;
  bool empty() const { return width <= 0 || height <= 0; }
  bool HasRow(int row) const { return !empty() && row >= y && row < y + height; }
  bool HasColumn(int column) const { return column >= x && column < x + width; }
  // Of a pixel of the image among those of the patch, row by row.
  size_t IndexOf(int column, int row) const {
    return static_cast<size_t>(row - y) * static_cast<size_t>(width) +
           static_cast<size_t>(column - x);
  }
};

// The light of one sphere on the pixels of a patch, row by row.
struct SphereImage {
  ImagePatch patch;
  std::vector<float> cover;  // share of the exposure and of the pixel that the sphere takes
  std::vector<float> lit;    // of that, lit by the LED and weighed by its profile
  std::vector<float> spot;   // of the cover, weighed by the cosine to the directional light
  std::vector<float> halo;   // exp(-distance from the rim / halo radius), 1 inside
};

struct SphereImageOptions {
  double radius_m = 0.02;
  double limb = 0;            // 0 to 1: how much darker the rim is than the middle
  double halo_radius_px = 0;  // 0: no halo
  // Relative change of the LED's light from the middle to the rim: towards this direction, by its
  // length. In frame `cam`.
  Eigen::Vector3d led_gradient = Eigen::Vector3d::Zero();
  // Unit vector towards the directional light, frame `cam`; zero: none.
  Eigen::Vector3d spot_direction = Eigen::Vector3d::Zero();
};

// When the rows of an image are exposed: row y is `line_delay_s * (y - middle_row)` later than the
// middle of the exposure. `parts_of_row` plans a row's exposure, its dt_s from that row's middle.
struct RowTiming {
  double line_delay_s = 0;
  double middle_row = 0;
  std::function<std::vector<ExposurePart>(double delay_s)> parts_after;
};

// Images spheres through one lens. Keeps its scratch memory. One thread at a time.
class SphereImager {
 public:
  // INVALID_ARGUMENT: no pixel of the image has a ray.
  static absl::StatusOr<SphereImager> Create(const Intrinsics& intrinsics,
                                             const ImageSize& image_size);

  const Intrinsics& intrinsics() const { return intrinsics_; }
  const ImageSize& image_size() const { return image_size_; }

  // False, with an empty patch: no part of it is in the image. `profile` is the lens' blur.
  bool Draw(const SphereMotion& sphere, const RowTiming& timing, const EdgeProfile& profile,
            const SphereImageOptions& options, SphereImage* image);
  // All rows at once.
  bool Draw(const SphereMotion& sphere, std::span<const ExposurePart> parts,
            const EdgeProfile& profile, const SphereImageOptions& options, SphereImage* image);

 private:
  SphereImager(const Intrinsics& intrinsics, const ImageSize& image_size);
  ImagePatch PatchOf(const SphereMotion& sphere, std::span<const ExposurePart> parts,
                     double radius_m, double margin_px) const;
  void ReadRays(const ImagePatch& patch);
  // Rows [first_row, last_row) of the patch.
  void AddPart(const Eigen::Vector3d& centre_in_cam, const ExposurePart& part,
               const EdgeProfile& profile, const SphereImageOptions& options, size_t first_row,
               size_t last_row, SphereImage* image);
  void AddHalo(const Eigen::Vector3d& centre_in_cam, const SphereImageOptions& options,
               SphereImage* image);

  static constexpr int kGridStep = 4;
  Intrinsics intrinsics_;
  ImageSize image_size_;
  // The unit vectors in frame `cam` along which every fourth pixel looks, NaN where the lens has
  // none. Between them linear interpolation is right to some 0.001 px with the lenses of this
  // project.
  int grid_columns_;
  std::vector<Eigen::Vector3d> grid_;
  std::vector<Eigen::Vector3d> rays_;  // of the patch in work, to 1e-5 normalised
};

}  // namespace rigcal
