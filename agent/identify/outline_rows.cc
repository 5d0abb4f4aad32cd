// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/outline_rows.h"

#include <algorithm>
#include <cmath>

// All instruction sets give the same result: the same operations on the same groups, none of them
// contracted.
#if defined(__x86_64__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define RIGCAL_CLONES __attribute__((target_clones("avx2", "default")))
#else
#define RIGCAL_CLONES
#endif

namespace rigcal::agent {
namespace {

// Half width of the edge in sigmas: its density is (1 - t^2)^2, of variance 1/7.
constexpr float kReach = 2.6457513f;
constexpr float kLeastShape = 0.05f;
constexpr float kLeastFacing = 0.02f;
constexpr float kLeastCover = 1e-5f;

constexpr size_t kGroup = OutlinePixels::kGroup;

// Sum of a * b; `b` has a group every `stride` values.
RIGCAL_CLONES float Product(const float* a, const float* b, size_t stride, size_t groups) {
  float sums[kGroup] = {};
  for (size_t i = 0; i < groups; ++i, a += kGroup, b += stride) {
    for (size_t k = 0; k < kGroup; ++k) sums[k] += a[k] * b[k];
  }
  float sum = 0;
  for (const float one : sums) sum += one;
  return sum;
}

RIGCAL_CLONES void Multiply(const float* __restrict a, const float* __restrict b, size_t stride,
                            size_t groups, float* __restrict result) {
  for (size_t i = 0; i < groups; ++i, a += kGroup, b += stride, result += kGroup) {
    for (size_t k = 0; k < kGroup; ++k) result[k] = a[k] * b[k];
  }
}

// One group.
RIGCAL_CLONES void FillGroup(const float* __restrict at_x, const float* __restrict at_y,
                             const float* __restrict shading, float white,
                             const float* __restrict parameters, float* __restrict rows) {
  float q[kOutlineCount];
  std::copy_n(parameters, kOutlineCount, q);
  const float per_radius = 1 / q[kOutlineRadius];
  const float w00 = (1 + q[kOutlineStretch]) * per_radius, w01 = q[kOutlineShear] * per_radius;
  const float w11 = (1 - q[kOutlineStretch]) * per_radius;
  const float half_per_edge = 0.5f / q[kOutlineEdge];
  const auto out = [rows](int parameter, size_t i) -> float& {
    return rows[static_cast<size_t>(parameter) * kGroup + i];
  };
  for (size_t i = 0; i < kGroup; ++i) {
    const float dx = at_x[i] - q[kOutlineX], dy = at_y[i] - q[kOutlineY];
    const float ux = w00 * dx + w01 * dy, uy = w01 * dx + w11 * dy;
    const float n = std::sqrt(ux * ux + uy * uy + 1e-12f);
    const float per_n = 1 / n;
    const float gx = (w00 * ux + w01 * uy) * per_n, gy = (w01 * ux + w11 * uy) * per_n;
    const float per_steep = 1 / std::sqrt(gx * gx + gy * gy + 1e-12f);
    const float nx = gx * per_steep, ny = gy * per_steep;  // outwards
    const float rho = (1 - n) * per_steep;
    const float cos2 = nx * nx - ny * ny, sin2 = 2 * nx * ny;
    const float shape = 1 + q[kOutlineEdgeCos] * cos2 + q[kOutlineEdgeSin] * sin2;
    const float squared = q[kOutlineEdge] * (shape > kLeastShape ? shape : kLeastShape);
    const float per_sigma = 1 / std::sqrt(squared);
    const float z = rho * per_sigma;
    const float raw = z * (1 / kReach);
    const float t = raw < -1 ? -1 : raw > 1 ? 1 : raw, t2 = t * t;
    const float cover = 0.5f + t * (15 - 10 * t2 + 3 * t2 * t2) * (1 / 16.0f);
    const float density = (15 / 16.0f) * (1 - t2) * (1 - t2) * per_sigma * (1 / kReach);
    // Blur brings light from inside of the outline, from this far in the mean; in half widths of
    // the edge, and its change with the place.
    const float squared_rest = (1 - t2) * (1 - t2);
    const float per_cover = 1 / (cover > kLeastCover ? cover : kLeastCover);
    const float deeper = (5 / 32.0f) * squared_rest * (1 - t2) * per_cover;
    const float follows = 1 - (15 / 16.0f) * squared_rest * per_cover * (t + deeper);
    const float radial = follows < 0 ? 0 : follows > 1 ? 1 : follows;
    const float from = raw < -1 ? 1 : n - deeper * kReach * squared * per_sigma / per_steep;
    const float clip = from > 0 ? from * per_n : 0;
    const float vx = clip * ux, vy = clip * uy;
    const float along = vx * vx - vy * vy, diagonal = 2 * vx * vy;
    const float squared_v = vx * vx + vy * vy, round = squared_v - 0.5f;
    // Towards the camera; its slope has no end at the rim.
    const float facing = 1 - squared_v < kLeastFacing ? kLeastFacing : 1 - squared_v;
    const float nz = std::sqrt(facing);
    const float lambert =
        q[kOutlineSlopeX] * vx + q[kOutlineSlopeY] * vy + q[kOutlineBendAlong] * nz;
    const float lit = shading[i] * ((lambert > 0 ? 1.0f : 0.0f) + q[kOutlineSky]);
    // Which of the two models.
    const float w = white, p = 1 - white;
    const float slope_by = p + w * lit;
    const float along_by = p * along + w * lit * nz;
    const float diagonal_by = p * diagonal + w * (shading[i] - 1);
    const float own = w * (q[kOutlineOwnX] * vx + q[kOutlineOwnY] * vy);
    const float light = q[kOutlineBrightness] + own +
                        slope_by * (q[kOutlineSlopeX] * vx + q[kOutlineSlopeY] * vy) +
                        along_by * q[kOutlineBendAlong] + diagonal_by * q[kOutlineBendDiagonal] +
                        q[kOutlineBendRound] * round;
    // Change of the light with u.
    const float along_w = w * lit * q[kOutlineBendAlong] / nz;
    const float raw_x = slope_by * q[kOutlineSlopeX] + w * q[kOutlineOwnX] - along_w * vx +
                        2 * ((p * q[kOutlineBendAlong] + q[kOutlineBendRound]) * vx +
                             p * q[kOutlineBendDiagonal] * vy);
    const float raw_y = slope_by * q[kOutlineSlopeY] + w * q[kOutlineOwnY] - along_w * vy +
                        2 * ((q[kOutlineBendRound] - p * q[kOutlineBendAlong]) * vy +
                             p * q[kOutlineBendDiagonal] * vx);
    const float outwards = (raw_x * ux + raw_y * uy) * per_n * per_n;
    const float light_x = cover * (clip * raw_x + (radial - clip) * outwards * ux);
    const float light_y = cover * (clip * raw_y + (radial - clip) * outwards * uy);
    const float edge = light * density;
    const float along_n = edge * per_n * per_steep * per_radius;
    // A softer edge brings light from further inside.
    const float by_width = -cover * outwards * n * (deeper - t * (radial - 1)) * kReach / per_steep;
    const float by_sigma2 = 0.5f * per_sigma * q[kOutlineEdge] * (by_width - edge * z);
    out(kOutlineCount, i) = cover * light;
    out(kOutlineX, i) = edge * nx - (w00 * light_x + w01 * light_y);
    out(kOutlineY, i) = edge * ny - (w01 * light_x + w11 * light_y);
    out(kOutlineRadius, i) = (edge * per_steep - (light_x * ux + light_y * uy)) * per_radius;
    out(kOutlineStretch, i) = -along_n * (ux * dx - uy * dy) - edge * rho * cos2 +
                              (light_x * dx - light_y * dy) * per_radius;
    out(kOutlineShear, i) = -along_n * (ux * dy + uy * dx) - edge * rho * sin2 +
                            (light_x * dy + light_y * dx) * per_radius;
    out(kOutlineEdge, i) = (by_width * squared * per_sigma - edge * rho) * half_per_edge;
    out(kOutlineEdgeCos, i) = by_sigma2 * cos2;
    out(kOutlineEdgeSin, i) = by_sigma2 * sin2;
    out(kOutlineBrightness, i) = cover;
    out(kOutlineSlopeX, i) = cover * slope_by * vx;
    out(kOutlineSlopeY, i) = cover * slope_by * vy;
    out(kOutlineBendAlong, i) = cover * along_by;
    out(kOutlineBendDiagonal, i) = cover * diagonal_by;
    out(kOutlineBendRound, i) = cover * round;
    out(kOutlineOwnX, i) = w * cover * vx;
    out(kOutlineOwnY, i) = w * cover * vy;
    out(kOutlineSky, i) = w * cover * shading[i] * lambert;
  }
}

}  // namespace

void OutlinePixels::Clear() {
  for (auto* values : {&x, &y, &coverage, &precision, &white}) values->clear();
  saturated_behind.clear();
  stick_side.clear();
}

void OutlinePixels::Add(float at_x, float at_y, float its_coverage, float its_precision,
                        float its_white, bool is_saturated_behind) {
  x.push_back(at_x);
  y.push_back(at_y);
  coverage.push_back(its_coverage);
  precision.push_back(its_precision);
  white.push_back(its_white);
  saturated_behind.push_back(is_saturated_behind ? 1 : 0);
}

void OutlinePixels::FillUp() {
  while (!x.empty() && x.size() % kGroup != 0) Add(x.back(), y.back(), coverage.back(), 0);
}

void OutlineRows::Model(const OutlinePixels& pixels, const float* parameters, bool white_light) {
  const size_t groups = pixels.size() / kGroup;
  rows_.resize(groups * kStride);
  used_ = white_light ? kOutlineCount : kOutlineOwnX;
  for (size_t g = 0; g < groups; ++g) {
    FillGroup(&pixels.x[g * kGroup], &pixels.y[g * kGroup], &pixels.white[g * kGroup],
              white_light ? 1.0f : 0.0f, parameters, &rows_[g * kStride]);
  }
}

void OutlineRows::Sum(const std::vector<float>& weight, const std::vector<float>& residual,
                      float* products, float* gradient) {
  const size_t groups = rows_.size() / kStride;
  weighted_.resize(groups * kGroup);
  const auto row = [this](int i) { return rows_.data() + static_cast<size_t>(i) * kGroup; };
  for (int i = 0; i < used_; ++i) {
    Multiply(weight.data(), row(i), kStride, groups, weighted_.data());
    gradient[i] = Product(weighted_.data(), residual.data(), kGroup, groups);
    for (int j = 0; j <= i; ++j) {
      products[i * kOutlineCount + j] = Product(weighted_.data(), row(j), kStride, groups);
    }
  }
}

}  // namespace rigcal::agent
