// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "agent/detect/blobs/blob_finder.h"
#include "agent/detect/blobs/image_view.h"
#include "agent/identify/colour_mosaic.h"
#include "agent/identify/marker_aperture.h"
#include "agent/identify/outline_rows.h"
#include "agent/identify/ring_background.h"

namespace rigcal::agent {

// A marker's image, measured by brightness. "Coverage" is the share of a pixel that
// the marker's light covers: 0 background, 1 marker.
struct MarkerCentre {
  Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();  // centroid of the marker's image
  // From noise and skewness.
  Eigen::Matrix2d covariance_px2 = Eigen::Matrix2d::Identity();
  double radius_px = 0;                                             // of a disc of the same area
  Eigen::Matrix2d second_moment_px2 = Eigen::Matrix2d::Identity();  // of the coverage
  // Of the coverage about its centroid, over radius^3. 0 for a sphere, whatever the blur, motion or
  // saturation; 0.04 for a sphere of which a twentieth is hidden.
  double skewness = 0;
  double skewness_sigma = 0;  // by noise
  // Squared area of the ellipse of the same second moment over the area: 1 for an ellipse, more
  // with blur and for anything else.
  double spread = 1;
  Eigen::Vector3d plateau_grey = Eigen::Vector3d::Zero();  // in its middle, by channel
  double contrast_grey = 0;  // of the plateau against the background, over all channels
  double noise_grey = 0;     // one sigma of one pixel and channel
  // The background's steps from arc to arc, one sigma over the contrast. A few large ones, such as
  // window frames, count little: the fit does not follow them.
  double background_steps = 0;
  // Of what is around it, 0 to 1: the share of the contrast against backgrounds that are saturated.
  double saturated_behind = 0;
  double alike = 0;  // share of what is just outside of it that looks like it, 0 to 1
  // Channels of which more than a few pixels of the marker are saturated.
  std::array<bool, 3> saturated{};
  bool cut = false;            // the image's border cuts the aperture
  bool has_neighbour = false;  // something else is near; its side and the opposite are left out
};

// Measures the blob's centre. Buffers are kept; one thread at a time.
//
// The background is read in a ring around the blob, as medians over short arcs, so that patches of
// different colours may lie behind. Where the marker covers a pixel by a share `a` the pixel is
// a * plateau + (1 - a) * background in every channel, which holds for blur, motion and defocus; so
// `a` is computed for each pixel (least squares over the channels, with the background of its arc)
// and the centroid of `a` is taken, clipped well below 1, so that neither noise, shading nor
// saturation inside the marker counts, and well above 0, so that deviations from the background
// count little. Both leave a symmetric image symmetric. Where something else is near, its
// side and the opposite one are cut at the marker's outline. The ellipse in which it is summed
// follows the centroid until it converges.
class MarkerMeter {
 public:
  // Another image: whether it has a mosaic is found again.
  void StartImage() {
    mosaic_.reset();
    mosaic_tries_ = 0;
    is_colour_blurred_.reset();
  }

  // False where there is nothing to measure: no contrast, or a window without background. Of a
  // large image every second or third pixel and row is read: they say the same.
  bool Measure(const ImageView& image, const Blob& blob, MarkerCentre* centre);

  // The pixels of what was measured last and of its surroundings, for the fit of its outline; none
  // after a Measure that failed. Behind a mosaic of filters each with the one channel that was
  // measured there, else all channels together.
  void CollectPixels(const ImageView& image, const MarkerCentre& centre, OutlinePixels* pixels);

  // The same of a marker with something else near, whatever was measured last: up to close by the
  // outline of `blob`, against what is right beside it there. False: nothing can be read.
  bool CollectNear(const ImageView& image, const Blob& blob, const MarkerCentre& centre,
                   OutlinePixels* pixels);

  // Pixels that a Measure of the blob reads, about.
  static double WorkOf(const Blob& blob);

 private:
  static constexpr float kSaturatedGrey = 252;

  // Pixels of a large image are read more coarsely.
  static int StepOf(const MarkerAperture& aperture);
  // Those within `reach_px` of an aperture's centre, along each axis.
  static PixelGrid GridAround(const ImageView& image, const MarkerAperture& aperture,
                              double reach_px);
  bool PlaceWindow(const ImageView& image, const MarkerAperture& aperture, MarkerCentre* centre);
  bool ReadPlateau(const ImageView& image, const MarkerAperture& aperture,
                   MarkerCentre* centre) const;
  bool Cover(const ImageView& image, const MarkerAperture& aperture, MarkerCentre* centre);
  // The blob of the pixels that are more marker than background, without what its mask merged with.
  bool Outline(const MarkerAperture& aperture, Blob* blob);
  void Block(const MarkerAperture& aperture);
  void MeasureAround(const MarkerAperture& aperture, MarkerCentre* centre) const;
  bool FindCentroid(MarkerAperture* aperture, MarkerCentre* centre);
  void MeasureShape(const MarkerAperture& aperture, MarkerCentre* centre);

  // marker_pixels.cc
  struct Collection;
  void AddPixels(const ImageView& image, const Collection& how, OutlinePixels* pixels);

  PixelGrid window_;
  RingBackground background_, beside_;
  std::vector<float> coverage_;  // of the window, clipped
  std::vector<float> gain_;      // of the window: coverage per grey level of noise; 0 where clipped
  std::vector<uint8_t> foreign_;  // of the window: what cannot be the marker outside of it
  std::vector<uint16_t> arc_of_;  // of the window
  // By arc and channel, one sigma of the background behind a pixel.
  std::vector<Eigen::Vector3f> unsure_grey_;
  std::vector<float> turns_;         // of a row of pixels
  std::vector<float> share_;         // of the window: coverage, not clipped
  Eigen::Matrix2d reach_ = Eigen::Matrix2d::Identity();  // what of the window is filled
  bool has_measured_ = false;
  std::optional<ColourMosaic> mosaic_;  // of the image
  int mosaic_tries_ = 0;
  std::optional<bool> is_colour_blurred_;
  std::optional<MarkerAperture> outlined_;  // of the last Measure
};

}  // namespace rigcal::agent
