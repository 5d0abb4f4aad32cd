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

// A blob of an image, taken for a marker.
struct MeasuredMarker {
  Eigen::Vector2d blob_px = Eigen::Vector2d::Zero();  // where and how large the blob is
  int blob_area_px = 0;
  Eigen::Matrix2d blob_moment_px2;
  bool good = false;
  MarkerCentre centre;
  OutlinePixels pixels;
  bool tried = false;                    // to fit
  std::optional<SphereOutline> outline;  // shaded
  // How far the background right beside it moved it, against what is further away.
  Eigen::Vector2d moved_px = Eigen::Vector2d::Zero();
};

// A whole sphere's outline. Beyond the border (`is_cut`) there is nothing to be seen of an outline,
// but nothing else either.
bool IsOnOutline(const std::optional<SphereOutline>& outline, bool is_cut = false);

// Measures the blobs of an image as markers, each once, within a budget: centres by their pixels,
// outlines where those are asked for. One thread at a time.
class MeasuredMarkers {
 public:
  // Before the first search of an image. What was measured of it is not measured again.
  void StartImage();
  // `blob_count`: of the span that is passed from now on. `work`: pixels that may be read
  // (MarkerMeter::WorkOf).
  void StartSearch(size_t blob_count, double work);
  double work() const { return work_; }                 // left
  bool is_out_of_work() const { return out_of_work_; }  // something was left out for it

  // Null where the work is used up.
  const MeasuredMarker* Measure(const ImageView& image, absl::Span<const Blob> blobs, int blob);
  // Of a blob that was measured.
  MeasuredMarker& OfBlob(int blob) {
    return markers_[static_cast<size_t>(index_of_[static_cast<size_t>(blob)])];
  }
  const std::optional<SphereOutline>& OutlineOf(const ImageView& image, int blob);
  // Fits the outline again, against what is right beside it, where that differs around the marker.
  void FitBeside(const ImageView& image, int blob);
  SphereOutlineFitter* fitter() { return &fitter_; }

 private:
  // Fits against what is right beside a marker, in rounds: each where the one before found it.
  bool FitNear(const ImageView& image, MeasuredMarker* measured, const Eigen::Matrix2d& shape_px2,
               SphereOutline* outline);
  bool MayWork(double work);

  MarkerMeter meter_;
  SphereOutlineFitter fitter_;
  OutlinePixels beside_;
  std::vector<MeasuredMarker> markers_;  // the first count_ are of this image
  size_t count_ = 0;
  std::vector<int> index_of_;  // by blob of this search; -1: not measured
  double work_ = 0;
  bool out_of_work_ = false;
};

}  // namespace rigcal::agent
