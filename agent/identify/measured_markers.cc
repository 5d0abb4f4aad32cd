// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/measured_markers.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "agent/identify/overlapping_markers.h"
#include "agent/identify/squared.h"

namespace rigcal::agent {
namespace {

constexpr double kLeastOnOutline = 0.6;  // of the sectors of a whole sphere
constexpr double kMostOffOutline = 0.15;
// Where hardly any is elsewhere the others may be like what is behind them.
constexpr double kLeastOnClearOutline = 0.55, kMostOffClearOutline = 0.03;
constexpr double kLeastOnByOthers = 0.4;  // of the size that the others say
constexpr double kLeastOfCutOutline = 0.5, kMostOffCutOutline = 0.07;
constexpr double kMostStretch = 0.12, kMostStretchPx = 0.5;
constexpr double kHardlyOnOutline = 0.4;  // before it is known what is beside it
constexpr int kNearRounds = 2;
constexpr double kBrighterBehind = 0.5;  // of the contrast, where that is saturated
// Contrast, of the brightness: what is behind it is bright, too.
constexpr double kPale = 0.66;
constexpr double kClearlySeen = 0.85, kMoreSeen = 0.2;  // of an edge
constexpr double kUnevenBackground = 0.04;              // steps, of the contrast
constexpr double kMostEdgePx = 1;  // the blur of a softer one reaches what is beside it
// What the other spheres say of one.
constexpr double kByOthersRadiusPx = 0.1, kByOthersRadiusShare = 0.03, kOtherStretch = 0.03,
                 kOtherEdgePx2 = 0.3;
constexpr double kWorkOfFit = 500;  // in the pixels that a measurement reads

}  // namespace

bool IsOnOutline(const std::optional<SphereOutline>& outline, bool is_cut) {
  if (!outline) return false;
  const double least = outline->off_outline > kMostOffClearOutline ? kLeastOnOutline
                       : outline->by_others                        ? kLeastOnByOthers
                                                                   : kLeastOnClearOutline;
  return outline->on_outline >= (is_cut ? kLeastOfCutOutline : least) &&
         outline->off_outline <= (is_cut ? kMostOffCutOutline : kMostOffOutline) &&
         outline->stretch.norm() <= kMostStretch + kMostStretchPx / outline->radius_px;
}

bool IsClearlySeen(const std::optional<SphereOutline>& outline) {
  return outline && outline->on_outline >= kClearlySeen &&
         outline->off_outline <= kMostOffClearOutline;
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
  measured.tried = measured.retried = false;
  measured.tried_colour = false;
  measured.outline.reset();
  measured.coloured.reset();
  measured.beside.reset();
  measured.moved_px.setZero();
  measured.good = meter_.Measure(image, seen, &measured.centre) &&
                  measured.centre.contrast_grey >= min_contrast_grey_;
  if (measured.good) meter_.CollectPixels(image, measured.centre, &measured.pixels);
  return &measured;
}

const std::optional<SphereOutline>& MeasuredMarkers::OutlineOf(const ImageView& image, int blob) {
  MeasuredMarker& measured = OfBlob(blob);
  if (measured.tried) return measured.outline;
  const MarkerCentre& centre = measured.centre;
  // Of a background that is brighter only pixels near by are collected.
  const bool is_near = centre.has_neighbour || centre.saturated_behind > kBrighterBehind;
  if (!MayWork(kWorkOfFit * (is_near ? kNearRounds : 1))) return measured.outline;
  measured.tried = true;
  SphereOutline outline{.centre_px = centre.centre_px, .radius_px = centre.radius_px};
  Eigen::Matrix2d second_moment_px2 = centre.second_moment_px2;
  // What the border leaves of a disc says nothing of its shape.
  if (centre.cut) {
    second_moment_px2 = 0.25 * Squared(centre.radius_px) * Eigen::Matrix2d::Identity();
  }
  if (!is_near && !measured.beside) {
    if (fitter_.Fit(measured.pixels, second_moment_px2, {}, &outline)) {
      measured.outline = outline;
    }
    return measured.outline;
  }
  Blob around;
  around.centre_px = centre.centre_px;
  around.second_moment_px2 = centre.second_moment_px2;
  if (FitNear(image, measured,
              {.around = around, .shape_px2 = second_moment_px2, .least_on = kHardlyOnOutline},
              &measured.pixels, &outline)) {
    measured.outline = outline;
  }
  return measured.outline;
}

// What is beside a marker can be told once it is known where that is.
bool MeasuredMarkers::FitNear(const ImageView& image, const MeasuredMarker& measured,
                              const NearFit& fit, OutlinePixels* pixels, SphereOutline* outline) {
  Blob around = fit.around;
  for (int round = 0; round < kNearRounds; ++round) {
    outline->parameters.setZero();
    if (!meter_.CollectNear(image, around, measured.centre, pixels, fit.by_colour)) return false;
    if (measured.beside) LeaveOutBeyond(around, *measured.beside, pixels);
    if (!fitter_.Fit(*pixels, round == 0 ? fit.shape_px2 : around.second_moment_px2, {}, outline,
                     fit.expected) ||
        outline->on_outline < fit.least_on) {
      return false;
    }
    around.centre_px = outline->centre_px;
    around.second_moment_px2 = outline->SecondMoment();
  }
  return true;
}

bool MeasuredMarkers::ExpectFromOthers(const ImageView& image, const VerifiedWand& wand,
                                       size_t marker, OutlineExpectation* expected,
                                       Eigen::Matrix2d* second_moment_px2) {
  if (wand.px_per_m.size() != wand.blobs.size()) return false;
  *expected = OutlineExpectation();
  second_moment_px2->setZero();
  int count = 0;
  for (size_t k = 0; k < wand.blobs.size(); ++k) {
    if (k == marker || !wand.whole[k]) continue;
    const auto& outline = OutlineOf(image, wand.blobs[k]);
    if (!IsOnOutline(outline)) continue;
    const double scale = wand.px_per_m[marker] / wand.px_per_m[k];
    expected->radius_px += scale * outline->radius_px;
    expected->stretch += outline->stretch;
    expected->edge_px2 += Squared(outline->edge_px);
    *second_moment_px2 += Squared(scale) * outline->SecondMoment();
    ++count;
  }
  if (count == 0 || count + 1 < static_cast<int>(wand.blobs.size())) return false;
  expected->radius_px /= count;
  expected->stretch /= count;
  expected->edge_px2 /= count;
  *second_moment_px2 /= count;
  expected->radius_sigma_px = kByOthersRadiusPx + kByOthersRadiusShare * expected->radius_px;
  expected->stretch_sigma = kOtherStretch;
  expected->edge_sigma_px2 = kOtherEdgePx2;
  return true;
}

const std::optional<SphereOutline>& MeasuredMarkers::OutlineIn(const ImageView& image,
                                                               const VerifiedWand& wand,
                                                               size_t marker) {
  const auto& outline = OutlineOf(image, wand.blobs[marker]);
  MeasuredMarker& measured = OfBlob(wand.blobs[marker]);
  const MarkerCentre& centre = measured.centre;
  OutlineExpectation expected;
  Blob around;
  if (without_.Has(WandMechanism::kOutlinesByOthers) || IsOnOutline(outline) || measured.retried ||
      !measured.tried ||
      !ExpectFromOthers(image, wand, marker, &expected, &around.second_moment_px2)) {
    return outline;
  }
  if (!MayWork(kWorkOfFit * kNearRounds)) return outline;
  measured.retried = true;
  around.centre_px = centre.centre_px;
  SphereOutline again{.centre_px = centre.centre_px, .radius_px = expected.radius_px};
  if (!FitNear(image, measured,
               {.around = around, .shape_px2 = around.second_moment_px2, .expected = expected},
               &retry_, &again)) {
    return outline;
  }
  if (!IsOnOutline(again)) return outline;
  measured.outline = again;
  std::swap(measured.pixels, retry_);
  return measured.outline;
}

const std::optional<SphereOutline>& MeasuredMarkers::OutlineByColour(const ImageView& image,
                                                                     int blob) {
  MeasuredMarker& measured = OfBlob(blob);
  const MarkerCentre& centre = measured.centre;
  if (measured.tried_colour || centre.cut || image.format != PixelFormat::kBgr8 ||
      centre.contrast_grey > kPale * centre.plateau_grey.norm() ||
      !MayWork(kWorkOfFit * kNearRounds)) {
    return measured.coloured;
  }
  measured.tried_colour = true;
  Blob around;
  around.centre_px = centre.centre_px;
  around.second_moment_px2 = centre.second_moment_px2;
  // Brightness shows a part of it.
  if (measured.blob_moment_px2.determinant() > around.second_moment_px2.determinant()) {
    around.centre_px = measured.blob_px;
    around.second_moment_px2 = measured.blob_moment_px2;
  }
  SphereOutline outline{.centre_px = around.centre_px,
                        .radius_px = 2 * std::pow(around.second_moment_px2.determinant(), 0.25)};
  const bool is_fitted = FitNear(
      image, measured, {.around = around, .shape_px2 = around.second_moment_px2, .by_colour = true},
      &measured.coloured_pixels, &outline);
  if (is_fitted && IsOnOutline(outline)) measured.coloured = outline;
  return measured.coloured;
}

void MeasuredMarkers::TakeColour(int blob) {
  MeasuredMarker& measured = OfBlob(blob);
  measured.outline = measured.coloured;
  std::swap(measured.pixels, measured.coloured_pixels);
}

void MeasuredMarkers::PreferColour(const ImageView& image, int blob) {
  const MeasuredMarker& measured = OfBlob(blob);
  if (!measured.outline || measured.outline->by_colour || IsClearlySeen(measured.outline)) return;
  const auto seen = [](const SphereOutline& one) { return one.on_outline - one.off_outline; };
  const auto& coloured = OutlineByColour(image, blob);
  if (coloured && seen(*coloured) > seen(*measured.outline) + kMoreSeen) TakeColour(blob);
}

void MeasuredMarkers::FitBeside(const ImageView& image, int blob) {
  MeasuredMarker& measured = OfBlob(blob);
  const MarkerCentre& centre = measured.centre;
  if (!measured.outline || centre.has_neighbour || measured.beside || measured.outline->by_others ||
      measured.outline->by_colour || centre.cut || centre.background_steps < kUnevenBackground ||
      measured.outline->edge_px > kMostEdgePx) {
    return;
  }
  Blob around;
  around.centre_px = measured.outline->centre_px;
  around.second_moment_px2 = measured.outline->SecondMoment();
  SphereOutline again = *measured.outline;
  if (!meter_.CollectNear(image, around, centre, &retry_) ||
      !fitter_.Fit(retry_, around.second_moment_px2, {}, &again) || !IsOnOutline(again)) {
    return;
  }
  measured.moved_px = again.centre_px - measured.outline->centre_px;
  measured.outline = again;
  std::swap(measured.pixels, retry_);
}

}  // namespace rigcal::agent
