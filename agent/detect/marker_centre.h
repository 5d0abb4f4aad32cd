// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "agent/detect/blob_finder.h"
#include "agent/detect/image_view.h"

namespace rigcal::agent {

// A marker's image, measured from the picture's brightness. "Coverage" is the share of a pixel that
// the marker's light covers: 0 background, 1 marker.
struct MarkerCentre {
  Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();  // centroid of the marker's image
  // From the picture's noise alone.
  Eigen::Matrix2d covariance_px2 = Eigen::Matrix2d::Identity();
  double radius_px = 0;                                             // of a disc of the same area
  Eigen::Matrix2d second_moment_px2 = Eigen::Matrix2d::Identity();  // of the coverage
  // Of the coverage about its centroid, over radius^3. 0 for a sphere, whatever the blur, motion or
  // saturation; 0.04 for a sphere of which a twentieth is hidden.
  double skewness = 0;
  double skewness_sigma = 0;  // what noise makes of it
  // Squared area of the ellipse of the same second moment over the area: 1 for an ellipse, more
  // with blur and for anything else.
  double spread = 1;
  double contrast_grey = 0;  // of the plateau against the background, channels weighted
  Eigen::Vector3d colour = Eigen::Vector3d::Zero();  // contrast of each channel, unit length
  double noise_grey = 0;                             // one sigma of one pixel, channels weighted
  bool cut = false;  // the image's border cuts what had to be looked at
};

// Measures the blob's centre. Buffers are kept; one thread at a time.
//
// The background is a plane fitted to a ring around the blob, robust against what else is there.
// Where the marker covers a pixel by a share `a` the pixel is a * plateau + (1 - a) * background,
// which holds for blur, motion and defocus; so `a` is computed for each pixel and the centroid of
// `a` is taken. It is clipped from above below the plateau, so that neither noise, shading nor
// saturation inside the marker counts, which leaves a symmetric image symmetric. The ellipse in
// which it is summed follows the centroid until it rests.
class MarkerMeter {
 public:
  // False where there is nothing to measure: no contrast, or a window without background.
  bool Measure(const ImageView& image, const Blob& blob, MarkerCentre* centre);

 private:
  struct Aperture;
  bool FitBackground(const Aperture& aperture, MarkerCentre* centre);
  bool Combine(const ImageView& image, const Aperture& aperture, MarkerCentre* centre);
  bool FindCentroid(Aperture* aperture, MarkerCentre* centre);
  void MeasureShape(const Aperture& aperture, MarkerCentre* centre);

  PixelRect window_;
  std::vector<float> grey_;                          // of the window, channels weighted
  std::vector<float> coverage_;                      // of the window, clipped
  std::vector<float> values_;                        // of the ring
  Eigen::Vector3d plane_ = Eigen::Vector3d::Zero();  // background: value, d/dx, d/dy at the blob
  Eigen::Matrix2d gradient_covariance_ = Eigen::Matrix2d::Zero();  // per unit noise variance
  double plateau_grey_ = 0;
};

}  // namespace rigcal::agent
