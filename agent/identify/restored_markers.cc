// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/restored_markers.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>

#include "agent/identify/overlapping_markers.h"
#include "agent/identify/squared.h"

namespace rigcal::agent {
namespace {

constexpr double kMostHidden = 0.2;                 // of a marker, by others of the wand
constexpr double kOwnPlacePx = 1, kOwnPlace = 0.6;  // of a marker's centre, by its blob's radius

// Or else something beside it was measured.
bool IsInBlob(const Eigen::Vector2d& centre_px, const Blob& blob) {
  const double radius_px = std::sqrt(blob.area_px / std::numbers::pi);
  return (centre_px - blob.centre_px).norm() < kOwnPlacePx + kOwnPlace * radius_px;
}

void SetOutline(const SphereOutline& outline, MarkerCentre* centre) {
  centre->centre_px = outline.centre_px;
  centre->radius_px = outline.radius_px;
  centre->covariance_px2 = std::max(1.0, Squared(outline.residual)) * outline.covariance_px2;
  if (outline.by_colour) centre->covariance_px2 *= kSharedNoise;
  centre->skewness = 0;
}

}  // namespace

void RestoreByOutlines(const ImageView& image, absl::Span<const Blob> blobs,
                       MeasuredMarkers* markers, VerifiedWand* wand) {
  const auto restore = [&](size_t k, const std::optional<SphereOutline>& outline) {
    const Blob& blob = blobs[static_cast<size_t>(wand->blobs[k])];
    MarkerCentre& centre = wand->centres[k];
    const bool is_cut = centre.cut || blob.touches_border;
    if (!IsOnOutline(outline, is_cut) || !(is_cut || IsInBlob(outline->centre_px, blob))) {
      return false;
    }
    wand->whole[k] = true;
    SetOutline(*outline, &centre);
    if (is_cut) centre.second_moment_px2 = outline->SecondMoment();
    return true;
  };
  absl::InlinedVector<size_t, 3> lost, to_retry;
  for (size_t k = 0; k < wand->blobs.size(); ++k) {
    const MarkerCentre& centre = wand->centres[k];
    if (wand->whole[k]) continue;
    const bool is_cut = centre.cut || blobs[static_cast<size_t>(wand->blobs[k])].touches_border;
    const bool may_be = centre.contrast_grey > 0 && HiddenShare(*wand, k) < kMostHidden;
    if (may_be && restore(k, markers->OutlineOf(image, wand->blobs[k]))) continue;
    if (may_be && restore(k, markers->OutlineByColour(image, wand->blobs[k]))) {
      markers->TakeColour(wand->blobs[k]);
      continue;
    }
    lost.push_back(k);
    if (may_be && !is_cut) to_retry.push_back(k);
    // With two that are not whole it is no wand.
    if (lost.size() > 1) return;
  }
  for (const size_t k : to_retry) restore(k, markers->OutlineIn(image, *wand, k));
}

std::optional<ColouredWand> WithColouredOutlines(const ImageView& image, int partial,
                                                 MeasuredMarkers* markers,
                                                 const VerifiedWand& wand) {
  ColouredWand coloured{wand, {}};
  for (size_t k = 0; k < wand.blobs.size(); ++k) {
    if (!wand.whole[k] || static_cast<int>(k) == partial) continue;
    const MeasuredMarker& measured = markers->OfBlob(wand.blobs[k]);
    if (!measured.tried || IsClearlySeen(measured.outline)) continue;
    if (measured.outline && measured.outline->by_colour) continue;
    const auto& outline = markers->OutlineByColour(image, wand.blobs[k]);
    if (!outline) continue;
    SetOutline(*outline, &coloured.wand.centres[k]);
    coloured.blobs.push_back(wand.blobs[k]);
  }
  if (coloured.blobs.empty()) return std::nullopt;
  return coloured;
}

}  // namespace rigcal::agent
