// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "agent/detect/blobs/blob_finder.h"

namespace rigcal::agent {

// Longer axis of the blob over the shorter one, less 1.
double Elongation(const Blob& blob);

// The blob fills an ellipse that is hardly longer than a sphere's image.
bool IsRound(const Blob& blob);

}  // namespace rigcal::agent
