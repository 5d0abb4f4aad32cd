// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/marker_centre.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace rigcal::agent {
namespace {

constexpr double kMarginPx = 2.5;    // around the blob, for what its threshold left out
constexpr double kGapPx = 1.0;       // from there to the ring
constexpr double kClip = 0.8;        // coverage from which on a pixel counts as covered
constexpr double kCore = 0.55;       // of the blob's ellipse: the plateau is read there
constexpr double kMinContrast = 12;  // grey levels
constexpr int kMinRingPixels = 24;
constexpr int kMaxIterations = 12;

float Grey(const uint8_t* pixel, int channel) { return static_cast<float>(pixel[channel]); }

double Median(std::vector<float>* values) {
  const auto middle = values->begin() + static_cast<ptrdiff_t>(values->size() / 2);
  std::nth_element(values->begin(), middle, values->end());
  return static_cast<double>(*middle);
}

}  // namespace

// An ellipse of semi-axes `a` >= `b`, and how far the looked at pixels lie from it.
struct MarkerMeter::Aperture {
  Eigen::Vector2d centre_px;
  Eigen::Matrix2d shape;  // x^T shape x = 1 on the blob's own ellipse
  double a = 1, b = 1;
  double ring_px = 3;

  explicit Aperture(const Blob& blob) : centre_px(blob.centre_px) {
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen(blob.second_moment_px2);
    // A pixel's own extent; a blob of one row has no moment across it.
    const Eigen::Vector2d squared = (4 * eigen.eigenvalues()).cwiseMax(1.0);
    b = std::sqrt(squared[0]);
    a = std::sqrt(squared[1]);
    axes_ = eigen.eigenvectors();
    shape = axes_ * squared.cwiseInverse().asDiagonal() * axes_.transpose();
    ring_px = std::max(3.0, 0.35 * b);
  }

  // Squared radius in units of the ellipse that lies `margin_px` outside of the blob's.
  Eigen::Matrix2d Grown(double margin_px) const {
    const Eigen::Vector2d semi(b + margin_px, a + margin_px);
    return axes_ * semi.cwiseAbs2().cwiseInverse().asDiagonal() * axes_.transpose();
  }
  double Reach() const { return a + kMarginPx + kGapPx + ring_px; }
  // From 1 inside to 0 outside over one pixel about the aperture's edge.
  double Weight(const Eigen::Vector2d& offset, const Eigen::Matrix2d& grown) const {
    const Eigen::Vector2d g = grown * offset;
    const double r2 = offset.dot(g);
    const double slope = g.norm();
    if (!(slope > 1e-9)) return 1;
    return std::clamp(0.5 - 0.5 * (r2 - 1) / slope, 0.0, 1.0);
  }

 private:
  Eigen::Matrix2d axes_;
};

bool MarkerMeter::Combine(const ImageView& image, const Aperture& aperture, MarkerCentre* centre) {
  const double reach = aperture.Reach();
  const int x0 = static_cast<int>(std::floor(aperture.centre_px.x() - reach));
  const int y0 = static_cast<int>(std::floor(aperture.centre_px.y() - reach));
  const int x1 = static_cast<int>(std::ceil(aperture.centre_px.x() + reach)) + 1;
  const int y1 = static_cast<int>(std::ceil(aperture.centre_px.y() + reach)) + 1;
  // The ring may be cut, what is summed may not.
  const double need = aperture.a + 1;
  centre->cut = aperture.centre_px.x() - need < 0 || aperture.centre_px.y() - need < 0 ||
                aperture.centre_px.x() + need > image.width - 1 ||
                aperture.centre_px.y() + need > image.height - 1;
  window_ = {std::max(x0, 0), std::max(y0, 0), 0, 0};
  window_.width = std::min(x1, image.width) - window_.x;
  window_.height = std::min(y1, image.height) - window_.y;
  if (window_.empty()) return false;

  const int channels = image.format == PixelFormat::kBgr8 ? 3 : 1;
  const Eigen::Matrix2d ring = aperture.Grown(kMarginPx + kGapPx);
  const Eigen::Matrix2d edge = aperture.Grown(kMarginPx + kGapPx + aperture.ring_px);
  Eigen::Vector3d contrast = Eigen::Vector3d::Zero();
  for (int k = 0; k < channels; ++k) {
    values_.clear();
    double core = 0;
    int core_count = 0;
    for (int y = window_.y; y < window_.y + window_.height; ++y) {
      const uint8_t* row = image.Row(y);
      for (int x = window_.x; x < window_.x + window_.width; ++x) {
        const Eigen::Vector2d d(x - aperture.centre_px.x(), y - aperture.centre_px.y());
        const float value = Grey(row + x * channels, k);
        if (d.dot(aperture.shape * d) < kCore * kCore) {
          core += static_cast<double>(value);
          ++core_count;
        } else if (d.dot(ring * d) > 1 && d.dot(edge * d) < 1) {
          values_.push_back(value);
        }
      }
    }
    if (values_.size() < kMinRingPixels || core_count == 0) return false;
    contrast[k] = std::max(0.0, core / core_count - Median(&values_));
  }
  if (!(contrast.maxCoeff() > kMinContrast)) return false;
  centre->colour = contrast.normalized();
  const Eigen::Vector3f weight = (contrast / contrast.sum()).cast<float>();
  grey_.resize(static_cast<size_t>(window_.width) * static_cast<size_t>(window_.height));
  size_t i = 0;
  for (int y = window_.y; y < window_.y + window_.height; ++y) {
    const uint8_t* pixel = image.Row(y) + window_.x * channels;
    for (int x = 0; x < window_.width; ++x, pixel += channels, ++i) {
      grey_[i] = channels == 1 ? Grey(pixel, 0)
                               : weight[0] * Grey(pixel, 0) + weight[1] * Grey(pixel, 1) +
                                     weight[2] * Grey(pixel, 2);
    }
  }
  return true;
}

bool MarkerMeter::FitBackground(const Aperture& aperture, MarkerCentre* centre) {
  const Eigen::Matrix2d ring = aperture.Grown(kMarginPx + kGapPx);
  const Eigen::Matrix2d edge = aperture.Grown(kMarginPx + kGapPx + aperture.ring_px);
  const auto for_ring = [&](auto&& visit) {
    size_t i = 0;
    for (int y = window_.y; y < window_.y + window_.height; ++y) {
      for (int x = window_.x; x < window_.x + window_.width; ++x, ++i) {
        const Eigen::Vector2d d(x - aperture.centre_px.x(), y - aperture.centre_px.y());
        if (d.dot(ring * d) > 1 && d.dot(edge * d) < 1) visit(d, static_cast<double>(grey_[i]));
      }
    }
  };
  plane_.setZero();
  double limit = 0, sigma = 0;
  int used = 0;
  constexpr int kRounds = 4;
  for (int round = 0; round < kRounds; ++round) {
    values_.clear();
    for_ring([&](const Eigen::Vector2d& d, double grey) {
      values_.push_back(static_cast<float>(grey - plane_[1] * d.x() - plane_[2] * d.y()));
    });
    const double middle = round == 0 ? Median(&values_) : plane_[0];
    for (float& value : values_) value = std::abs(value - static_cast<float>(middle));
    sigma = std::max(0.5, 1.4826 * Median(&values_));
    limit = 2.5 * sigma;
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    double squares = 0;
    used = 0;
    for_ring([&](const Eigen::Vector2d& d, double grey) {
      const double residual = grey - middle - plane_[1] * d.x() - plane_[2] * d.y();
      if (std::abs(residual) > limit) return;
      const Eigen::Vector3d row(1, d.x(), d.y());
      normal += row * row.transpose();
      right += row * grey;
      squares += residual * residual;
      ++used;
    });
    if (used < kMinRingPixels / 2) return false;
    // A plane only where the ring surrounds the marker well enough to hold one.
    const Eigen::LDLT<Eigen::Matrix3d> solver(normal);
    plane_ = solver.solve(right);
    gradient_covariance_ = solver.solve(Eigen::Matrix3d::Identity()).bottomRightCorner<2, 2>();
    // What a cut at 2.5 sigma leaves of a Gaussian's variance is 0.92.
    sigma = std::sqrt(squares / used / 0.92);
  }
  centre->noise_grey = std::max(sigma, 0.3);
  return plane_.allFinite();
}

bool MarkerMeter::FindCentroid(Aperture* aperture, MarkerCentre* centre) {
  double core = 0, behind = 0;
  int core_count = 0;
  size_t i = 0;
  const Eigen::Vector2d origin = aperture->centre_px;
  for (int y = window_.y; y < window_.y + window_.height; ++y) {
    for (int x = window_.x; x < window_.x + window_.width; ++x, ++i) {
      const Eigen::Vector2d d(x - origin.x(), y - origin.y());
      if (d.dot(aperture->shape * d) >= kCore * kCore) continue;
      core += static_cast<double>(grey_[i]);
      behind += plane_[0] + plane_[1] * d.x() + plane_[2] * d.y();
      ++core_count;
    }
  }
  plateau_grey_ = core / core_count;
  centre->contrast_grey = plateau_grey_ - behind / core_count;
  if (!(centre->contrast_grey > kMinContrast)) return false;

  coverage_.resize(grey_.size());
  i = 0;
  for (int y = window_.y; y < window_.y + window_.height; ++y) {
    for (int x = window_.x; x < window_.x + window_.width; ++x, ++i) {
      const double background =
          plane_[0] + plane_[1] * (x - origin.x()) + plane_[2] * (y - origin.y());
      const double range = std::max(plateau_grey_ - background, 0.25 * centre->contrast_grey);
      const double share = (static_cast<double>(grey_[i]) - background) / range;
      coverage_[i] = static_cast<float>(std::min(share / kClip, 1.0));
    }
  }
  const Eigen::Matrix2d grown = aperture->Grown(kMarginPx);
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    double sum = 0;
    Eigen::Vector2d first = Eigen::Vector2d::Zero();
    i = 0;
    for (int y = window_.y; y < window_.y + window_.height; ++y) {
      for (int x = window_.x; x < window_.x + window_.width; ++x, ++i) {
        const Eigen::Vector2d d(x - aperture->centre_px.x(), y - aperture->centre_px.y());
        const double share = aperture->Weight(d, grown) * static_cast<double>(coverage_[i]);
        sum += share;
        first += share * d;
      }
    }
    if (!(sum > 1)) return false;
    const Eigen::Vector2d step = first / sum;
    aperture->centre_px += step;
    if (!((aperture->centre_px - origin).norm() < aperture->a)) return false;
    if (step.squaredNorm() < 1e-8) break;
  }
  centre->centre_px = aperture->centre_px;
  return true;
}

void MarkerMeter::MeasureShape(const Aperture& aperture, MarkerCentre* centre) {
  const Eigen::Matrix2d grown = aperture.Grown(kMarginPx);
  double sum = 0, noise6 = 0;
  Eigen::Matrix2d second = Eigen::Matrix2d::Zero(), noise = Eigen::Matrix2d::Zero();
  Eigen::Matrix2d leverage = Eigen::Matrix2d::Zero();
  Eigen::Vector4d third = Eigen::Vector4d::Zero();  // xxx, xxy, xyy, yyy
  size_t i = 0;
  for (int y = window_.y; y < window_.y + window_.height; ++y) {
    for (int x = window_.x; x < window_.x + window_.width; ++x, ++i) {
      const Eigen::Vector2d d(x - aperture.centre_px.x(), y - aperture.centre_px.y());
      const double weight = aperture.Weight(d, grown);
      if (weight <= 0) continue;
      const double coverage = static_cast<double>(coverage_[i]), share = weight * coverage;
      const Eigen::Matrix2d square = d * d.transpose();
      sum += share;
      second += share * square;
      third += share * Eigen::Vector4d(d.x() * square(0, 0), d.y() * square(0, 0),
                                       d.x() * square(1, 1), d.y() * square(1, 1));
      if (coverage >= 1) continue;  // clipped: its noise does not count
      noise += weight * weight * square;
      leverage += weight * (1 - kClip * std::max(coverage, 0.0)) * square;
      noise6 += weight * weight * std::pow(d.squaredNorm(), 3);
    }
  }
  const double per_grey = 1 / (kClip * centre->contrast_grey * sum);
  const double variance = centre->noise_grey * centre->noise_grey;
  centre->covariance_px2 = variance * per_grey * per_grey *
                           (noise + leverage * gradient_covariance_ * leverage.transpose());
  centre->second_moment_px2 = second / sum;
  centre->radius_px = std::sqrt(sum / std::numbers::pi);
  const double scale = 1 / (sum * std::pow(centre->radius_px, 3));
  // Each mixed moment stands for three equal ones of the tensor.
  centre->skewness = scale * std::sqrt(third.dot(third.cwiseProduct(Eigen::Vector4d(1, 3, 3, 1))));
  centre->skewness_sigma = std::sqrt(variance * noise6) * per_grey / std::pow(centre->radius_px, 3);
  centre->spread = 4 * std::numbers::pi *
                   std::sqrt(std::max(0.0, centre->second_moment_px2.determinant())) / sum;
}

bool MarkerMeter::Measure(const ImageView& image, const Blob& blob, MarkerCentre* centre) {
  Aperture aperture(blob);
  *centre = MarkerCentre();
  if (!Combine(image, aperture, centre) || !FitBackground(aperture, centre) ||
      !FindCentroid(&aperture, centre)) {
    return false;
  }
  MeasureShape(aperture, centre);
  return centre->centre_px.allFinite() && centre->covariance_px2.allFinite() &&
         std::isfinite(centre->skewness) && std::isfinite(centre->spread);
}

}  // namespace rigcal::agent
