// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/status/refusal.h"
#include "server/associate/camera_track.h"

namespace rigcal::server {

// Something about the stamps of one camera in one session that the rows themselves show.
struct StampFault {
  enum class Kind {
    kSteps,       // its clock was set; size: the largest step, seconds, positive where forward
    kOutOfOrder,  // rows that were not in the order of their stamps; size: how many
    kRepeat,      // rows that have the stamp of the row before; size: their share, percent
    kBursts,      // rows whose stamps come in groups; size: their share, percent
  };
  Kind kind = Kind::kSteps;
  std::string session_id, camera;
  double size = 0;
  std::string what;  // a sentence without a full stop
};

// Puts rows whose stamps were set in the middle of a recording on one time scale. A stream of rows
// is that of a camera in a session in the order of clock epochs, which agents begin wherever a
// stamp is less than the one before.
//
//   - A few rows that the next ones contradict are single wrong stamps: each goes where its stamp
//     says if there is room for a row, and is refused else (`clock_epoch_without_offset`).
//   - Streams that are mostly in another order are sorted.
//   - Steps that all cameras of a time base make together, as counters that begin anew, change
//     nothing between cameras: all rows behind such a step are moved behind those before it.
//   - Any other step back, and a step forward by more than 10 s to a time at which no other camera
//     has rows, begins a clock epoch of its own. Its rows are moved behind those before it, or
//     before those behind it where these fit the other cameras, by whole times that are right to a
//     row or so; a solve finds the rest. Epochs of fewer than 30 rows are refused.
//
// Steps are looked for where the cameras of a session share a time base. Stamps that repeat and
// stamps in bursts are reported only. The result depends on the set of observations of each epoch
// only.
std::vector<StampFault> StraightenClocks(std::vector<CameraTrack>* tracks, RefusalCounter* refused);

}  // namespace rigcal::server
