// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>

#include "agent/detect/blobs/blob_finder.h"

namespace rigcal::agent {

// Longer axis of the blob over the shorter one, less 1.
double Elongation(const Blob& blob);

// The two discs of one size whose union has the blob's area and second moments: two spheres of a
// wand that points at the camera overlap, and sticks and their ends take pieces out of both, which
// move neither moments nor area much. None where the blob is hardly longer than wide, or longer
// than two discs that touch.
std::optional<std::array<Blob, 2>> SplitPair(const Blob& blob);

}  // namespace rigcal::agent
