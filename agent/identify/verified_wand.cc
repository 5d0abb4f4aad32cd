// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/verified_wand.h"

#include <algorithm>
#include <cmath>

namespace rigcal::agent {
namespace {

constexpr double kBrightnessSigma = 0.2, kDarkBrightnessSigma = 0.4;  // of its logarithm
constexpr double kColourSigma = 0.12;                                 // rad
constexpr double kSkewness = 0.012;
constexpr double kWhiteGrey = 240;
constexpr double kUnresolvedCost = 2.7;              // per pixel of the radius
constexpr double kTiltCost = 4;                      // of the logarithm of its cosine
constexpr double kSamePlace = 0.8, kSamePart = 1.3;  // of a radius

}  // namespace

int VerifiedWand::OccludedCount() const {
  return static_cast<int>(std::count(whole.begin(), whole.end(), false));
}

double VerifiedWand::LargestSigmaRadii() const {
  double largest = 0;
  for (size_t k = 0; k < centres.size(); ++k) {
    if (!whole[k]) continue;
    const double sigma_px = std::sqrt(0.5 * centres[k].covariance_px2.trace());
    largest = std::max(largest, sigma_px / centres[k].radius_px);
  }
  return largest;
}

double Lopsidedness(const MarkerCentre& centre) {
  const double excess = std::max(0.0, centre.skewness - 2 * centre.skewness_sigma);
  return std::min(std::pow(excess / kSkewness, 2), kOccludedCost);
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

double UnresolvedCost(const VerifiedWand& wand) {
  double radius_px = 0;
  int count = 0;
  for (size_t k = 0; k < wand.whole.size(); ++k) {
    if (!wand.whole[k]) continue;
    radius_px += wand.centres[k].radius_px;
    ++count;
  }
  if (count == 0) return 0;
  return kUnresolvedCost * std::max(0.0, kResolvedPx - radius_px / count);
}

bool IsWhite(const VerifiedWand& wand) {
  return std::ranges::all_of(wand.centres, [](const MarkerCentre& centre) {
    return !(centre.contrast_grey > 0) || centre.plateau_grey.minCoeff() >= kWhiteGrey;
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
      // The middle of a part that is seen is anywhere within the marker.
      const bool is_part = !flipped && !(a.whole[k] && b.whole[k]);
      const double reach_px =
          (is_part ? kSamePart : kSamePlace) * std::max(one.radius_px, other.radius_px);
      if (!((one.centre_px - other.centre_px).norm() < reach_px)) return false;
    }
    return true;
  };
  return count == b.centres.size() && (same(false) || same(true));
}

bool SameWholes(const VerifiedWand& a, const VerifiedWand& b) {
  for (size_t k = 0; k < a.blobs.size(); ++k) {
    if (a.whole[k] != b.whole[k] || (a.whole[k] && a.blobs[k] != b.blobs[k])) return false;
  }
  return true;
}

bool SameWholeBlobs(const VerifiedWand& a, const VerifiedWand& b) {
  absl::InlinedVector<int, 3> of_a, of_b;
  for (size_t k = 0; k < a.blobs.size(); ++k) {
    if (a.whole[k]) of_a.push_back(a.blobs[k]);
    if (b.whole[k]) of_b.push_back(b.blobs[k]);
  }
  std::sort(of_a.begin(), of_a.end());
  std::sort(of_b.begin(), of_b.end());
  return of_a.size() < a.blobs.size() && of_a == of_b;
}

bool IsPartOf(const VerifiedWand& part, const VerifiedWand& wand) {
  if (part.OccludedCount() == 0 || part.blobs.size() != wand.blobs.size() ||
      SameWholeBlobs(part, wand)) {
    return false;
  }
  for (size_t k = 0; k < part.blobs.size(); ++k) {
    if (!part.whole[k]) continue;
    bool is_there = false;
    for (size_t m = 0; m < wand.blobs.size(); ++m) {
      const MarkerCentre& centre = wand.centres[m];
      const double reach_px = (wand.whole[m] ? kSamePlace : kSamePart) * centre.radius_px;
      is_there |= (part.centres[k].centre_px - centre.centre_px).norm() < reach_px;
    }
    if (!is_there) return false;
  }
  return true;
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
