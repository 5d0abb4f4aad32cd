// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "absl/types/span.h"
#include "agent/detect/blobs/blob_contrast.h"
#include "agent/identify/marker_centre.h"
#include "agent/identify/sphere_outline_fit.h"
#include "agent/identify/verified_wand.h"
#include "agent/identify/wand_mechanisms.h"

namespace rigcal::agent {

// A blob of an image, taken for a marker.
struct MeasuredMarker {
  Eigen::Vector2d blob_px = Eigen::Vector2d::Zero();  // where and how large the blob is
  int blob_area_px = 0;
  Eigen::Matrix2d blob_moment_px2;
  bool good = false;
  MarkerCentre centre;
  OutlinePixels pixels;
  bool tried = false, retried = false;   // to fit
  std::optional<SphereOutline> outline;  // shaded
  // By its colour without white (OutlineByColour).
  std::optional<SphereOutline> coloured;
  OutlinePixels coloured_pixels;
  bool tried_colour = false;
  // How far the background right beside it moved it, against what is further away.
  Eigen::Vector2d moved_px = Eigen::Vector2d::Zero();
  std::optional<Blob> beside;  // another marker that it overlaps with
};

// A whole sphere's outline. Beyond the border (`is_cut`) there is nothing to be seen of an outline,
// but nothing else either. Of one of the size that the others say less will do.
bool IsOnOutline(const std::optional<SphereOutline>& outline, bool is_cut = false);

// Nearly all around.
bool IsClearlySeen(const std::optional<SphereOutline>& outline);

// Measures the blobs of an image as markers, each once, within a budget: centres by their pixels,
// outlines where those are asked for. One thread at a time.
class MeasuredMarkers {
 public:
  // Before the first search of an image. What was measured of it is not measured again.
  void StartImage();
  void SetWithout(const WandMechanisms& without) { without_ = without; }
  // `blob_count`: of the span that is passed from now on. `work`: pixels that may be read
  // (MarkerMeter::WorkOf).
  void StartSearch(size_t blob_count, double work);
  // What differs less from its surroundings is no marker.
  void RequireContrast(double grey) { min_contrast_grey_ = grey; }
  double work() const { return work_; }                 // left
  bool is_out_of_work() const { return out_of_work_; }  // something was left out for it

  // Null where the work is used up.
  const MeasuredMarker* Measure(const ImageView& image, absl::Span<const Blob> blobs, int blob);
  // Of a blob that was measured.
  MeasuredMarker& OfBlob(int blob) {
    return markers_[static_cast<size_t>(index_of_[static_cast<size_t>(blob)])];
  }
  const std::optional<SphereOutline>& OutlineOf(const ImageView& image, int blob);
  // The same of a marker of a wand, whose others say how large and how blurred it is where it
  // cannot be told from what is around it.
  const std::optional<SphereOutline>& OutlineIn(const ImageView& image, const VerifiedWand& wand,
                                                size_t marker);
  // The outline of its colour without white, where it is pale against what is behind it, if that is
  // a whole sphere's: white light on it leaves a part of its edge as bright as what is behind.
  const std::optional<SphereOutline>& OutlineByColour(const ImageView& image, int blob);
  // Makes that its outline.
  void TakeColour(int blob);
  // The same where clearly more of it is seen so.
  void PreferColour(const ImageView& image, int blob);
  // Fits the outline again, against what is right beside it, where that differs around the marker.
  void FitBeside(const ImageView& image, int blob);
  SphereOutlineFitter* fitter() { return &fitter_; }

 private:
  bool ExpectFromOthers(const ImageView& image, const VerifiedWand& wand, size_t marker,
                        OutlineExpectation* expected, Eigen::Matrix2d* second_moment_px2);
  // A fit against what is right beside a marker, in rounds: each where the one before found it.
  struct NearFit {
    Blob around;                // where it begins
    Eigen::Matrix2d shape_px2;  // second moment, for the first fit
    OutlineExpectation expected = {};
    bool by_colour = false;
    double least_on = 0;  // SphereOutline::on_outline, or there is none
  };
  bool FitNear(const ImageView& image, const MeasuredMarker& measured, const NearFit& fit,
               OutlinePixels* pixels, SphereOutline* outline);
  bool MayWork(double work);

  MarkerMeter meter_;
  SphereOutlineFitter fitter_;
  OutlinePixels retry_;
  std::vector<MeasuredMarker> markers_;  // the first count_ are of this image
  size_t count_ = 0;
  std::vector<int> index_of_;  // by blob of this search; -1: not measured
  double work_ = 0, min_contrast_grey_ = kMinContrastGrey;
  bool out_of_work_ = false;
  WandMechanisms without_;
};

}  // namespace rigcal::agent
