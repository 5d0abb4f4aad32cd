// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "absl/types/span.h"
#include "agent/detect/blobs/blob_contrast.h"
#include "agent/identify/marker_centre.h"
#include "agent/identify/sphere_outline_fit.h"

namespace rigcal::agent {

// A blob of an image that was measured as a marker.
struct MeasuredMarker {
  Eigen::Vector2d blob_px = Eigen::Vector2d::Zero();  // centre of the blob
  int blob_area_px = 0;
  Eigen::Matrix2d blob_moment_px2;
  bool good = false;  // it was measured and stands out
  MarkerCentre centre;
  OutlinePixels pixels;
  bool tried = false;                    // to fit the outline
  std::optional<SphereOutline> outline;  // fitted with any slope of the light
};

// Tells whether an outline is that of a whole sphere. Beyond the image's border (`is_cut`) less of
// an outline is seen, but nothing else in its place.
bool IsOnOutline(const std::optional<SphereOutline>& outline, bool is_cut = false);

// Measures the blobs of an image as markers, each once, within a budget: centres by their pixels,
// and outlines if asked for. One thread at a time.
class MeasuredMarkers {
 public:
  // Call before the first search of an image; later searches use what was measured of it.
  void StartImage();
  // `blob_count` is the size of the spans that are passed from now on, `work` the pixels that may
  // be read (MarkerMeter::WorkOf).
  void StartSearch(size_t blob_count, double work);
  double work() const { return work_; }                 // left
  bool is_out_of_work() const { return out_of_work_; }  // something was left out for lack of work

  // Returns null if the work is used up.
  const MeasuredMarker* Measure(const ImageView& image, absl::Span<const Blob> blobs, int blob);
  // Returns a blob that was measured before.
  MeasuredMarker& OfBlob(int blob) {
    return markers_[static_cast<size_t>(index_of_[static_cast<size_t>(blob)])];
  }
  const std::optional<SphereOutline>& OutlineOf(const ImageView& image, int blob);
  SphereOutlineFitter* fitter() { return &fitter_; }

 private:
  // Fits against the background right beside a marker, in rounds that start from the last fit.
  bool FitNear(const ImageView& image, MeasuredMarker* measured, const Eigen::Matrix2d& shape_px2,
               SphereOutline* outline);
  bool MayWork(double work);

  MarkerMeter meter_;
  SphereOutlineFitter fitter_;
  std::vector<MeasuredMarker> markers_;  // the first count_ are of this image
  size_t count_ = 0;
  std::vector<int> index_of_;  // by blob of this search; -1: not measured
  double work_ = 0;
  bool out_of_work_ = false;
};

}  // namespace rigcal::agent
