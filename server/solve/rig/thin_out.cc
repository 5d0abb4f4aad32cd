// SPDX-License-Identifier: Apache-2.0
#include "server/solve/rig/thin_out.h"

#include <algorithm>
#include <cstdint>

namespace rigcal::server {
namespace {

// From 0 to 1, evenly spread, different for each row (SplitMix64 of Steele et al. 2014).
double LotOf(const InstantMember& member) {
  uint64_t z = static_cast<uint64_t>(static_cast<uint32_t>(member.track)) << 32 |
               static_cast<uint32_t>(member.observation);
  z += 0x9e3779b97f4a7c15u;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
  return 0x1p-53 * static_cast<double>((z ^ (z >> 31)) >> 11);
}

}  // namespace

void ThinOut(const RigIndex& index, size_t max_observations, std::vector<Instant>* instants) {
  size_t all = 0;
  std::vector<size_t> counts(index.cameras.size(), 0);
  const auto camera_of = [&index](const InstantMember& member) {
    return static_cast<size_t>(index.camera_of_track[static_cast<size_t>(member.track)]);
  };
  for (const Instant& instant : *instants) {
    all += instant.members.size();
    for (const InstantMember& member : instant.members) ++counts[camera_of(member)];
  }
  if (max_observations == 0 || all <= max_observations) return;
  const double share = static_cast<double>(max_observations) / static_cast<double>(counts.size());
  std::erase_if(*instants, [&](const Instant& instant) {
    size_t rarest = all;
    for (const InstantMember& member : instant.members) {
      rarest = std::min(rarest, counts[camera_of(member)]);
    }
    return LotOf(instant.members.front()) * static_cast<double>(rarest) >= share;
  });
}

}  // namespace rigcal::server
