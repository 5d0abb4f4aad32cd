// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/measured_markers.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "agent/identify/squared.h"

namespace rigcal::agent {
namespace {

constexpr double kLeastOnOutline = 0.6;   // least share of the sectors of a whole sphere
constexpr double kMostOffOutline = 0.15;  // largest share of them off the outline
// With hardly any sector off the outline, the remaining ones may look like their background.
constexpr double kLeastOnClearOutline = 0.55, kMostOffClearOutline = 0.03;
constexpr double kLeastOfCutOutline = 0.5, kMostOffCutOutline = 0.07;  // at the image's border
constexpr double kMostStretch = 0.12, kMostStretchPx = 0.5;  // limit: first + second / radius
constexpr double kHardlyOnOutline = 0.4;  // while the marker's surroundings are not known
constexpr int kNearRounds = 2;
constexpr double kBrighterBehind = 0.5;  // saturated_behind, above which only near pixels are used
constexpr double kWorkOfFit = 500;       // in pixels that a measurement reads

}  // namespace

bool IsOnOutline(const std::optional<SphereOutline>& outline, bool is_cut) {
  if (!outline) return false;
  const double least =
      outline->off_outline > kMostOffClearOutline ? kLeastOnOutline : kLeastOnClearOutline;
  return outline->on_outline >= (is_cut ? kLeastOfCutOutline : least) &&
         outline->off_outline <= (is_cut ? kMostOffCutOutline : kMostOffOutline) &&
         outline->stretch.norm() <= kMostStretch + kMostStretchPx / outline->radius_px;
}

void MeasuredMarkers::StartImage() {
  count_ = 0;
  meter_.StartImage();
}

void MeasuredMarkers::StartSearch(size_t blob_count, double work) {
  index_of_.assign(blob_count, -1);
  work_ = work;
  out_of_work_ = false;
}

bool MeasuredMarkers::MayWork(double work) {
  if (work > work_) {
    out_of_work_ = true;
    return false;
  }
  work_ -= work;
  return true;
}

const MeasuredMarker* MeasuredMarkers::Measure(const ImageView& image, absl::Span<const Blob> blobs,
                                               int blob) {
  int& index = index_of_[static_cast<size_t>(blob)];
  const Blob& seen = blobs[static_cast<size_t>(blob)];
  for (size_t i = 0; index < 0 && i < count_; ++i) {
    const bool same =
        markers_[i].blob_px == seen.centre_px && markers_[i].blob_area_px == seen.area_px;
    if (same) index = static_cast<int>(i);
  }
  if (index >= 0) return &markers_[static_cast<size_t>(index)];
  const double work = MarkerMeter::WorkOf(seen);
  if (!MayWork(work)) return nullptr;
  if (count_ == markers_.size()) markers_.emplace_back();
  index = static_cast<int>(count_);
  MeasuredMarker& measured = markers_[count_++];
  measured.blob_px = seen.centre_px;
  measured.blob_area_px = seen.area_px;
  measured.blob_moment_px2 = seen.second_moment_px2;
  measured.tried = false;
  measured.outline.reset();
  measured.good = meter_.Measure(image, seen, &measured.centre) &&
                  measured.centre.contrast_grey >= kMinContrastGrey;
  if (measured.good) meter_.CollectPixels(image, measured.centre, &measured.pixels);
  return &measured;
}

const std::optional<SphereOutline>& MeasuredMarkers::OutlineOf(const ImageView& image, int blob) {
  MeasuredMarker& measured = OfBlob(blob);
  if (measured.tried) return measured.outline;
  const MarkerCentre& centre = measured.centre;
  // Before a brighter background only pixels close to the outline are collected.
  const bool is_near = centre.has_neighbour || centre.saturated_behind > kBrighterBehind;
  if (!MayWork(kWorkOfFit * (is_near ? kNearRounds : 1))) return measured.outline;
  measured.tried = true;
  SphereOutline outline{.centre_px = centre.centre_px, .radius_px = centre.radius_px};
  Eigen::Matrix2d second_moment_px2 = centre.second_moment_px2;
  // What the border leaves of a disc does not show its shape.
  if (centre.cut) {
    second_moment_px2 = 0.25 * Squared(centre.radius_px) * Eigen::Matrix2d::Identity();
  }
  const bool is_found = is_near ? FitNear(image, &measured, second_moment_px2, &outline)
                                : fitter_.Fit(measured.pixels, second_moment_px2, {}, &outline);
  if (is_found) measured.outline = outline;
  return measured.outline;
}

// What is beside a marker is known only when its place is known, so the fit is repeated.
bool MeasuredMarkers::FitNear(const ImageView& image, MeasuredMarker* measured,
                              const Eigen::Matrix2d& shape_px2, SphereOutline* outline) {
  Blob around;
  around.centre_px = measured->centre.centre_px;
  around.second_moment_px2 = measured->centre.second_moment_px2;
  for (int round = 0; round < kNearRounds; ++round) {
    outline->parameters.setZero();
    if (!meter_.CollectNear(image, around, measured->centre, &measured->pixels) ||
        !fitter_.Fit(measured->pixels, round == 0 ? shape_px2 : around.second_moment_px2, {},
                     outline) ||
        outline->on_outline < kHardlyOnOutline) {
      return false;
    }
    around.centre_px = outline->centre_px;
    around.second_moment_px2 = outline->SecondMoment();
  }
  return true;
}

}  // namespace rigcal::agent
