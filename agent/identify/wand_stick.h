// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

#include "agent/identify/outline_rows.h"
#include "agent/identify/sphere_outline_fit.h"
#include "agent/identify/verified_wand.h"

namespace rigcal::agent {

// Marks the pixels on which the stick may be that carries the spheres (OutlinePixels::stick_side):
// a band along the wand, from where it leaves a sphere that points at the camera so much, on both
// sides: which one does is not told well. Lit by the spheres it makes them longer, dark before them
// shorter, on one side or on both. Nothing is marked of a wand with one marker.
void MarkStick(const VerifiedWand& wand, size_t marker, const SphereOutline& outline,
               OutlinePixels* pixels);

}  // namespace rigcal::agent
