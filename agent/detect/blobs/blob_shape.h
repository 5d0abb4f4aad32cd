// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "agent/detect/blobs/blob_finder.h"

namespace rigcal::agent {

// Returns the ratio of the blob's longer axis to its shorter one, less 1: 0 for a disc.
double Elongation(const Blob& blob);

// Tells whether the blob fills an ellipse that is hardly longer than a moving sphere's image.
bool IsRound(const Blob& blob);

}  // namespace rigcal::agent
