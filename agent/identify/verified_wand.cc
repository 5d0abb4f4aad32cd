// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/verified_wand.h"

#include <algorithm>

namespace rigcal::agent {
namespace {

constexpr double kWhiteGrey = 240;  // grey levels of a white marker, in every channel
constexpr double kSamePlace = 0.8;  // of the larger radius

}  // namespace

int VerifiedWand::OccludedCount() const {
  return static_cast<int>(std::count(whole.begin(), whole.end(), false));
}

double MeanBrightness(const VerifiedWand& wand) {
  double sum = 0;
  for (const MarkerCentre& centre : wand.centres) sum += centre.plateau_grey.norm();
  return sum / static_cast<double>(std::max<size_t>(1, wand.centres.size()));
}

bool IsWhite(const VerifiedWand& wand) {
  return std::ranges::all_of(wand.centres, [](const MarkerCentre& centre) {
    return centre.plateau_grey.minCoeff() >= kWhiteGrey;
  });
}

bool Disjoint(const VerifiedWand& a, const VerifiedWand& b) {
  return std::none_of(a.blobs.begin(), a.blobs.end(), [&](int blob) {
    return std::find(b.blobs.begin(), b.blobs.end(), blob) != b.blobs.end();
  });
}

bool SamePlaces(const VerifiedWand& a, const VerifiedWand& b) {
  const size_t count = a.centres.size();
  const auto same = [&](bool flipped) {
    for (size_t k = 0; k < count; ++k) {
      const MarkerCentre &one = a.centres[k], &other = b.centres[flipped ? count - 1 - k : k];
      const double reach_px = kSamePlace * std::max(one.radius_px, other.radius_px);
      if (!((one.centre_px - other.centre_px).norm() < reach_px)) return false;
    }
    return true;
  };
  return count == b.centres.size() && (same(false) || same(true));
}

}  // namespace rigcal::agent
