// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

#include "agent/detect/blobs/blob_finder.h"
#include "agent/identify/outline_rows.h"
#include "agent/identify/verified_wand.h"

namespace rigcal::agent {

// The spheres of a wand that points at the camera hide each other, and look alike.

// Share of what is right beside a disc that another one covers.
double OverlapShare(const Blob& disc, const Blob& other);
// Whether `other` may reach into where MarkerCentre::same_grey of `disc` is measured.
bool IsBeyond(const Blob& disc, const Blob& other);
// Share of a marker that nearer ones of the wand cover: the lenses of two circles.
double HiddenShare(const VerifiedWand& wand, size_t marker);
// Pixels beyond the line through the points where the circles of two blobs meet belong to the other
// one: they count no longer.
void LeaveOutBeyond(const Blob& own, const Blob& other, OutlinePixels* pixels);

}  // namespace rigcal::agent
