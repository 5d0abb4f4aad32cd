// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "common/calibration/calibration_options.h"
#include "server/associate/align_clocks.h"
#include "server/solve/rig/target_parts.h"

namespace rigcal::server {

// SHA-256, as 64 hexadecimal digits, over exactly what a calibration was made from: the options,
// the target (of each session where they are several), each camera's given intrinsics, and every
// used observation with all its values, in the order of (session, camera, clock epoch, time).
// `used[t][i]`: observation i of track t.
std::string ObservationDigest(const CalibrationOptions& options, const TargetParts& targets,
                              const std::vector<AlignedTrack>& tracks,
                              const std::vector<std::vector<bool>>& used);

// Of a calibration that only changes frame or scale: over the digest of its parent, what it was
// asked for, and the markers that it was made from.
std::string DerivedDigest(const std::string& parent_digest, const CalibrationOptions& options,
                          const std::vector<MarkerViews>& measured);

}  // namespace rigcal::server
