// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "absl/container/inlined_vector.h"
#include "agent/identify/sphere_outline_fit.h"
#include "agent/identify/verified_wand.h"

namespace rigcal::agent {

// Sets the features of pose, tilt, brightness and colour.
void MeasureLikeness(VerifiedWand* wand);

// Sets the features of the shapes. `outlines`, by marker: null if none can be fitted.
void MeasureShapes(const absl::InlinedVector<const SphereOutline*, 3>& outlines,
                   VerifiedWand* wand);

}  // namespace rigcal::agent
