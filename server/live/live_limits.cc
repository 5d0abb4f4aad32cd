// SPDX-License-Identifier: Apache-2.0
#include "server/live/live_limits.h"

#include <cstddef>
#include <cstdint>
#include <vector>

#include "common/target/target.h"
#include "server/live/overlap_counter.h"

namespace rigcal::server {
namespace {

constexpr size_t kMaxNeeds = 16;
constexpr size_t kMaxHistory = 300;
constexpr size_t kMaxAdvice = 3;
constexpr size_t kMaxVoxels = 4096;
constexpr size_t kMaxTextBytes = 1024;
constexpr size_t kMaxAlertBytes = 512;
constexpr size_t kMaxHostBytes = 128;
constexpr size_t kMaxVersionBytes = 64;

// Not in the middle of a character.
void Shorten(size_t bytes, std::string* text) {
  if (text->size() <= bytes) return;
  while (bytes > 0 && (static_cast<unsigned char>((*text)[bytes]) & 0xC0U) == 0x80U) --bytes;
  text->resize(bytes);
}

template <typename Value>
void Limit(size_t count, std::vector<Value>* values) {
  if (values->size() > count)
    values->erase(values->begin() + static_cast<std::ptrdiff_t>(count), values->end());
}

}  // namespace

void LimitEstimate(LiveEstimate* estimate) {
  Shorten(kMaxTextBytes, &estimate->problem);
  Limit(kMaxNeeds, &estimate->needs);
  Limit(OverlapCounter::kMaxCameras, &estimate->cameras);
  Limit(size_t{kMaxWandMarkers}, &estimate->marker_positions_m);
  Limit(size_t{kMaxWandMarkers}, &estimate->wand_m);
  Limit(kMaxAdvice, &estimate->advice);
  for (LiveAdvice& advice : estimate->advice) {
    Shorten(kMaxTextBytes, &advice.text);
    Limit(OverlapCounter::kMaxCameras, &advice.cameras);
  }
  std::vector<LiveFigure>& history = estimate->history;
  if (history.size() > kMaxHistory) {
    history.erase(history.begin(), history.end() - static_cast<std::ptrdiff_t>(kMaxHistory));
  }
  if (!estimate->volume) return;
  LiveVolume& volume = *estimate->volume;
  const uint64_t points = uint64_t{volume.count_x} * volume.count_y * volume.count_z;
  if (points > kMaxVoxels || volume.sigma_mm.size() != points ||
      volume.wand_counts.size() != points) {
    // A grid that does not fit is worth nothing in part; the figures stay.
    volume.count_x = volume.count_y = volume.count_z = 0;
    volume.sigma_mm.clear();
    volume.wand_counts.clear();
  }
}

void LimitAgent(LiveAgent* agent) {
  Shorten(kMaxHostBytes, &agent->host);
  Shorten(kMaxVersionBytes, &agent->software_version);
}

void LimitMonitor(LiveMonitor* monitor) {
  Shorten(kMaxTextBytes, &monitor->problem);
  Shorten(kMaxTextBytes, &monitor->repair_text);
  Limit(OverlapCounter::kMaxCameras, &monitor->cameras);
}

void LimitAlertText(std::string* text) { Shorten(kMaxAlertBytes, text); }

}  // namespace rigcal::server
