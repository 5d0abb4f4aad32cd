// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "server/solve/rig/rig_observations.h"

namespace rigcal::server {

// Simple causes of rows that cannot be solved, from the rows alone.

// Hardly any of the camera's wand views is at a time, as the stamps say, at which another camera
// has one: it cannot disagree with the others, only be apart from them.
bool SeesTheWandAlone(const RigObservations& rig, const std::string& camera);

// The camera has as many rows as the others, but over another time as its stamps say; empty:
// nothing speaks for that.
std::string StretchedStamps(const RigObservations& rig, const std::string& camera);

// What the images say of the wand's spans where the target says something else: of all cameras
// ("the images show spans of about 1 : 2.0, the target says 1 : 1.0"), or of some that count the
// markers from the other end. Before that: cameras that show the markers in another order along
// their line than the target has. Of wands of three markers and more; empty: nothing speaks against it.
std::string SpanContradiction(const RigObservations& rig);

}  // namespace rigcal::server
