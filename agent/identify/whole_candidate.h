// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "agent/detect/blobs/blob_finder.h"
#include "agent/identify/verified_wand.h"
#include "agent/identify/wand_finder.h"

namespace rigcal::agent {

// A marker that is not known to be anything else, as if it had been found.
Blob DiscBlob(const Eigen::Vector2d& centre_px, double radius_px);

// The marker of which only a part was looked for may be whole, but merged with what is beside it or
// too much like it to be found. The same wand with a disc in its place where the pose says that it
// is, as large as the others say; the disc is added to `blobs`, into which the wand's blobs point.
// None: no marker is hidden, or it is not in the image.
std::optional<WandCandidate> WholeCandidate(const WandFinder& finder, const VerifiedWand& wand,
                                            std::vector<Blob>* blobs);

}  // namespace rigcal::agent
