// SPDX-License-Identifier: Apache-2.0
#include "server/solve/clocks/epipolar_score.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "common/statistics/robust_statistics.h"
#include "server/solve/geometry/null_vector.h"

namespace rigcal::server {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr int kReweightings = 6;
constexpr size_t kMaxSamples = 250;

struct Match {
  Eigen::Vector2d a, b;
};

std::vector<Match> Matches(const TrackPaths& a, const TrackPaths& b, double offset_s) {
  std::vector<Match> matches;
  for (size_t m = 0; m < a.markers.size(); ++m) {
    const RayPath& path = a.markers[m];
    const size_t count = path.time_s.size();
    const size_t samples = std::min(count, kMaxSamples);
    for (size_t k = 0; k < samples; ++k) {
      const size_t i = k * count / samples;
      const auto ray = At(b.markers[m], path.time_s[i] - offset_s, b.gap_s);
      if (ray) matches.push_back({path.ray[i], *ray});
    }
  }
  return matches;
}

// Moves and scales one camera's coordinates to order one, in which the eight-point algorithm is
// well conditioned.
void Normalise(std::vector<Match>* matches, Eigen::Vector2d Match::*side, double* scale) {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const Match& match : *matches) mean += match.*side / static_cast<double>(matches->size());
  double squares = 0;
  for (const Match& match : *matches) squares += (match.*side - mean).squaredNorm();
  *scale = std::sqrt(2 * static_cast<double>(matches->size()) / std::max(squares, 1e-12));
  for (Match& match : *matches) match.*side = (match.*side - mean) * *scale;
}

}  // namespace

int CountMatches(const TrackPaths& a, const TrackPaths& b, double offset_s) {
  return static_cast<int>(Matches(a, b, offset_s).size());
}

double EpipolarScorePx(const TrackPaths& a, const TrackPaths& b, double offset_s, int min_matches) {
  std::vector<Match> matches = Matches(a, b, offset_s);
  if (static_cast<int>(matches.size()) < min_matches) return kInfinity;
  double scale_a = 1, scale_b = 1;
  Normalise(&matches, &Match::a, &scale_a);
  Normalise(&matches, &Match::b, &scale_b);
  std::vector<double> weights(matches.size(), 1), distances(matches.size(), 0);
  double median = kInfinity;
  for (int round = 0; round < kReweightings; ++round) {
    Eigen::Matrix<double, 9, 9> normal = Eigen::Matrix<double, 9, 9>::Zero();
    for (size_t i = 0; i < matches.size(); ++i) {
      const Eigen::Vector3d x = matches[i].a.homogeneous(), y = matches[i].b.homogeneous();
      Eigen::Matrix<double, 9, 1> row;
      row << y[0] * x, y[1] * x, y[2] * x;
      normal.selfadjointView<Eigen::Lower>().rankUpdate(row, weights[i]);
    }
    const Eigen::Matrix<double, 9, 1> f = NullVector(normal);
    Eigen::Matrix3d matrix;
    matrix << f.segment<3>(0).transpose(), f.segment<3>(3).transpose(), f.segment<3>(6).transpose();
    for (size_t i = 0; i < matches.size(); ++i) {
      const Eigen::Vector3d x = matches[i].a.homogeneous(), y = matches[i].b.homogeneous();
      const Eigen::Vector3d line_b = matrix * x, line_a = matrix.transpose() * y;
      const double slope = std::sqrt(line_a.head<2>().squaredNorm() * scale_a * scale_a +
                                     line_b.head<2>().squaredNorm() * scale_b * scale_b);
      distances[i] = std::abs(y.dot(line_b)) / std::max(slope, 1e-12);
    }
    median = UpperMedian(distances);
    for (size_t i = 0; i < matches.size(); ++i) {
      const double share = distances[i] / std::max(1.5 * median, 1e-12);
      weights[i] = 1 / (1 + share * share);
    }
  }
  return median * 0.5 * (a.focal_px + b.focal_px);
}

}  // namespace rigcal::server
