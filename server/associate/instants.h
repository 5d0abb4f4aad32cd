// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "server/associate/align_clocks.h"

namespace rigcal::server {

// One camera's observation in an instant.
struct InstantMember {
  int track = 0;        // index into the aligned tracks
  int observation = 0;  // index into that track's observations
};

// Observations of at least two cameras of one session that belong to one instant.
struct Instant {
  int64_t rig_time_ns = 0;             // mean of its members
  std::vector<InstantMember> members;  // ascending by track, one per camera
};

struct InstantList {
  explicit InstantList(size_t tracks = 0)
      : alone_count(tracks), instant_count(tracks), skipped_count(tracks) {}

  std::vector<Instant> instants;        // ascending by session, then time
  std::vector<uint32_t> alone_count;    // by track: wand views that nobody else shares
  std::vector<uint32_t> instant_count;  // by track: wand views that are part of an instant
  // By track: wand views with a nearer one of the same camera in their instant, or that a fast
  // camera alone has between the slow ones' instants.
  std::vector<uint32_t> skipped_count;
};

// Groups wand views by rig time. `rig_time_ns[t][i]` is the rig time of observation i of track t.
// Observations without a visible marker take no part. The same views give the same instants
// whatever their order of arrival was.
//
// All members of an instant lie within `tolerance_s` of each other. 0: from the cameras' periods,
// session by session. Cameras that run together: a quarter of the smallest median period, the
// widest that cannot mix neighbouring frames. Where that leaves most views alone, or most of one
// camera's, the cameras run freely: then an instant takes what lies within one median period of
// the slowest camera, of each camera the view nearest its middle, and the caller interpolates each
// view to the instant's time.
//
// That is for cameras of about one rate. Of much faster ones (event cameras at 200 Hz beside frame
// cameras at 50 that run together) the view nearest to each instant of the slow ones joins it, and
// what they saw in between makes instants among the fast cameras in the same way.
InstantList FindInstants(const std::vector<AlignedTrack>& tracks,
                         const std::vector<std::vector<int64_t>>& rig_time_ns, double tolerance_s);

// Rig times by the coarse alignment alone.
std::vector<std::vector<int64_t>> CoarseRigTimes(const std::vector<AlignedTrack>& tracks);

}  // namespace rigcal::server
