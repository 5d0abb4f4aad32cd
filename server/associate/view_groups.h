// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "server/associate/align_clocks.h"

namespace rigcal::server {

// A row in which a camera sees the wand, at its rig time.
struct WandView {
  int64_t time_ns = 0;
  int track = 0;        // index into the aligned tracks
  int observation = 0;  // index into that track's observations
};

// By time, then track and row.
bool Earlier(const WandView& a, const WandView& b);

// Views of one instant, at least one, one per camera, ascending.
using ViewGroup = std::vector<WandView>;

int64_t MeanTimeNs(const ViewGroup& group);

struct ViewGrouping {
  std::vector<ViewGroup> groups;
  std::vector<WandView> skipped;  // there is a nearer one of the same camera
};

// Cameras that run together: a group ends `tolerance_ns` after its first view, or where a camera
// comes again. `views` ascend here and below.
ViewGrouping GroupTogether(const std::vector<AlignedTrack>& tracks,
                           const std::vector<WandView>& views, int64_t tolerance_ns);

// Cameras that run freely: of each camera the view nearest the middle of a window of time.
ViewGrouping GroupNearest(const std::vector<AlignedTrack>& tracks,
                          const std::vector<WandView>& views, int64_t window_ns);

// Gives each group without a view of the same camera the one of these views of one track that is
// nearest its time (`times_ns`, by group) and up to `reach_ns` away; a view goes to one group at
// most. Returns the others.
std::vector<WandView> JoinNearest(const std::vector<AlignedTrack>& tracks,
                                  const std::vector<WandView>& of_track,
                                  const std::vector<int64_t>& times_ns, int64_t reach_ns,
                                  std::vector<ViewGroup>* groups);

}  // namespace rigcal::server
