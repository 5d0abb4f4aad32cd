// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/outline_rows.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <iterator>

#include "agent/detect/blobs/clones.h"

// All instruction sets give the same result: the same operations on the same groups, uncontracted.
namespace rigcal::agent {
namespace {

// Half width of the edge in sigmas: its density is (1 - t^2)^2, of variance 1/7.
constexpr float kReach = 2.6457513f;
constexpr float kLeastShape = 0.05f;  // least factor of the edge's variance in a direction
// Share of the edge's variance that is left before a background that clips: a pixel darkens only
// where the sphere covers nearly all of it.
constexpr float kOutshoneEdge = 0.25f;
constexpr float kLeastFacing = 0.02f;  // least squared part of the normal towards the camera
constexpr float kLeastCover = 1e-5f;   // against a division by 0

constexpr size_t kGroup = OutlinePixels::kGroup;

// Half a group, which all instruction sets keep in registers.
constexpr size_t kLanes = kGroup / 2;
typedef float Lanes __attribute__((vector_size(kLanes * sizeof(float))));

#define RIGCAL_INLINE inline __attribute__((always_inline))

RIGCAL_INLINE Lanes Load(const float* from) {
  Lanes lanes;
  std::memcpy(&lanes, from, sizeof(lanes));
  return lanes;
}

RIGCAL_INLINE void Store(const Lanes& lanes, float* to) { std::memcpy(to, &lanes, sizeof(lanes)); }

// So many groups' rows stay in the first-level cache together with all sums.
constexpr size_t kChunk = 4;
constexpr size_t kTileHeight = 4;  // rows that AddTile takes at once

// Weighted rows of derivatives, and the sums by lane.
struct WeightedRows {
  float rows[kChunk * kOutlineCount * kGroup];
  float sums[kOutlineCount * (kOutlineCount + 1) * kLanes];  // by i, then by j or the residual
};

// Adds the products of kHeight weighted rows with one other row, or two. Rows are kGroup values
// apart; the groups of the other row are `stride` apart.
template <size_t kHeight, bool kTwo>
RIGCAL_INLINE void AddTile(const float* weighted, const float* other, size_t stride, size_t groups,
                           float* sums) {
  constexpr size_t kRow = (kOutlineCount + 1) * kLanes;  // of the sums
  Lanes first[kHeight], second[kHeight];
  for (size_t i = 0; i < kHeight; ++i) {
    first[i] = Load(sums + i * kRow);
    if (kTwo) second[i] = Load(sums + i * kRow + kLanes);
  }
  for (size_t g = 0; g < groups; ++g) {
    for (size_t half = 0; half < kGroup; half += kLanes) {
      const Lanes one = Load(other + half);
      Lanes two;
      if (kTwo) two = Load(other + kGroup + half);
      for (size_t i = 0; i < kHeight; ++i) {
        const Lanes row = Load(weighted + i * kGroup + half);
        first[i] += row * one;
        if (kTwo) second[i] += row * two;
      }
    }
    weighted += kOutlineCount * kGroup;
    other += stride;
  }
  for (size_t i = 0; i < kHeight; ++i) {
    Store(first[i], sums + i * kRow);
    if (kTwo) Store(second[i], sums + i * kRow + kLanes);
  }
}

// Multiplies the rows from `i` on with all rows up to them and with the residual.
template <size_t kHeight>
RIGCAL_INLINE void AddBand(size_t i, const float* rows, size_t stride, const float* residual,
                           size_t groups, WeightedRows* weighted) {
  const float* const band = weighted->rows + i * kGroup;
  float* const sums = weighted->sums + i * (kOutlineCount + 1) * kLanes;
  size_t j = 0;
  for (; j + 2 <= i + kHeight; j += 2) {
    AddTile<kHeight, true>(band, rows + j * kGroup, stride, groups, sums + j * kLanes);
  }
  if (j < i + kHeight) {
    AddTile<kHeight, false>(band, rows + j * kGroup, stride, groups, sums + j * kLanes);
  }
  AddTile<kHeight, false>(band, residual, kGroup, groups, sums + kOutlineCount * kLanes);
}

// Sums over the first kUsed parameters.
template <size_t kUsed>
RIGCAL_INLINE void SumRows(const float* rows, size_t stride, const float* weight,
                           const float* residual, size_t groups, WeightedRows* weighted) {
  std::fill(std::begin(weighted->sums), std::end(weighted->sums), 0.0f);
  for (size_t done = 0; done < groups; done += kChunk) {
    const size_t count = std::min(kChunk, groups - done);
    const float* const chunk = rows + done * stride;
    for (size_t g = 0; g < count; ++g) {
      const float* const its_weight = weight + (done + g) * kGroup;
      for (size_t half = 0; half < kGroup; half += kLanes) {
        const float* const row = chunk + g * stride + half;
        float* const to = weighted->rows + g * kOutlineCount * kGroup + half;
        const Lanes one = Load(its_weight + half);
        for (size_t i = 0; i < kUsed; ++i) Store(one * Load(row + i * kGroup), to + i * kGroup);
      }
    }
    size_t i = 0;
    for (; i + kTileHeight <= kUsed; i += kTileHeight) {
      AddBand<kTileHeight>(i, chunk, stride, residual + done * kGroup, count, weighted);
    }
    constexpr size_t kLeft = kUsed % kTileHeight;
    if constexpr (kLeft > 0) {
      AddBand<kLeft>(i, chunk, stride, residual + done * kGroup, count, weighted);
    }
  }
}

// For a sphere's own light, and for all parameters.
RIGCAL_CLONES void SumOwn(const float* rows, size_t stride, const float* weight,
                          const float* residual, size_t groups, WeightedRows* weighted) {
  SumRows<kOutlineOwnX>(rows, stride, weight, residual, groups, weighted);
}

RIGCAL_CLONES void SumAll(const float* rows, size_t stride, const float* weight,
                          const float* residual, size_t groups, WeightedRows* weighted) {
  SumRows<kOutlineCount>(rows, stride, weight, residual, groups, weighted);
}

// Groups whose spreads are multiplied before a logarithm is taken. A spread is hardly more than
// 1e5, so a double holds the product.
constexpr size_t kSpreadChunk = 16;

// Products of the spreads, and sums, by lane.
struct LaneSums {
  double product[kGroup];
  float weights[kGroup], squared_weights[kGroup], squares[kGroup];
};

RIGCAL_CLONES void WeighGroups(const float* __restrict coverage, const float* __restrict precision,
                               const float* __restrict value, size_t stride, size_t groups,
                               float per_width2, float* __restrict residual,
                               float* __restrict weight, LaneSums* __restrict sums) {
  LaneSums all;
  for (size_t k = 0; k < kGroup; ++k) {
    all.product[k] = 1;
    all.weights[k] = all.squared_weights[k] = all.squares[k] = 0;
  }
  for (size_t g = 0; g < groups; ++g) {
    for (size_t k = 0; k < kGroup; ++k) {
      const float its_precision = precision[k];
      const float off = coverage[k] - value[k];
      const float sigmas = off * its_precision;
      const float spread = 1 + sigmas * sigmas * per_width2;
      const float robust = its_precision > 0 ? 1 / spread : 0;
      residual[k] = off;
      weight[k] = robust * its_precision * its_precision;
      all.product[k] *= static_cast<double>(spread);
      all.weights[k] += robust;
      all.squared_weights[k] += robust * robust;
      all.squares[k] += robust * robust * sigmas * sigmas;
    }
    coverage += kGroup, precision += kGroup, residual += kGroup, weight += kGroup;
    value += stride;
  }
  *sums = all;
}

// Fills the rows of one group, with all derivatives or only that by the radius.
template <bool kWhite, bool kAll>
RIGCAL_INLINE void FillGroup(const float* __restrict at_x, const float* __restrict at_y,
                             const float* __restrict shading, const float* __restrict outshone,
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
    const float rho = (1 - n) * per_steep - outshone[i] * q[kOutlineOutshone];
    const float cos2 = nx * nx - ny * ny, sin2 = 2 * nx * ny;
    const float shape = 1 + q[kOutlineEdgeCos] * cos2 + q[kOutlineEdgeSin] * sin2;
    const float narrower = 1 - (1 - kOutshoneEdge) * outshone[i];
    const float squared = q[kOutlineEdge] * narrower * (shape > kLeastShape ? shape : kLeastShape);
    const float per_sigma = 1 / std::sqrt(squared);
    const float z = rho * per_sigma;
    const float raw = z * (1 / kReach);
    const float t = raw < -1 ? -1 : raw > 1 ? 1 : raw, t2 = t * t;
    const float cover = 0.5f + t * (15 - 10 * t2 + 3 * t2 * t2) * (1 / 16.0f);
    const float density = (15 / 16.0f) * (1 - t2) * (1 - t2) * per_sigma * (1 / kReach);
    // Blur brings light from further inside the outline: `deeper` is the mean distance in half
    // widths of the edge, `follows` its change with the place.
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
    // Part of the normal towards the camera; limited, because its slope is infinite at the rim.
    const float facing = 1 - squared_v < kLeastFacing ? kLeastFacing : 1 - squared_v;
    const float nz = std::sqrt(facing);
    const float lambert =
        q[kOutlineSlopeX] * vx + q[kOutlineSlopeY] * vy + q[kOutlineBendAlong] * nz;
    // Selects one of the two models.
    constexpr float w = kWhite ? 1 : 0, p = 1 - w;
    const float lit = shading[i] * ((lambert > 0 ? 1.0f : 0.0f) + q[kOutlineSky]);
    const float slope_by = p + w * lit;
    const float along_by = p * along + w * lit * nz;
    const float diagonal_by = p * diagonal + w * (shading[i] - 1);
    const float own = w * (q[kOutlineOwnX] * vx + q[kOutlineOwnY] * vy);
    const float light = q[kOutlineBrightness] + own +
                        slope_by * (q[kOutlineSlopeX] * vx + q[kOutlineSlopeY] * vy) +
                        along_by * q[kOutlineBendAlong] + diagonal_by * q[kOutlineBendDiagonal] +
                        q[kOutlineBendRound] * round;
    // Derivative of the light by u.
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
    const float by_sigma2 = 0.5f * per_sigma * q[kOutlineEdge] * narrower * (by_width - edge * z);
    out(kOutlineCount, i) = cover * light;
    out(kOutlineRadius, i) = (edge * per_steep - (light_x * ux + light_y * uy)) * per_radius;
    if (!kAll) continue;
    out(kOutlineX, i) = edge * nx - (w00 * light_x + w01 * light_y);
    out(kOutlineY, i) = edge * ny - (w01 * light_x + w11 * light_y);
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
    out(kOutlineOutshone, i) = -outshone[i] * edge;
  }
}

template <bool kWhite, bool kAll>
RIGCAL_INLINE void FillGroups(const OutlinePixels& pixels, const float* parameters, size_t stride,
                              float* rows) {
  for (size_t i = 0; i + kGroup <= pixels.size(); i += kGroup, rows += stride) {
    FillGroup<kWhite, kAll>(&pixels.x[i], &pixels.y[i], &pixels.white[i],
                            &pixels.saturated_behind[i], parameters, rows);
  }
}

RIGCAL_CLONES void FillOwn(const OutlinePixels& pixels, const float* parameters, size_t stride,
                           float* rows) {
  FillGroups<false, true>(pixels, parameters, stride, rows);
}

RIGCAL_CLONES void FillWhite(const OutlinePixels& pixels, const float* parameters, size_t stride,
                             float* rows) {
  FillGroups<true, true>(pixels, parameters, stride, rows);
}

RIGCAL_CLONES void FillOwnEdge(const OutlinePixels& pixels, const float* parameters, size_t stride,
                               float* rows) {
  FillGroups<false, false>(pixels, parameters, stride, rows);
}

RIGCAL_CLONES void FillWhiteEdge(const OutlinePixels& pixels, const float* parameters,
                                 size_t stride, float* rows) {
  FillGroups<true, false>(pixels, parameters, stride, rows);
}

}  // namespace

void OutlineRows::Model(const OutlinePixels& pixels, const float* parameters, bool white_light) {
  rows_.resize(pixels.size() / kGroup * kStride);
  has_all_ = white_light || pixels.IsOutshone();
  if (white_light) {
    FillWhite(pixels, parameters, kStride, rows_.data());
  } else {
    FillOwn(pixels, parameters, kStride, rows_.data());
  }
}

void OutlineRows::ModelEdge(const OutlinePixels& pixels, const float* parameters,
                            bool white_light) {
  rows_.resize(pixels.size() / kGroup * kStride);
  has_all_ = white_light || pixels.IsOutshone();
  if (white_light) {
    FillWhiteEdge(pixels, parameters, kStride, rows_.data());
  } else {
    FillOwnEdge(pixels, parameters, kStride, rows_.data());
  }
}

OutlineWeights OutlineRows::Weigh(const OutlinePixels& pixels, float width,
                                  std::vector<float>* residual, std::vector<float>* weight) const {
  residual->resize(pixels.size());
  weight->resize(pixels.size());
  OutlineWeights total;
  const size_t groups = pixels.size() / kGroup;
  double product = 1;
  for (size_t done = 0; done < groups; done += kSpreadChunk) {
    const size_t first = done * kGroup;
    LaneSums sums;
    WeighGroups(&pixels.coverage[first], &pixels.precision[first],
                &rows_[done * kStride + kOutlineCount * kGroup], kStride,
                std::min(kSpreadChunk, groups - done), 1 / (width * width), &(*residual)[first],
                &(*weight)[first], &sums);
    for (size_t k = 0; k < kGroup; ++k) {
      total.weights += static_cast<double>(sums.weights[k]);
      total.squared_weights += static_cast<double>(sums.squared_weights[k]);
      total.squares += static_cast<double>(sums.squares[k]);
      product *= sums.product[k];
      if (product < 1e150) continue;
      total.log_spreads += std::log(product);
      product = 1;
    }
  }
  total.log_spreads += std::log(product);
  return total;
}

void OutlineRows::Sum(const std::vector<float>& weight, const std::vector<float>& residual,
                      float* products, float* gradient) {
  WeightedRows weighted;
  const size_t groups = rows_.size() / kStride;
  if (has_all_) {
    SumAll(rows_.data(), kStride, weight.data(), residual.data(), groups, &weighted);
  } else {
    SumOwn(rows_.data(), kStride, weight.data(), residual.data(), groups, &weighted);
  }
  const auto total = [&weighted](int i, int j) {
    const float* const lanes =
        weighted.sums + static_cast<size_t>(i * (kOutlineCount + 1) + j) * kLanes;
    static_assert(kLanes == 8);
    float sums[4];
    for (size_t k = 0; k < 4; ++k) sums[k] = lanes[k] + lanes[k + 4];
    return (sums[0] + sums[2]) + (sums[1] + sums[3]);
  };
  for (int i = 0; i < (has_all_ ? kOutlineCount : kOutlineOwnX); ++i) {
    gradient[i] = total(i, kOutlineCount);
    for (int j = 0; j <= i; ++j) products[i * kOutlineCount + j] = total(i, j);
  }
}

}  // namespace rigcal::agent
