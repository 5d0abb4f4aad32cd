// SPDX-License-Identifier: Apache-2.0
#include "server/solve/clocks/motion_spectrum.h"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>
#include <unsupported/Eigen/FFT>

namespace rigcal::server {
namespace {

using Matrix9d = Eigen::Matrix<double, 9, 9>;
using Vector9d = Eigen::Matrix<double, 9, 1>;

constexpr size_t kCount = MotionSpectrum::kMonomials;
// Of the product of two homogeneous coordinates among the monomials u^2, u v, v^2, u, v, 1.
constexpr size_t kProduct[3][3] = {{0, 1, 3}, {1, 2, 4}, {3, 4, 5}};
constexpr int kPowerIterations = 3;
constexpr double kMostGridSamples = 1 << 17;  // a camera's spectra of three markers have 38 MB
constexpr double kCoarsestGridS = 0.1;

struct TimeRange {
  double first_s = std::numeric_limits<double>::infinity();
  double last_s = -std::numeric_limits<double>::infinity();
};

TimeRange RangeOf(const TrackPaths& paths) {
  TimeRange range;
  for (const RayPath& path : paths.markers) {
    if (path.time_s.empty()) continue;
    range.first_s = std::min(range.first_s, path.time_s.front());
    range.last_s = std::max(range.last_s, path.time_s.back());
  }
  return range;
}

// Moves and scales rays to order one.
struct Normalisation {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  double scale = 1;
};

Normalisation NormalisationOf(const TrackPaths& paths) {
  Normalisation result;
  double count = 0, squares = 0;
  for (const RayPath& path : paths.markers) {
    for (const Eigen::Vector2d& ray : path.ray) result.mean += ray;
    count += static_cast<double>(path.ray.size());
  }
  if (count == 0) return result;
  result.mean /= count;
  for (const RayPath& path : paths.markers) {
    for (const Eigen::Vector2d& ray : path.ray) squares += (ray - result.mean).squaredNorm();
  }
  result.scale = std::sqrt(2 * count / std::max(squares, 1e-12));
  return result;
}

Eigen::FFT<double> HalfSpectrumFft() {
  Eigen::FFT<double> fft;
  fft.SetFlag(Eigen::FFT<double>::HalfSpectrum);
  return fft;
}

// The normal matrix at one lag, from the sums of products by monomial of b, then of a.
Matrix9d NormalAt(const std::array<std::vector<double>, kCount * kCount>& sums, size_t at) {
  Matrix9d normal;
  for (size_t i = 0; i < 3; ++i) {
    for (size_t k = 0; k < 3; ++k) {
      for (size_t j = 0; j < 3; ++j) {
        for (size_t l = 0; l < 3; ++l) {
          normal(static_cast<Eigen::Index>(3 * i + j), static_cast<Eigen::Index>(3 * k + l)) =
              sums[kProduct[i][k] * kCount + kProduct[j][l]][at];
        }
      }
    }
  }
  return normal;
}

// Root mean square epipolar distance in rays (by Sampson's weights, averaged), of the matrix that
// fits best. `guess`: of a nearby lag; replaced.
double EpipolarRms(const Matrix9d& normal, double scale_a, double scale_b, Vector9d* guess) {
  const double small = 1e-13 * normal.trace();
  const Eigen::LLT<Matrix9d> factor(normal + small * Matrix9d::Identity());
  if (factor.info() != Eigen::Success) return 0;
  Vector9d f = *guess;
  for (int i = 0; i < kPowerIterations; ++i) f = factor.solve(f).normalized();
  *guess = f;
  const double residual = f.dot(normal * f);
  double slope = 0;
  const auto moment_a = normal.bottomRightCorner<3, 3>();
  Eigen::Matrix3d moment_b;
  for (Eigen::Index i = 0; i < 3; ++i) {
    for (Eigen::Index k = 0; k < 3; ++k) moment_b(i, k) = normal(3 * i + 2, 3 * k + 2);
  }
  for (Eigen::Index k = 0; k < 2; ++k) {
    const Eigen::Vector3d line_b = f.segment<3>(3 * k);  // y_k (f x)
    const Eigen::Vector3d line_a(f[k], f[3 + k], f[6 + k]);
    slope += scale_b * scale_b * line_b.dot(moment_a * line_b) +
             scale_a * scale_a * line_a.dot(moment_b * line_a);
  }
  return std::sqrt(std::max(0.0, residual) / std::max(slope, 1e-300));
}

}  // namespace

double SpanS(const TrackPaths& paths) {
  const TimeRange range = RangeOf(paths);
  return range.last_s >= range.first_s ? range.last_s - range.first_s : 0;
}

std::optional<double> GridStepS(double span_s, double finest_s) {
  double step_s = finest_s;
  while (span_s > kMostGridSamples * step_s) step_s *= 2;
  if (step_s > kCoarsestGridS) return std::nullopt;
  return step_s;
}

int GridSamples(const TrackPaths& paths, double step_s) {
  const TimeRange range = RangeOf(paths);
  if (!(range.last_s >= range.first_s)) return 0;
  return static_cast<int>((range.last_s - range.first_s) / step_s) + 1;
}

int FftSizeFor(int samples) {
  for (int size = std::max(2, samples);; ++size) {
    if (size % 2 != 0) continue;
    int rest = size;
    for (const int factor : {2, 3, 5}) {
      while (rest % factor == 0) rest /= factor;
    }
    if (rest == 1) return size;
  }
}

MotionSpectrum SpectrumOf(const TrackPaths& paths, double step_s, int fft_size) {
  MotionSpectrum spectrum;
  const Normalisation normal = NormalisationOf(paths);
  spectrum.sample_count = GridSamples(paths, step_s);
  spectrum.fft_size = fft_size;
  spectrum.step_s = step_s;
  spectrum.focal_px = paths.focal_px;
  spectrum.scale = normal.scale;
  if (spectrum.sample_count > 0) spectrum.first_time_s = RangeOf(paths).first_s;
  Eigen::FFT<double> fft = HalfSpectrumFft();
  for (const RayPath& path : paths.markers) {
    std::array<std::vector<double>, kCount> values;
    for (auto& value : values) value.assign(static_cast<size_t>(fft_size), 0);
    for (int i = 0; i < spectrum.sample_count; ++i) {
      const auto ray = At(path, spectrum.first_time_s + step_s * i, paths.gap_s);
      if (!ray) continue;
      const Eigen::Vector2d x = normal.scale * (*ray - normal.mean);
      const double products[kCount] = {x[0] * x[0], x[0] * x[1], x[1] * x[1], x[0], x[1], 1};
      for (size_t k = 0; k < kCount; ++k) values[k][static_cast<size_t>(i)] = products[k];
    }
    auto& marker = spectrum.markers.emplace_back();
    for (size_t k = 0; k < kCount; ++k) fft.fwd(marker[k], values[k]);
  }
  return spectrum;
}

LagScores ScoreAllLags(const MotionSpectrum& a, const MotionSpectrum& b, int min_matches) {
  LagScores scores;
  scores.step_s = a.step_s;
  if (a.sample_count == 0 || b.sample_count == 0) return scores;
  const int first_lag = 1 - b.sample_count;
  scores.first_offset_s = a.first_time_s - b.first_time_s + a.step_s * first_lag;
  Eigen::FFT<double> fft = HalfSpectrumFft();
  const auto size = static_cast<size_t>(a.fft_size);
  const size_t half = size / 2 + 1;
  std::array<std::vector<double>, kCount * kCount> sums;
  MotionSpectrum::Half product(half);
  for (size_t k = 0; k < kCount; ++k) {
    for (size_t l = 0; l < kCount; ++l) {
      std::ranges::fill(product, 0);
      for (size_t m = 0; m < a.markers.size(); ++m) {
        const auto &of_a = a.markers[m][l], &of_b = b.markers[m][k];
        for (size_t i = 0; i < half; ++i) {
          const double ar = of_a[i].real(), ai = of_a[i].imag();
          const double br = of_b[i].real(), bi = of_b[i].imag();
          product[i] += std::complex<double>(ar * br + ai * bi, ai * br - ar * bi);
        }
      }
      auto& sum = sums[k * kCount + l];
      sum.resize(size);
      fft.inv(sum, product, a.fft_size);
    }
  }
  const double focal_px = 0.5 * (a.focal_px + b.focal_px);
  // Each lag begins where the one before has ended: their matrices are alike.
  Vector9d guess = Vector9d::Constant(1.0 / 3);
  for (int lag = first_lag; lag < a.sample_count; ++lag) {
    const auto at = static_cast<size_t>(lag < 0 ? lag + a.fft_size : lag);
    const double count = std::round(sums[kCount * kCount - 1][at]);
    scores.matches.push_back(static_cast<int>(count));
    if (count < min_matches) {
      scores.rms_px.push_back(std::numeric_limits<double>::infinity());
      continue;
    }
    const Matrix9d normal = NormalAt(sums, at) / count;
    scores.rms_px.push_back(focal_px * EpipolarRms(normal, a.scale, b.scale, &guess));
  }
  return scores;
}

LagScores DistanceFromItself(const MotionSpectrum& spectrum, int min_matches) {
  LagScores scores;
  scores.step_s = spectrum.step_s;
  const size_t half = static_cast<size_t>(spectrum.fft_size) / 2 + 1;
  // Of |x(t) - x(t - tau)|^2 the mixed terms, and of ones.
  MotionSpectrum::Half squares(half), ones(half);
  for (const auto& marker : spectrum.markers) {
    for (size_t i = 0; i < half; ++i) {
      const std::complex<double> seen = std::conj(marker[5][i]);
      squares[i] += 2 * std::real((marker[0][i] + marker[2][i]) * seen) -
                    2 * (std::norm(marker[3][i]) + std::norm(marker[4][i]));
      ones[i] += std::norm(marker[5][i]);
    }
  }
  Eigen::FFT<double> fft = HalfSpectrumFft();
  std::vector<double> square, count;
  fft.inv(square, squares, spectrum.fft_size);
  fft.inv(count, ones, spectrum.fft_size);
  for (size_t lag = 0; lag < static_cast<size_t>(spectrum.sample_count); ++lag) {
    const double matches = std::round(count[lag]);
    scores.matches.push_back(static_cast<int>(matches));
    const double rms = std::sqrt(std::max(0.0, square[lag]) / std::max(1.0, matches));
    scores.rms_px.push_back(matches < min_matches ? std::numeric_limits<double>::infinity()
                                                  : spectrum.focal_px / spectrum.scale * rms);
  }
  return scores;
}

}  // namespace rigcal::server
