// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "absl/types/span.h"
#include "agent/detect/blobs/blob_finder.h"
#include "agent/detect/blobs/image_view.h"
#include "agent/identify/verified_wand.h"

namespace rigcal::agent {

// What is as large as the wand's markers and looks like them, without them.
struct AlikeThings {
  // Those near by, of its colour: within one and a half of its lengths from its middle.
  int near_count = 0;
  // One of them, less exactly alike, lies on the wand's line, between its markers or a span beyond:
  // a row of slats, keys or labels goes on.
  bool go_on_as_row = false;
};

AlikeThings ThingsLike(const ImageView& image, absl::Span<const Blob> blobs,
                       const VerifiedWand& wand);

}  // namespace rigcal::agent
