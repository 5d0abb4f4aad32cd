// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "agent/detect/blobs/blob_finder.h"
#include "agent/detect/event/disc_splitter.h"
#include "agent/event/event_words.h"

namespace rigcal::agent {

PixelRect BoxOf(const PixelList& pixels);
bool TouchesBorder(const PixelRect& box, const SensorGeometry& geometry);

// Drops what hangs on by a pixel or two, and fills in pixels that were dead: noise.
void Smooth(PixelList* pixels);

// Of a disc of that area.
double RadiusPx(const Blob& shape);
// Longer than one marker is: a disc that moves by its radius is not.
bool IsLong(const Blob& shape);

// Of all pixels; at least one. Whether they touch the border is not told.
Blob ShapeOf(const PixelList& pixels);

// Of one marker: pixels further out than the ellipse of the same moments reaches are something else
// that lit up beside it (a lamp, an edge, noise) and are taken out of the list. Where that would be
// more than a third nothing is: it is no marker with something beside it.
Blob MarkerShapeOf(PixelList* pixels);

}  // namespace rigcal::agent
