// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "absl/container/inlined_vector.h"
#include "absl/types/span.h"
#include "agent/detect/blobs/blob_finder.h"
#include "agent/detect/blobs/image_view.h"
#include "agent/identify/measured_markers.h"
#include "agent/identify/verified_wand.h"

namespace rigcal::agent {

// Takes markers of a wand for whole that are not by their centroids, where their outlines are those
// of whole spheres: something behind a marker moves and skews its centroid, but not its outline.
// Those that `wand` says are whole stay as they are.
void RestoreByOutlines(const ImageView& image, absl::Span<const Blob> blobs,
                       MeasuredMarkers* markers, VerifiedWand* wand);

// A wand with outlines by colour, and the blobs whose these are (MeasuredMarkers::TakeColour).
struct ColouredWand {
  VerifiedWand wand;
  absl::InlinedVector<int, 3> blobs;
};

// A wand with outlines by colour for markers whose edges are not seen all around: white light on a
// sphere leaves one side of it as bright as what is behind it, and what is seen of it may look like
// a smaller sphere. None: no marker has one. `partial`: a marker of which only a part is seen, or
// -1.
std::optional<ColouredWand> WithColouredOutlines(const ImageView& image, int partial,
                                                 MeasuredMarkers* markers,
                                                 const VerifiedWand& wand);

}  // namespace rigcal::agent
