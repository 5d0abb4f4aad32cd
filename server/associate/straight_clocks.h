// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "common/status/refusal.h"
#include "server/associate/camera_track.h"
#include "server/associate/clock_steps.h"
#include "server/associate/stamp_fault.h"

namespace rigcal::server {

// Puts rows whose stamps were set in the middle of a recording on one time scale. A stream of rows
// is that of a camera in a session in the order of clock epochs, which agents begin wherever a
// stamp is less than the one before.
//
//   - A few rows that the next ones contradict are single wrong stamps: each goes where its stamp
//     says if there is room for a row, and is refused else (`clock_epoch_without_offset`).
//   - Streams that are mostly in another order are sorted.
//   - Steps that all cameras of a time base make together, as counters that begin anew, change
//     nothing between cameras: all rows behind such a step are moved behind those before it.
//   - Any other step back begins a clock epoch of its own, and so does a step forward of which
//     `evidence` says that it is one; where that says nothing, one by more than 10 s to a time at
//     which no other camera has rows. Its rows are moved behind those before it, or before those
//     behind it where these fit the other cameras, by whole times that are right to a row or so; a
//     solve finds the rest. Epochs of fewer than 30 rows are refused.
//
// Steps are looked for where the cameras of a session share a time base. Stamps that repeat and
// stamps in bursts are reported only. The result depends on the set of observations of each epoch
// only.
std::vector<StampFault> StraightenClocks(std::vector<CameraTrack>* tracks, RefusalCounter* refused,
                                         const StepEvidence& evidence = {});

}  // namespace rigcal::server
