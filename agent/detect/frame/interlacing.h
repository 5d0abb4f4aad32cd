// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "absl/types/span.h"
#include "agent/detect/blobs/blob_finder.h"
#include "agent/detect/blobs/image_view.h"

namespace rigcal::agent {

// Tells whether a blob shows the two fields of an interlaced frame. What has moved between them has
// teeth: rows that differ from both neighbours while these are alike. It examines the four largest
// blobs that are as large as spheres.
bool LooksInterlaced(const ImageView& image, absl::Span<const Blob> blobs);

}  // namespace rigcal::agent
