// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/restored_markers.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "agent/identify/squared.h"

namespace rigcal::agent {
namespace {

// Largest distance of a marker's centre from its blob's; what is further away is something else.
constexpr double kOwnPlacePx = 1;
constexpr double kOwnPlaceRadii = 0.6;

bool IsInBlob(const Eigen::Vector2d& centre_px, const Blob& blob) {
  const double radius_px = std::sqrt(blob.area_px / std::numbers::pi);
  return (centre_px - blob.centre_px).norm() < kOwnPlacePx + kOwnPlaceRadii * radius_px;
}

}  // namespace

void RestoreByOutlines(const ImageView& image, absl::Span<const Blob> blobs,
                       MeasuredMarkers* markers, VerifiedWand* wand) {
  for (size_t k = 0; k < wand->blobs.size(); ++k) {
    if (wand->whole[k]) continue;
    const Blob& blob = blobs[static_cast<size_t>(wand->blobs[k])];
    MarkerCentre& centre = wand->centres[k];
    const bool is_cut = centre.cut || blob.touches_border;
    const auto& outline = markers->OutlineOf(image, wand->blobs[k]);
    if (!IsOnOutline(outline, is_cut) || !(is_cut || IsInBlob(outline->centre_px, blob))) return;
    wand->whole[k] = true;
    centre.centre_px = outline->centre_px;
    centre.radius_px = outline->radius_px;
    centre.covariance_px2 = std::max(1.0, Squared(outline->residual)) * outline->covariance_px2;
    centre.skewness = 0;
    if (is_cut) centre.second_moment_px2 = outline->SecondMoment();
  }
}

}  // namespace rigcal::agent
