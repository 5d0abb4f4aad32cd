// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "absl/types/span.h"
#include "agent/detect/blobs/image_view.h"
#include "agent/identify/alike_pairs.h"
#include "agent/identify/wand_finder.h"

namespace rigcal::agent {

struct PartialWands {
  std::vector<WandCandidate> candidates;  // by cost; blobs: index into `blobs`
  std::vector<WandCandidate> thirds;      // whole ones, of two and a marker that nothing found
  std::vector<Blob> blobs;                // the whole ones as they were given, then the parts
  int tried = 0;                          // places that were looked at
  bool cut_short = false;                 // not all of them, for the time
  bool cut_stick = false;                 // nor all of those whose stick is seen
};

// Wands of three markers of which one is mostly hidden: two whole markers that are alike, and a
// part of the third one where it must be, of their colour and brightness and not beyond its
// outline. Pairs between which a stick is seen are looked at first. By the sizes of the two and
// their distance from each other, only some of the six ways in which they can be two of the three
// are possible, and each says where the third one is. Two spheres alone say neither which markers
// they are nor which way the wand points: the part does, so there is none without it, but where
// something covers the middle of a stick that is seen on both sides, and at the place where the
// middle sphere would be the other way round the stick is seen. `known_parts`, where few things
// have the wand's colour: any of them may be a part. At most `max_candidates`. `work`: pixels that
// may be read, less those that were. `look_for_third`: also for whole markers that nothing found,
// where the other two say that they are (ThirdMarkerCost).
PartialWands FindPartialWands(const ImageView& image, const WandFinder& finder,
                              absl::Span<const WholeMarker> wholes,
                              absl::Span<const Blob> known_parts, size_t max_candidates,
                              double* work, bool look_for_third = false,
                              bool look_for_stick = true);

// The least confidence of such a wand where so many places were looked at: two things and a part of
// a third are found by chance among many. `in_room`: of a lit room, in which there are such things.
double LeastPartialConfidence(int tried, bool in_room);

// As a part of a marker is placed: within the marker. `radius_px`: of the whole marker.
void LoosenSight(double radius_px, MarkerSight* sight);

}  // namespace rigcal::agent
