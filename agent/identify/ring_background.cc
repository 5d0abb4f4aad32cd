// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/ring_background.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <numbers>
#include <numeric>
#include <span>

#if defined(__SSE2__)
#include <emmintrin.h>
#endif

#include "agent/detect/blobs/clones.h"
#include "common/statistics/robust_statistics.h"

namespace rigcal::agent {
namespace {

constexpr int kMinArcs = 16, kMaxArcs = 64;
constexpr float kAlike = 0.4f;  // of the contrast: a pixel this near to the plateau is the marker's
constexpr int kMinRingPixels = 24;
constexpr float kOverlap = 0.3f;  // of an arc, by which it reaches into each neighbour

typedef uint8_t Sixteen __attribute__((vector_size(16)));

uint8_t Smallest(Sixteen values) {
#if defined(__SSE2__)
  auto lanes = (__m128i)values;
  lanes = _mm_min_epu8(lanes, _mm_srli_si128(lanes, 8));
  lanes = _mm_min_epu8(lanes, _mm_srli_si128(lanes, 4));
  lanes = _mm_min_epu8(lanes, _mm_srli_si128(lanes, 2));
  lanes = _mm_min_epu8(lanes, _mm_srli_si128(lanes, 1));
  return static_cast<uint8_t>(_mm_cvtsi128_si32(lanes));
#else
  uint8_t smallest = 255;
  for (int i = 0; i < 16; ++i) smallest = std::min<uint8_t>(smallest, values[i]);
  return smallest;
#endif
}

// Returns the upper median of up to 16 kVectors grey levels: the smallest level that more than half
// of them do not exceed. It compares each with all.
template <int kVectors>
uint8_t MedianOfFew(std::span<const uint8_t> values) {
  uint8_t padded[16 * kVectors] = {};
  std::ranges::copy(values, padded);
  Sixteen own[kVectors], not_above[kVectors] = {};
  std::memcpy(own, padded, sizeof(own));
  for (const uint8_t value : values) {
    const Sixteen other = Sixteen{} + value;
    for (int k = 0; k < kVectors; ++k) not_above[k] -= (Sixteen)(other <= own[k]);
  }
  // The zeros that fill up the vectors pass this test only if the median is 0.
  const Sixteen half = Sixteen{} + static_cast<uint8_t>(values.size() / 2);
  Sixteen smallest = Sixteen{} - 1;
  for (int k = 0; k < kVectors; ++k) {
    const Sixteen one = own[k] | (Sixteen)(not_above[k] <= half);
    smallest = smallest < one ? smallest : one;
  }
  return Smallest(smallest);
}

using GreyCounts = std::array<int, 256>;

// Returns the upper median of counted grey levels.
int MedianOf(const GreyCounts& counts, int total) {
  int grey = 0, below = 0;
  while ((below += counts[static_cast<size_t>(grey)]) <= total / 2) ++grey;
  return grey;
}

// Returns the upper median.
uint8_t MedianGrey(std::span<const uint8_t> values) {
  if (values.size() <= 16) return MedianOfFew<1>(values);
  if (values.size() <= 32) return MedianOfFew<2>(values);
  GreyCounts counts{};
  for (const uint8_t value : values) ++counts[value];
  return static_cast<uint8_t>(MedianOf(counts, static_cast<int>(values.size())));
}

// One sigma of the pixels' noise from their distances to the medians of arcs of some ten pixels,
// without outliers; at least 0.5 grey levels.
double NoiseSigma(const GreyCounts& residuals) {
  const int total = std::accumulate(residuals.begin(), residuals.end(), 0);
  if (total == 0) return 0.5;
  const float limit = 2.5f * static_cast<float>(kSigmaOverMad) *
                      (static_cast<float>(MedianOf(residuals, total)) + 0.5f);
  int64_t squares = 0, count = 0;
  for (int64_t grey = 0; grey < 256 && static_cast<float>(grey) <= limit; ++grey) {
    squares += grey * grey * residuals[static_cast<size_t>(grey)];
    count += residuals[static_cast<size_t>(grey)];
  }
  // The cut leaves 0.95 of a Gaussian's variance, and a median of few pixels takes 5 % of it along.
  return std::max(0.5, std::sqrt(static_cast<double>(squares) /
                                 (0.9 * static_cast<double>(std::max(int64_t{1}, count)))));
}

// Writes the directions of a row's pixels, 0 to `all`.
RIGCAL_CLONES void WriteTurns(float x, float y, int step, int count, float all,
                              float* __restrict turns) {
  constexpr auto kPi = std::numbers::pi_v<float>;
  const float ay = y < 0 ? -y : y;
  const float turn = 0.5f / kPi * all;
  for (int i = 0; i < count; ++i) {
    const auto at = x + static_cast<float>(i * step);
    const float ax = at < 0 ? -at : at;
    const float low = ax < ay ? ax : ay, high = ax < ay ? ay : ax;
    // atan to 1e-4 rad; an arc spans at least 0.1 rad.
    const float t = low / (high + 1e-20f), t2 = t * t;
    const float below_45 =
        t *
        (0.99997726f +
         t2 * (-0.33262347f +
               t2 * (0.19354346f + t2 * (-0.11643287f + t2 * (0.05265332f - t2 * 0.01172120f)))));
    const float quarter = ay > ax ? 0.5f * kPi - below_45 : below_45;
    const float half = at < 0 ? kPi - quarter : quarter;
    const float angle = y < 0 ? -half : half;
    const float own = angle * turn + 0.5f * all;
    turns[i] = own < 0 ? 0 : own > all ? all : own;
  }
}

Eigen::Vector3f ToVector(const std::array<uint8_t, 3>& grey) {
  return {static_cast<float>(grey[0]), static_cast<float>(grey[1]), static_cast<float>(grey[2])};
}

}  // namespace

void RingBackground::TurnsOf(const Eigen::Vector2d& offset, int step, int count,
                             std::vector<float>* turns) const {
  turns->resize(std::max(turns->size(), static_cast<size_t>(count)));
  WriteTurns(static_cast<float>(offset.x()), static_cast<float>(offset.y()), step, count,
             static_cast<float>(arcs_.size()), turns->data());
}

// Arcs overlap: a pixel near an end counts for the neighbour too.
template <typename Visit>
void RingBackground::ForArcsOf(const RingPixel& pixel, Visit visit) const {
  const size_t count = arcs_.size();
  const size_t arc = std::min(static_cast<size_t>(pixel.turn), count - 1);
  const float share = pixel.turn - static_cast<float>(arc);
  visit(arc);
  if (share <= kOverlap) visit(arc > 0 ? arc - 1 : count - 1);
  if (share >= 1 - kOverlap) visit(arc + 1 < count ? arc + 1 : 0);
}

bool RingBackground::Read(const ImageView& image, const MarkerAperture& aperture,
                          const PixelGrid& window, const Eigen::Vector3f& plateau_grey,
                          const Ring& where, double* noise_grey) {
  const Eigen::Matrix2d ring = aperture.Grown(where.from_px);
  const Eigen::Matrix2d edge = aperture.Grown(where.from_px + where.width_px);
  const int count =
      2 * std::clamp(  // so that each has an opposite one
              static_cast<int>(std::numbers::pi * (aperture.b + where.from_px) / where.arc_px),
              kMinArcs / 2, kMaxArcs / 2);
  arcs_.assign(static_cast<size_t>(count), Arc());
  pixels_.clear();
  const bool is_mono = image.format == PixelFormat::kMono8;
  const auto read_row = [&](const GridRow& row, const Eigen::Vector2d& offset) {
    TurnsOf(offset, window.step, row.count, &turns_);
    const uint8_t* pixel = image.Row(row.y) + (is_mono ? row.x : 3 * row.x);
    Eigen::Vector2d d = offset;
    for (int i = 0; i < row.count; ++i) {
      if (d.dot(ring * d) > 1 && d.dot(edge * d) < 1) {
        RingPixel& own =
            pixels_.emplace_back(RingPixel{turns_[static_cast<size_t>(i)], {pixel[0], 0, 0}});
        if (!is_mono) own.grey = {pixel[0], pixel[1], pixel[2]};
      }
      d.x() += window.step;
      pixel += (is_mono ? 1 : 3) * window.step;
    }
  };
  // Pixels inside of the ring are skipped.
  ForEllipseRows(window, aperture.centre_px, edge, [&](const GridRow& row) {
    const Eigen::Vector2d offset(row.x - aperture.centre_px.x(), row.y - aperture.centre_px.y());
    const EllipseChord inner(ring, offset.y());
    const double middle = inner.middle - offset.x();
    const int left =
        std::clamp(static_cast<int>((middle - inner.half) / window.step) + 2, 0, row.count);
    const int right = static_cast<int>((middle + inner.half) / window.step);
    if (!(inner.half_squared > 0) || right <= left) return read_row(row, offset);
    read_row({row.number, row.x, row.y, left}, offset);
    if (right >= row.count) return;
    const int skipped_px = right * window.step;
    read_row(
        {row.number + static_cast<size_t>(right), row.x + skipped_px, row.y, row.count - right},
        offset + Eigen::Vector2d(skipped_px, 0));
  });
  if (pixels_.size() < kMinRingPixels) return false;
  const size_t channels = is_mono ? 1 : 3;
  // Pixels of the ring that look like the marker belong to a neighbouring one.
  Eigen::Vector3f middle = Eigen::Vector3f::Zero();
  for (size_t c = 0; c < channels; ++c) {
    GreyCounts counts{};
    for (const RingPixel& pixel : pixels_) ++counts[pixel.grey[c]];
    middle[static_cast<int>(c)] =
        static_cast<float>(MedianOf(counts, static_cast<int>(pixels_.size())));
  }
  const float alike = kAlike * (plateau_grey - middle).norm();
  std::erase_if(pixels_, [&](const RingPixel& p) {
    return (ToVector(p.grey) - plateau_grey).squaredNorm() < alike * alike;
  });
  if (pixels_.size() < kMinRingPixels / 2) return false;
  for (const RingPixel& pixel : pixels_) {
    ForArcsOf(pixel, [&](size_t arc) { ++arcs_[arc].pixels; });
  }
  ends_.resize(arcs_.size());
  size_t total = 0;
  for (size_t k = 0; k < arcs_.size(); ++k) {
    ends_[k] = total;  // moves on as the arc is filled
    total += static_cast<size_t>(arcs_[k].pixels);
  }
  for (auto& greys : greys_) greys.resize(total);
  for (const RingPixel& pixel : pixels_) {
    ForArcsOf(pixel, [&](size_t arc) {
      const size_t place = ends_[arc]++;
      for (size_t c = 0; c < channels; ++c) greys_[c][place] = pixel.grey[c];
    });
  }
  GreyCounts residuals{};
  for (size_t k = 0; k < arcs_.size(); ++k) {
    Arc& arc = arcs_[k];
    const auto size = static_cast<size_t>(arc.pixels);
    if (size == 0) continue;
    for (size_t c = 0; c < channels; ++c) {
      const std::span<const uint8_t> values(&greys_[c][ends_[k] - size], size);
      const uint8_t median = MedianGrey(values);
      arc.background[static_cast<int>(c)] = static_cast<float>(median);
      if (noise_grey == nullptr) continue;
      for (const uint8_t value : values) ++residuals[static_cast<size_t>(std::abs(value - median))];
    }
  }
  // Arcs without pixels, outside of the image or hidden by a neighbour, become like the nearest.
  const std::vector<Arc> read = arcs_;
  for (int k = 0; k < count; ++k) {
    for (int step = 0; step <= count / 2 && arcs_[static_cast<size_t>(k)].pixels == 0; ++step) {
      const Arc& before = read[static_cast<size_t>((k - step + count) % count)];
      const Arc& after = read[static_cast<size_t>((k + step) % count)];
      arcs_[static_cast<size_t>(k)] = before.pixels >= after.pixels ? before : after;
    }
  }
  if (noise_grey != nullptr) *noise_grey = NoiseSigma(residuals);
  return true;
}

}  // namespace rigcal::agent
