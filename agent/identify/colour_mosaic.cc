// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/colour_mosaic.h"

#include <Eigen/Core>
#include <algorithm>
#include <cstdlib>

namespace rigcal::agent {
namespace {

constexpr int kLeastPixels = 200;  // fewer say nothing
// A channel is interpolated at the places of the mosaic where its pixels deviate from the mean of
// their neighbours by at most this share of the deviation elsewhere.
constexpr double kInterpolated = 0.5;
constexpr double kLeastGrey = 0.6;  // of the deviation elsewhere; rounding alone makes 0.25

// Least sum of squared differences of colour that tells anything, over that of brightness.
constexpr float kLeastColour = 0.1f;
// Sharpness of colour over that of brightness: 0.1 to 0.75 at half the resolution (up to 1 behind a
// mosaic), 1 at full resolution. Noise, which is stronger in colour, makes it larger.
constexpr float kBlurredColour = 0.95f;

}  // namespace

std::optional<ColourMosaic> FindMosaic(const ImageView& image, const PixelRect& part) {
  if (image.format == PixelFormat::kMono8) return std::nullopt;
  const int left = std::max(part.x, 1), right = std::min(part.x + part.width, image.width - 1);
  const int top = std::max(part.y, 1), bottom = std::min(part.y + part.height, image.height - 1);
  if (right <= left || (right - left) * (bottom - top) < kLeastPixels) return std::nullopt;
  // Sums of twice the deviation from the mean of two neighbours, of blue and red, in the row and in
  // the column, by place in the mosaic's cell of two by two pixels.
  int64_t beside[2][2][2] = {}, above[2][2][2] = {}, count[2][2] = {};
  for (int y = top; y < bottom; ++y) {
    const uint8_t* const row = image.Row(y);
    const uint8_t* const before = image.Row(y - 1);
    const uint8_t* const after = image.Row(y + 1);
    for (int x = left; x < right; ++x) {
      ++count[y & 1][x & 1];
      for (int c = 0; c < 2; ++c) {
        const int k = 3 * x + 2 * c, twice = 2 * row[k];
        beside[c][y & 1][x & 1] += std::abs(twice - row[k - 3] - row[k + 3]);
        above[c][y & 1][x & 1] += std::abs(twice - before[k] - after[k]);
      }
    }
  }
  // The neighbours of a measured red pixel in its row got their red from two measured pixels beside
  // them, and those in its column likewise; the same holds for blue, diagonally.
  double all = 0, best = 0;
  std::optional<ColourMosaic> found;
  for (int i = 0; i < 4; ++i) {
    const int x = i & 1, y = i >> 1;
    double deviation = 0;
    for (int c = 0; c < 2; ++c) {
      const int cx = c == 1 ? x : 1 - x, cy = c == 1 ? y : 1 - y;
      deviation += static_cast<double>(beside[c][cy][1 - cx]) /
                   static_cast<double>(std::max<int64_t>(1, count[cy][1 - cx]));
      deviation += static_cast<double>(above[c][1 - cy][cx]) /
                   static_cast<double>(std::max<int64_t>(1, count[1 - cy][cx]));
    }
    deviation /= 8;  // two channels and two directions, each twice the deviation
    all += deviation;
    if (found && deviation >= best) continue;
    best = deviation;
    found = ColourMosaic{x, y};
  }
  const double elsewhere = (all - best) / 3;
  if (elsewhere < kLeastGrey || best > kInterpolated * elsewhere) return std::nullopt;
  return found;
}

std::optional<bool> IsColourBlurred(const ImageView& image, const PixelRect& part) {
  if (image.format == PixelFormat::kMono8) return false;
  const int left = std::max(part.x, 1), right = std::min(part.x + part.width, image.width - 1);
  const int top = std::max(part.y, 1), bottom = std::min(part.y + part.height, image.height - 1);
  // Sums of squared first and second differences of brightness and of the two colour differences.
  Eigen::Array3f first = Eigen::Array3f::Zero(), second = Eigen::Array3f::Zero();
  const auto parts_of = [](const uint8_t* pixel) {
    const float blue = pixel[0], red = pixel[2];
    const float luma = kLuma[0] * blue + kLuma[1] * pixel[1] + kLuma[2] * red;
    return Eigen::Array3f(luma, blue - luma, red - luma);
  };
  for (int y = top; y < bottom; ++y) {
    for (int x = left; x < right; ++x) {
      const Eigen::Array3f here = parts_of(image.Row(y) + 3 * x);
      const Eigen::Array3f beside[2] = {parts_of(image.Row(y) + 3 * (x - 1)),
                                        parts_of(image.Row(y) + 3 * (x + 1))};
      const Eigen::Array3f above[2] = {parts_of(image.Row(y - 1) + 3 * x),
                                       parts_of(image.Row(y + 1) + 3 * x)};
      first += (beside[1] - beside[0]).square() + (above[1] - above[0]).square();
      second +=
          (beside[1] + beside[0] - 2 * here).square() + (above[1] + above[0] - 2 * here).square();
    }
  }
  const float colour_first = first[1] + first[2];
  if (!(colour_first > kLeastColour * first[0])) return std::nullopt;
  return (second[1] + second[2]) * first[0] < kBlurredColour * second[0] * colour_first;
}

}  // namespace rigcal::agent
