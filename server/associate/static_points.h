// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "common/status/refusal.h"
#include "common/target/target.h"
#include "server/associate/align_clocks.h"
#include "server/associate/camera_track.h"

namespace rigcal::server {

using TargetOfSession = std::function<const Target&(const std::string& session_id)>;

// The weight of a centre is at most that of this many rows. Errors from the pixel grid, the lens
// and the light are the same in every row of a point that does not move: averaging does not reduce
// them.
inline constexpr double kMaxRowsOfCentre = 25;

// Cleans all tracks (CleanTracks) and aligns their clocks (AlignClocks), but for those of static
// points, which come last as GatherStaticPoints makes them. The rows of `tracks` are freed.
std::vector<AlignedTrack> AlignTracks(std::vector<CameraTrack>* tracks,
                                      const TargetOfSession& target_of, RefusalCounter* refused,
                                      std::vector<StampFault>* faults);

// One track for each camera and session of static points: each point that the camera saw has one
// centre, the mean of its rows without their outliers (counted as `outlier`). The covariance is
// that of a row, as stated or as the rows scatter if that is more, by the number of rows, at most
// kMaxRowsOfCentre.
//
// Clocks say nothing of what does not move: the tracks are marked static, and their times are made
// up. Each point has its own time, the same in every camera, so that it is an instant by itself;
// they are spread over the time of `moving`, at least a second apart. Surveyed points are all in
// one row, because their places among each other are known. A point that moved between its rows is
// not used. `tracks` come sorted by session and camera.
std::vector<AlignedTrack> GatherStaticPoints(const std::vector<CleanTrack>& tracks,
                                             const TargetOfSession& target_of,
                                             const std::vector<AlignedTrack>& moving,
                                             RefusalCounter* refused);

}  // namespace rigcal::server
