// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "absl/types/span.h"
#include "agent/detect/blobs/blob_finder.h"
#include "agent/detect/blobs/image_view.h"

namespace rigcal::agent {

// Whether a blob shows two fields of an interlaced frame: what has moved between them has teeth,
// rows that differ from both neighbours, which are alike. Looks at the largest of the blobs that
// are as large as spheres.
bool LooksInterlaced(const ImageView& image, absl::Span<const Blob> blobs);

}  // namespace rigcal::agent
