// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>

#include "agent/detect/blobs/blob_finder.h"
#include "agent/detect/blobs/image_view.h"

namespace rigcal::agent {

// What is seen where a marker must be.
struct HiddenPart {
  double share = 0;   // of the marker's disc that looks like the others
  double around = 0;  // the same of a ring around it
  double cost = 0;
  double size_cost = 0;  // within it, by the sizes of the others (FindPartialWands)
  bool is_sliver = false;
  Blob blob;
};

// Whether a part, that is such a share of a marker's disc, is rather a smaller round thing that is
// seen as a whole: what hides a marker leaves no such part.
bool IsSmallThing(double share, const Blob& blob);

// Where the middle of a marker is of which the image's border leaves `part`. `disc_px` and
// `radius_px`: where it is expected, which says across which border.
Eigen::Vector2d MiddleBeyondBorder(const ImageView& image, const Blob& part,
                                   const Eigen::Vector2d& disc_px, double radius_px);

// What is seen of a marker that must be at `centre_px` with `radius_px` and looks like `core` (by
// channel). None where nothing of that look is there, or more than a marker of it. `has_stick`,
// between the others: then it may be as thin as the rim of something brighter. `work`: pixels that
// may be read, less those that were.
std::optional<HiddenPart> LookForPart(const ImageView& image, const Eigen::Vector2d& centre_px,
                                      double radius_px, const Eigen::Vector3f& core, bool has_stick,
                                      double* work);

// The same of a sliver, a pixel or two wide, so that each of its pixels is a mixture with what is
// around. None where nothing is mixed with the others' colour, or everything around differs as
// much. `has_stick`, between the others: then less of it is enough.
std::optional<HiddenPart> LookForSliver(const ImageView& image, const Eigen::Vector2d& centre_px,
                                        double radius_px, const Eigen::Vector3f& core,
                                        bool has_stick, double* work);

}  // namespace rigcal::agent
