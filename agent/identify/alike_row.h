// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "absl/types/span.h"
#include "agent/detect/blobs/blob_finder.h"
#include "agent/detect/blobs/image_view.h"
#include "agent/identify/verified_wand.h"

namespace rigcal::agent {

// Whether another one of `blobs` that is as large as the wand's markers and looks like them lies on
// its line, between them or a span beyond: a row of slats, keys or labels goes on.
bool GoesOnAsRow(const ImageView& image, absl::Span<const Blob> blobs, const VerifiedWand& wand);

}  // namespace rigcal::agent
