// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "common/status/refusal.h"
#include "server/associate/camera_track.h"
#include "server/associate/stamp_fault.h"

namespace rigcal::server {

// Of rows of one camera in one session that have the same stamp and the same values, as those of a
// file that was appended to itself, one stays: that of the first clock epoch. The others are taken
// away and counted as `duplicate_equal`; twenty or more with markers are a fault. Rows without a
// marker count as repeated only where rows with markers are.
std::vector<StampFault> UseRepeatedRowsOnce(std::vector<CameraTrack>* tracks,
                                            RefusalCounter* refused);

// Pairs of cameras of a session with the same markers at the same pixels in row after row, as where
// one camera's file was copied under another's name: at least twenty rows and a tenth of one
// camera's, all of them at one distance in time. Each camera is named once, with the first one that
// it has its rows in common with. Rows that a camera has several times, as of a target at rest, say
// nothing.
std::vector<StampFault> FindCopiedRows(const std::vector<CameraTrack>& tracks);

}  // namespace rigcal::server
