// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "common/status/refusal.h"
#include "server/associate/camera_track.h"
#include "server/associate/stamp_fault.h"

namespace rigcal::server {

// Of a camera's wand views: with so many of another camera's rows its file is a copy.
inline constexpr double kWholeCopyPercent = 90;

// Cameras of a session with the same markers at the same pixels in row after row, as where one
// camera's file was copied under another's name: at least twenty rows and a tenth of one camera's,
// all of them at one distance in time. Two cameras never see the same; so such rows are of one of
// the two, and nothing says of which. Each camera is named once, with the first one that it has
// its rows in common with. Rows that a camera has several times, as of a target at rest, say
// nothing.
//
// Where one of the two has hardly any other rows (kWholeCopyPercent), all its rows in this session
// are taken away: those of the one that shares more, or else of the later name; of one that
// `is_needed` only where the other is needed, too. Where both have more rows than these, as where
// two files were merged, the common ones are taken from both. They are counted as
// `duplicate_equal`.
std::vector<StampFault> UseCopiedRowsOnce(
    const std::function<bool(const std::string& camera)>& is_needed,
    std::vector<CameraTrack>* tracks, RefusalCounter* refused);

}  // namespace rigcal::server
