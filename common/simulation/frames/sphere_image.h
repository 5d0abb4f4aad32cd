// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "common/camera/intrinsics.h"
#include "common/simulation/frames/edge_profile.h"
#include "common/simulation/frames/exposure_plan.h"
#include "common/simulation/frames/ray_grid.h"
#include "common/simulation/frames/scene_renderer.h"

namespace rigcal {

// A part of an image: columns [x, x + width), rows [y, y + height).
struct ImagePatch {
  int x = 0;
  int y = 0;
  int width = 0;
  int height = 0;
  bool empty() const { return width <= 0 || height <= 0; }
};

// The light of one sphere on the pixels of a patch, row by row.
struct SphereImage {
  ImagePatch patch;
  std::vector<float> cover;  // share of the exposure and of the pixel that the sphere takes
  std::vector<float> lit;    // of that, lit by the LED and weighed by the limb profile
  std::vector<float> halo;   // exp(-distance from the rim / halo radius), 1 inside
};

struct SphereImageOptions {
  double radius_m = 0.02;
  double limb = 0;            // 0 to 1: how much darker the rim is than the middle
  double halo_radius_px = 0;  // 0: no halo
};

// Points `count` rays that touch the sphere, evenly about its axis; false where the camera is in
// or too near to it.
bool SphereRim(const Eigen::Vector3d& centre_in_cam, double radius_m, int count,
               std::vector<Eigen::Vector3d>* rim);

// Images spheres through one lens. Keeps its scratch memory. One thread at a time.
class SphereImager {
 public:
  // Both must outlive the imager.
  SphereImager(const Intrinsics* intrinsics, const ImageSize& image_size, const RayGrid* rays);

  // False, with an empty patch: no part of it is in the image. `profile` is the lens' blur.
  bool Draw(const SphereMotion& sphere, std::span<const ExposurePart> parts,
            const EdgeProfile& profile, const SphereImageOptions& options, SphereImage* image);

 private:
  ImagePatch PatchOf(const SphereMotion& sphere, std::span<const ExposurePart> parts,
                     double radius_m, double margin_px);
  void ReadRays(const ImagePatch& patch);
  void AddPart(const Eigen::Vector3d& centre_in_cam, const ExposurePart& part,
               const EdgeProfile& profile, const SphereImageOptions& options, SphereImage* image);
  void AddHalo(const Eigen::Vector3d& centre_in_cam, const SphereImageOptions& options,
               SphereImage* image);

  const Intrinsics* intrinsics_;
  ImageSize image_size_;
  const RayGrid* grid_;
  std::vector<Eigen::Vector3d> rays_;
  std::vector<Eigen::Vector3d> rim_;
};

}  // namespace rigcal
