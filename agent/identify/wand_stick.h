// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

#include "agent/identify/outline_rows.h"
#include "agent/identify/sphere_outline_fit.h"
#include "agent/identify/verified_wand.h"

namespace rigcal::agent {

// Marks the pixels on which the stick that carries the spheres may be (OutlinePixels::stick_side):
// a band along the wand, from where it leaves a sphere at this tilt. Both sides are marked, because
// it is not well known on which one the stick is seen. Lit by the spheres it makes them longer,
// dark before them shorter, on one side or on both. A wand with one marker gets no marks.
void MarkStick(const VerifiedWand& wand, size_t marker, const SphereOutline& outline,
               OutlinePixels* pixels);

}  // namespace rigcal::agent
