// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/board/corner_fit.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace rigcal::agent {
namespace {

constexpr int kMostSteps = 20;
constexpr double kSmallStepPx = 1e-3;
constexpr double kModelSigmaPx = 0.01;  // how far corners without noise are off
constexpr double kStartBlurPx = 0.8;
// A blur below that of one pixel is a corner that fell between pixels; one above the window's is
// none of a corner.
constexpr double kLeastBlurPx = 0.25, kMostBlurOfWindow = 0.7;
constexpr double kMostMovePx = 1.5;         // further away it is another corner
constexpr double kMostTurn = 0.3;           // radians, of an edge from where it was told
constexpr double kLeastCornerContrast = 5;  // grey levels, of the two kinds of squares
constexpr double kMostResidual = 0.35;      // of half the contrast
// One sigma of the window's Gaussian weights, of its half width: the lens bends edges far away.
constexpr double kWeightShare = 0.6;

// x, y, angle of each line, blur, gain, offset.
using Parameters = Eigen::Matrix<double, 7, 1>;
using Normal = Eigen::Matrix<double, 7, 7>;

// An edge's step at a distance, -1 to 1, and its derivatives.
struct Step {
  double value, by_distance, by_blur;
};
Step StepAt(double distance, double blur) {
  const double u = distance / (blur * std::numbers::sqrt2);
  const double slope =
      2 * std::numbers::inv_sqrtpi * std::exp(-u * u) / (blur * std::numbers::sqrt2);
  return {std::erf(u), slope, -distance / blur * slope};
}

struct Sums {
  Normal information = Normal::Zero();
  Parameters gradient = Parameters::Zero();
  double cost = 0, weights = 0;  // weighted squares of residuals; weights
};

Sums Evaluate(const cv::Mat& grey, const cv::Point& middle, const Eigen::Vector2d& start_px,
              int half, const Parameters& p) {
  Sums sums;
  const double sin_a = std::sin(p[2]), cos_a = std::cos(p[2]);
  const double sin_b = std::sin(p[3]), cos_b = std::cos(p[3]);
  const double falloff = 0.5 / std::pow(kWeightShare * half, 2);
  for (int y = middle.y - half; y <= middle.y + half; ++y) {
    const uint8_t* const row = grey.ptr<uint8_t>(y);
    for (int x = middle.x - half; x <= middle.x + half; ++x) {
      const double u = x - p[0], v = y - p[1];
      const Step a = StepAt(v * cos_a - u * sin_a, p[4]);
      const Step b = StepAt(v * cos_b - u * sin_b, p[4]);
      Parameters slope;
      const double by_a = p[5] * a.by_distance * b.value, by_b = p[5] * b.by_distance * a.value;
      slope << by_a * sin_a + by_b * sin_b, -by_a * cos_a - by_b * cos_b,
          -by_a * (u * cos_a + v * sin_a), -by_b * (u * cos_b + v * sin_b),
          p[5] * (a.by_blur * b.value + a.value * b.by_blur), a.value * b.value, 1;
      const double residual = row[x] - (p[5] * a.value * b.value + p[6]);
      const double weight = std::exp(-falloff * (Eigen::Vector2d(x, y) - start_px).squaredNorm());
      sums.information += weight * slope * slope.transpose();
      sums.gradient += weight * residual * slope;
      sums.cost += weight * residual * residual;
      sums.weights += weight;
    }
  }
  return sums;
}

// Gain and offset for a model that has neither yet.
void FitGrey(const cv::Mat& grey, const cv::Point& middle, const Eigen::Vector2d& start_px,
             int half, Parameters* p) {
  (*p)[5] = 1;
  (*p)[6] = 0;
  const Sums sums = Evaluate(grey, middle, start_px, half, *p);
  const Eigen::Vector2d change =
      sums.information.bottomRightCorner<2, 2>().ldlt().solve(sums.gradient.tail<2>());
  p->tail<2>() += change;
}

}  // namespace

double FittedCorner::Sigma() const {
  return std::hypot(kModelSigmaPx, std::sqrt(0.5 * covariance_px2.trace()));
}

std::optional<FittedCorner> FitCorner(const cv::Mat& grey, const Eigen::Vector2d& start_px,
                                      const Eigen::Vector2d& row, const Eigen::Vector2d& column,
                                      int half_px) {
  if (!start_px.allFinite()) return std::nullopt;
  const cv::Point middle(static_cast<int>(std::lround(start_px.x())),
                         static_cast<int>(std::lround(start_px.y())));
  if (middle.x < half_px || middle.y < half_px || middle.x + half_px >= grey.cols ||
      middle.y + half_px >= grey.rows) {
    return std::nullopt;
  }
  Parameters p;
  p << start_px, std::atan2(row.y(), row.x()), std::atan2(column.y(), column.x()), kStartBlurPx, 1,
      0;
  const Parameters start = p;
  FitGrey(grey, middle, start_px, half_px, &p);
  Sums sums = Evaluate(grey, middle, start_px, half_px, p);
  double damping = 1e-3;
  bool converged = false;
  for (int i = 0; i < kMostSteps && !converged; ++i) {
    Normal damped = sums.information;
    damped.diagonal() *= 1 + damping;
    const Parameters change = damped.ldlt().solve(sums.gradient);
    Parameters next = p + change;
    if (!next.allFinite()) return std::nullopt;
    next[4] = std::clamp(next[4], kLeastBlurPx, kMostBlurOfWindow * half_px);
    const Sums there = Evaluate(grey, middle, start_px, half_px, next);
    converged = change.head<2>().norm() < kSmallStepPx;
    if (there.cost <= sums.cost) {
      p = next;
      sums = there;
      damping *= 0.1;
    } else {
      damping *= 10;
    }
  }
  const Eigen::Vector2d centre_px = p.head<2>();
  const double gain = std::abs(p[5]);
  const double residual = std::sqrt(sums.cost / sums.weights);
  const double turned = std::max(std::abs(p[2] - start[2]), std::abs(p[3] - start[3]));
  if (!converged || (centre_px - start_px).norm() > kMostMovePx || turned > kMostTurn ||
      2 * gain < kLeastCornerContrast || residual > kMostResidual * gain) {
    return std::nullopt;
  }
  FittedCorner corner;
  corner.centre_px = centre_px;
  corner.covariance_px2 = residual * residual * sums.information.inverse().topLeftCorner<2, 2>();
  if (!corner.covariance_px2.allFinite()) return std::nullopt;
  return corner;
}

}  // namespace rigcal::agent
