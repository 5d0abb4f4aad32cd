// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/verified_wand.h"

#include <algorithm>
#include <cmath>

namespace rigcal::agent {
namespace {

constexpr double kBrightnessSigma = 0.2, kDarkBrightnessSigma = 0.4;  // of its logarithm
constexpr double kColourSigma = 0.12;                                 // rad
constexpr double kSkewness = 0.012;
constexpr double kMostLopsidedness = 7.5;  // cost
constexpr double kCostScale = 2.5;         // of the log-odds
constexpr double kWhiteGrey = 240;
constexpr double kTiltCost = 4;     // of the logarithm of its cosine
constexpr double kSamePlace = 0.8;  // of a radius

}  // namespace

int VerifiedWand::OccludedCount() const {
  return static_cast<int>(std::count(whole.begin(), whole.end(), false));
}

double Lopsidedness(const MarkerCentre& centre) {
  const double excess = std::max(0.0, centre.skewness - 2 * centre.skewness_sigma);
  return std::min(std::pow(excess / kSkewness, 2), kMostLopsidedness);
}

double Lopsidedness(const VerifiedWand& wand) {
  double cost = 0;
  for (const MarkerCentre& centre : wand.centres) {
    if (centre.contrast_grey > 0) cost += Lopsidedness(centre);
  }
  return cost;
}

double Unlikeness(const VerifiedWand& wand, bool in_room) {
  absl::InlinedVector<MarkerCentre, 3> centres;
  for (const MarkerCentre& centre : wand.centres) {
    if (centre.contrast_grey > 0) centres.push_back(centre);
  }
  double mean = 0;
  Eigen::Vector3d colour = Eigen::Vector3d::Zero();
  for (const MarkerCentre& centre : centres) {
    mean += std::log(centre.plateau_grey.norm()) / static_cast<double>(centres.size());
    colour += centre.plateau_grey.normalized();
  }
  colour.normalize();
  const double sigma = in_room ? kBrightnessSigma : kDarkBrightnessSigma;
  double cost = 0;
  for (const MarkerCentre& centre : centres) {
    cost += std::pow((std::log(centre.plateau_grey.norm()) - mean) / sigma, 2);
    cost += (centre.plateau_grey.normalized() - colour).squaredNorm() / std::pow(kColourSigma, 2);
  }
  return cost;
}

double TiltCost(double tilt_rad) {
  return -kTiltCost * std::log(std::max(0.01, std::cos(tilt_rad)));
}

double ColourDifference(const VerifiedWand& wand) {
  double largest = 0;
  for (const MarkerCentre& a : wand.centres) {
    for (const MarkerCentre& b : wand.centres) {
      if (!(a.contrast_grey > 0) || !(b.contrast_grey > 0)) continue;
      largest =
          std::max(largest, (a.plateau_grey.normalized() - b.plateau_grey.normalized()).norm());
    }
  }
  return largest;
}

bool IsWhite(const VerifiedWand& wand) {
  return std::ranges::all_of(wand.centres, [](const MarkerCentre& centre) {
    return !(centre.contrast_grey > 0) || centre.plateau_grey.minCoeff() >= kWhiteGrey;
  });
}

double ConfidenceOf(double cost) { return 1 / (1 + std::exp((cost - kHalfCost) / kCostScale)); }

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

double MeanBrightness(const VerifiedWand& wand) {
  double sum = 0;
  int count = 0;
  for (const MarkerCentre& centre : wand.centres) {
    sum += centre.plateau_grey.norm();
    count += centre.contrast_grey > 0 ? 1 : 0;
  }
  return sum / std::max(1, count);
}

}  // namespace rigcal::agent
