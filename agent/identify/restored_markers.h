// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "absl/types/span.h"
#include "agent/detect/blobs/blob_finder.h"
#include "agent/detect/blobs/image_view.h"
#include "agent/identify/measured_markers.h"
#include "agent/identify/verified_wand.h"

namespace rigcal::agent {

// Accepts markers as whole that are not so by their centroids, if their outlines are those of whole
// spheres: something behind a marker moves its centroid, but not its outline. Markers that `wand`
// says are whole stay as they are. Stops at the first marker that is not accepted.
void RestoreByOutlines(const ImageView& image, absl::Span<const Blob> blobs,
                       MeasuredMarkers* markers, VerifiedWand* wand);

}  // namespace rigcal::agent
