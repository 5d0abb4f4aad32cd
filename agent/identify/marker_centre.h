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

// A marker's image, measured by brightness. "Coverage" is the share of a pixel that the marker's
// light covers: 0 is background, 1 is marker.
struct MarkerCentre {
  Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();  // centroid of the marker's image
  // From noise (of pixels and of the background) and skewness.
  Eigen::Matrix2d covariance_px2 = Eigen::Matrix2d::Identity();
  double radius_px = 0;                                             // of a disc of the same area
  Eigen::Matrix2d second_moment_px2 = Eigen::Matrix2d::Identity();  // of the coverage
  // Third moment of the coverage about its centroid, over radius^3: 0 for a sphere, whatever the
  // blur, motion or saturation; 0.04 for a sphere of which a twentieth is hidden.
  double skewness = 0;
  double skewness_sigma = 0;  // one sigma, from noise
  // Area of the ellipse with the same second moment, over the coverage's area: 1 for an ellipse,
  // more with blur and for any other shape.
  double spread = 1;
  Eigen::Vector3d plateau_grey = Eigen::Vector3d::Zero();  // grey levels in its middle, by channel
  double contrast_grey = 0;  // between plateau and background, norm over all channels
  double noise_grey = 0;     // one sigma of one pixel and channel
  // Steps of the background from arc to arc, one sigma over the contrast. A few large ones, such as
  // window frames, count little: the fit does not follow them.
  double background_steps = 0;
  // Share of the contrast, 0 to 1, in channels whose background is saturated.
  double saturated_behind = 0;
  double alike = 0;  // share of the pixels right outside of it that look like it, 0 to 1
  // Channels in which more than a few of the marker's pixels are saturated.
  std::array<bool, 3> saturated{};
  bool cut = false;            // the image's border cuts the marker
  bool has_neighbour = false;  // something else is near; its side and the opposite one are left out
};

// Measures the centre of a blob's marker. Buffers are kept; one thread at a time.
//
// The background is read in a ring around the blob as medians over short arcs, so that patches of
// different colours may lie behind the marker. A pixel that the marker covers by a share `a` has
// the level a * plateau + (1 - a) * background in every channel, also with blur, motion and
// defocus. `a` is computed for each pixel (least squares over the channels, with the background of
// its arc); the centre is the centroid of `a`. It is clipped well below 1, so that noise, shading
// and saturation inside the marker do not count, and well above 0, so that deviations from the
// background count little. Both leave a symmetric image symmetric. Where something else is near,
// its side and the opposite one are cut at the marker's outline. The ellipse of summation follows
// the centroid until it converges.
class MarkerMeter {
 public:
  // Starts another image, whose mosaic and blur of colour are found anew.
  void StartImage() {
    mosaic_.reset();
    mosaic_tries_ = 0;
    is_colour_blurred_.reset();
  }

  // Returns false if there is nothing to measure: no contrast, or a window without background. Of
  // large markers only every second or third pixel and row is read, because all say the same.
  bool Measure(const ImageView& image, const Blob& blob, MarkerCentre* centre);

  // Collects the pixels of the marker measured last and of its surroundings, for the fit of its
  // outline; none after a Measure that failed. A pixel behind a mosaic gives its measured channel,
  // one of an image with blurred colour its brightness, others all channels together.
  void CollectPixels(const ImageView& image, const MarkerCentre& centre, OutlinePixels* pixels);

  // The same for a marker with something else near, whatever was measured last: only pixels up to
  // close by the outline of `blob`, against the background right there. False: nothing can be read.
  bool CollectNear(const ImageView& image, const Blob& blob, const MarkerCentre& centre,
                   OutlinePixels* pixels);

  // About the number of pixels that a Measure of the blob reads.
  static double WorkOf(const Blob& blob);

 private:
  static constexpr float kSaturatedGrey = 252;

  // Step between the pixels that are read, larger for large markers.
  static int StepOf(const MarkerAperture& aperture);
  // The pixels within `reach_px` of an aperture's centre, along each axis.
  static PixelGrid GridAround(const ImageView& image, const MarkerAperture& aperture,
                              double reach_px);
  bool PlaceWindow(const ImageView& image, const MarkerAperture& aperture, MarkerCentre* centre);
  bool ReadPlateau(const ImageView& image, const MarkerAperture& aperture,
                   MarkerCentre* centre) const;
  bool Cover(const ImageView& image, const MarkerAperture& aperture, MarkerCentre* centre);
  // Finds the blob of pixels that are more marker than background, without what the mask merged.
  bool Outline(const MarkerAperture& aperture, Blob* blob);
  void Block(const MarkerAperture& aperture);  // leaves out arcs where something else is near
  void MeasureAround(const MarkerAperture& aperture, MarkerCentre* centre) const;
  bool FindCentroid(MarkerAperture* aperture, MarkerCentre* centre);
  void MeasureShape(const MarkerAperture& aperture, MarkerCentre* centre);

  // marker_pixels.cc
  struct Collection;
  void AddPixels(const ImageView& image, const Collection& how, OutlinePixels* pixels);

  PixelGrid window_;
  RingBackground background_, beside_;
  std::vector<float> coverage_;  // by pixel of the window, clipped to 0..1
  std::vector<float> gain_;      // by pixel of the window: coverage per grey level; 0 where clipped
  std::vector<uint8_t> foreign_;  // by pixel of the window: Foreign, why it is not the marker
  std::vector<uint16_t> arc_of_;  // by pixel of the window
  // One sigma of the background behind a pixel, grey levels, by arc and channel.
  std::vector<float> turns_;  // directions of a row's pixels
  std::vector<float> share_;  // by pixel of the window: coverage, not clipped
  Eigen::Matrix2d reach_ = Eigen::Matrix2d::Identity();  // the part of the window that is filled
  bool has_measured_ = false;
  std::optional<ColourMosaic> mosaic_;  // of the image
  int mosaic_tries_ = 0;
  std::optional<bool> is_colour_blurred_;
  std::optional<MarkerAperture> outlined_;  // of the last Measure
};

}  // namespace rigcal::agent
