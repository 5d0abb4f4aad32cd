// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/detector_control.h"

namespace rigcal::agent {

PixelMask Union(PixelMask a, const PixelMask& b) {
  if (a.width() == 0 || a.height() == 0) return b;
  if (a.width() != b.width() || a.height() != b.height()) return a;
  for (int y = 0; y < a.height(); ++y) {
    for (int i = 0; i < a.words_per_row(); ++i) a.MutableRow(y)[i] |= b.Row(y)[i];
  }
  return a;
}

ColourRange DetectorControl::colour() const { return learnt_colour().value_or(configured_colour_); }

std::optional<ColourRange> DetectorControl::learnt_colour() const {
  const std::lock_guard lock(mutex_);
  return colour_;
}

PixelMask DetectorControl::ignored() const {
  const std::lock_guard lock(mutex_);
  return Union(mask_, configured_mask_);
}

PixelMask DetectorControl::learnt_mask() const {
  const std::lock_guard lock(mutex_);
  return mask_;
}

void DetectorControl::SetColour(const std::optional<ColourRange>& colour) {
  const std::lock_guard lock(mutex_);
  colour_ = colour;
  changed_ = true;
}

void DetectorControl::SetMask(PixelMask mask) {
  const std::lock_guard lock(mutex_);
  mask_ = std::move(mask);
  changed_ = true;
}

std::optional<Target> DetectorControl::target() const {
  const std::lock_guard lock(mutex_);
  return target_;
}

void DetectorControl::SetTarget(std::optional<Target> target) {
  const std::lock_guard lock(mutex_);
  target_ = std::move(target);
}

}  // namespace rigcal::agent
