// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/frame/spot_likeness.h"

#include <Eigen/Core>
#include <cmath>
#include <cstddef>

namespace rigcal::agent {
namespace {

// One sigma among a wand's markers: of the logarithm of brightness, and of unit colour vectors.
constexpr float kLogBrightnessSigma = 0.3f, kColourSigma = 0.15f;

}  // namespace

double Unlikeness(absl::Span<const Spot> spots, const WandCandidate& candidate) {
  float mean = 0;
  Eigen::Vector3f colour = Eigen::Vector3f::Zero();
  const auto count = static_cast<float>(candidate.blobs.size());
  for (const int blob : candidate.blobs) {
    const Eigen::Vector3f& core = spots[static_cast<size_t>(blob)].core;
    mean += std::log(core.norm()) / count;
    colour += core / core.norm();
  }
  colour.normalize();
  double cost = 0;
  for (const int blob : candidate.blobs) {
    const Eigen::Vector3f& core = spots[static_cast<size_t>(blob)].core;
    const float away = (std::log(core.norm()) - mean) / kLogBrightnessSigma;
    cost += static_cast<double>(away * away + (core / core.norm() - colour).squaredNorm() /
                                                  (kColourSigma * kColourSigma));
  }
  return cost;
}

}  // namespace rigcal::agent
