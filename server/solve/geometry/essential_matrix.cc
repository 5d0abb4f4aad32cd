// SPDX-License-Identifier: Apache-2.0
#include "server/solve/geometry/essential_matrix.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "server/solve/geometry/five_point.h"

namespace rigcal::server {
namespace {

constexpr size_t kKeptEssentials = 4;
constexpr int kMinSamples = 20, kMaxSamples = 800;
constexpr double kMayMiss = 1e-3;  // probability that no sample is free of outliers

struct ScoredEssential {
  Eigen::Matrix3d matrix;
  double cost = 0;
  int inliers = 0;
};

double SampsonSquared(const Eigen::Matrix3d& essential, const PairMarker& marker) {
  const Eigen::Vector3d a = marker.ray_a.homogeneous(), b = marker.ray_b.homogeneous();
  const Eigen::Vector3d line_b = essential * a, line_a = essential.transpose() * b;
  const double error = b.dot(line_b);
  return error * error / (line_b.head<2>().squaredNorm() + line_a.head<2>().squaredNorm() + 1e-30);
}

// Stops as soon as the cost is beyond `most`: the score is then of no use.
ScoredEssential ScoreEssential(const std::vector<PairInstant>& instants,
                               const Eigen::Matrix3d& essential, double threshold, double most) {
  ScoredEssential scored = {essential};
  const double limit = threshold * threshold;
  for (const PairInstant& instant : instants) {
    for (const PairMarker& marker : instant) {
      const double distance = SampsonSquared(essential, marker);
      if (distance < limit) {
        ++scored.inliers;
        scored.cost += distance / limit;
      } else {
        scored.cost += 1;
      }
    }
    if (scored.cost > most) break;
  }
  return scored;
}

void Keep(const ScoredEssential& candidate, std::vector<ScoredEssential>* kept) {
  kept->insert(std::ranges::upper_bound(*kept, candidate.cost, {}, &ScoredEssential::cost),
               candidate);
  if (kept->size() > kKeptEssentials) kept->pop_back();
}

}  // namespace

std::vector<Eigen::Matrix3d> SampleEssentials(const std::vector<PairInstant>& instants,
                                              const RelativePoseOptions& options) {
  const double threshold = options.threshold_px * 2 / (options.focal_a_px + options.focal_b_px);
  int marker_count = 0;
  for (const PairInstant& instant : instants) marker_count += static_cast<int>(instant.size());
  std::mt19937_64 random(options.seed);
  std::vector<ScoredEssential> kept;
  int needed = kMaxSamples;
  for (int sample = 0; sample < std::max(kMinSamples, needed); ++sample) {
    std::vector<size_t> chosen;
    while (chosen.size() < 5) {
      const size_t index = random() % instants.size();
      if (std::find(chosen.begin(), chosen.end(), index) == chosen.end()) chosen.push_back(index);
    }
    std::vector<RayPair> five;
    for (const size_t index : chosen) {
      const PairMarker& marker = instants[index][random() % instants[index].size()];
      five.push_back({marker.ray_a, marker.ray_b});
    }
    for (const Eigen::Matrix3d& essential : EssentialsOfFivePoints(five)) {
      const double most = kept.size() < kKeptEssentials ? std::numeric_limits<double>::infinity()
                                                        : kept.back().cost;
      const ScoredEssential scored = ScoreEssential(instants, essential, threshold, most);
      if (kept.empty() || scored.cost < kept.front().cost) {
        const double share = static_cast<double>(scored.inliers) / marker_count;
        const double all_good = std::min(std::pow(share, 5), 1 - 1e-9);
        if (all_good > 1e-6) {
          needed = std::min(kMaxSamples,
                            static_cast<int>(std::log(kMayMiss) / std::log1p(-all_good)) + 1);
        }
      }
      Keep(scored, &kept);
    }
  }
  std::vector<Eigen::Matrix3d> best;
  for (const ScoredEssential& essential : kept) best.push_back(essential.matrix);
  return best;
}

std::vector<RigidTransform> DecomposeEssential(const Eigen::Matrix3d& essential) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(essential, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d u = svd.matrixU(), v = svd.matrixV();
  if (u.determinant() < 0) u.col(2) = -u.col(2);
  if (v.determinant() < 0) v.col(2) = -v.col(2);
  Eigen::Matrix3d w;
  w << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  std::vector<RigidTransform> poses;
  for (const Eigen::Matrix3d& rotation : {Eigen::Matrix3d(u * w * v.transpose()),
                                          Eigen::Matrix3d(u * w.transpose() * v.transpose())}) {
    const Eigen::Quaterniond quaternion = Eigen::Quaterniond(rotation).normalized();
    poses.emplace_back(quaternion, u.col(2));
    poses.emplace_back(quaternion, -u.col(2));
  }
  return poses;
}

}  // namespace rigcal::server
