// SPDX-License-Identifier: Apache-2.0
// Collects the pixels of a marker and of its surroundings to which its outline is fitted.
#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "agent/identify/marker_centre.h"

namespace rigcal::agent {
namespace {

// Saturated channels are left out if the others have enough contrast: kLeastUnsaturatedGrey and
// this share of the whole; or much less before an even background: kLeastEvenGrey, so many sigmas
// of noise and steps of the background. Little light that is measured tells the place better than
// much clipped.
constexpr double kLeastUnsaturated = 0.25, kLeastUnsaturatedGrey = 40;
constexpr double kLeastEvenGrey = 15, kLeastEvenNoises = 8, kLeastEvenSteps = 8;
constexpr double kModelNoise = 0.015;  // one sigma of the outline's model, in units of coverage
constexpr int kMosaicTries = 3;        // attempts to find the mosaic of an image
constexpr double kMosaicNoise = 1.3;   // noise of a measured channel, over that of all pixels' mean
constexpr double kLeastChannel = 0.2;  // least contrast of a channel, as a share of the whole
constexpr float kLeastLuma = 0.4f;   // least brightness of a marker, of the norm over all channels
constexpr float kMostWhite = 6;      // limit of OutlinePixels::white
constexpr double kRimPx = 5;         // further inside every fifth pixel is enough
constexpr double kInsideStep = 5.3;  // pixels per one taken inside; not in step with a mosaic
constexpr double kEnoughPixels = 700;  // pixels of a rim; more are thinned out
// The ring right beside the outline where something else is near: gap, width, length of an arc.
constexpr double kBesidePx = 1.6, kBesideWidthPx = 1.8, kBesideArcPx = 1.6;
constexpr double kBesideNoise = 0.03;  // takes the place of kModelNoise there
// Root of the sum of two squares. std::hypot would also cope with overflow.
float Root(float a, float b) { return std::sqrt(a * a + b * b); }

struct UsedChannels {
  Eigen::Vector3f used = Eigen::Vector3f::Ones();  // 1, or 0 for a channel that is left out
  double least_grey = 0;                           // least contrast of a channel that is used
  bool clipped = false;                            // saturated ones are used
};

// Returns the unsaturated channels if they stand out enough, else all.
UsedChannels ChannelsToUse(const RingBackground& background, const MarkerCentre& centre) {
  Eigen::Vector3f mean = Eigen::Vector3f::Zero();
  for (const auto& arc : background.arcs()) mean += arc.background;
  mean /= static_cast<float>(background.arcs().size());
  const Eigen::Vector3d range = centre.plateau_grey - mean.cast<double>();
  UsedChannels channels;
  for (size_t c = 0; c < 3; ++c) channels.used[static_cast<int>(c)] = centre.saturated[c] ? 0 : 1;
  const double left_grey = range.cwiseProduct(channels.used.cast<double>()).norm();
  const double usual = std::max(kLeastUnsaturatedGrey, kLeastUnsaturated * range.norm());
  const double even = std::max({kLeastEvenGrey, kLeastEvenNoises * centre.noise_grey,
                                kLeastEvenSteps * centre.background_steps * range.norm()});
  channels.least_grey = kLeastChannel * centre.contrast_grey;
  if (left_grey < std::min(usual, even)) {
    channels.clipped = channels.used.minCoeff() == 0;
    channels.used.setOnes();
  } else if (left_grey < usual) {
    channels.least_grey = kLeastChannel * left_grey;
  }
  return channels;
}

}  // namespace

// Which pixels are taken, and against which background.
struct MarkerMeter::Collection {
  const MarkerAperture& aperture;
  const MarkerCentre& centre;
  const RingBackground& background;
  const PixelGrid& window;
  double reach_px;     // beyond the aperture's ellipse
  double model_noise;  // in units of coverage
  bool near;           // also beside something else, and before brighter backgrounds
};

void MarkerMeter::AddPixels(const ImageView& image, const Collection& how, OutlinePixels* pixels) {
  const MarkerAperture& aperture = how.aperture;
  const MarkerCentre& centre = how.centre;
  const std::vector<RingBackground::Arc>& arcs = how.background.arcs();
  const double noise = centre.noise_grey / std::max(1.0, centre.contrast_grey);
  const auto precision = static_cast<float>(1 / std::hypot(noise, how.model_noise));
  const auto single_noise = static_cast<float>(kMosaicNoise * centre.noise_grey);
  const auto model_noise = static_cast<float>(how.model_noise);
  const Eigen::Vector3f plateau = centre.plateau_grey.cast<float>();
  // Saturation hides shading, which then moves the edge.
  const UsedChannels channels = ChannelsToUse(how.background, centre);
  const Eigen::Vector3f& used = channels.used;
  pixels->clipped = channels.clipped;
  const Eigen::Map<const Eigen::Vector3f> luma(kLuma);
  const auto least = static_cast<float>(channels.least_grey);
  if (!mosaic_ && mosaic_tries_ < kMosaicTries) {
    mosaic_ = FindMosaic(image, how.window.rect);
    ++mosaic_tries_;
  }
  if (!mosaic_ && !is_colour_blurred_) {
    is_colour_blurred_ = IsColourBlurred(image, how.window.rect);
  }
  // Only brightness shows then where an edge is; of a blue marker it shows too little.
  const bool by_luma = !mosaic_ && is_colour_blurred_.value_or(false) &&
                       plateau.dot(luma) > kLeastLuma * plateau.norm();
  if (by_luma) pixels->clipped = centre.saturated != std::array<bool, 3>{};
  const Eigen::Matrix2d outside = aperture.Grown(how.reach_px);
  const bool large = aperture.b > 2 * kRimPx;
  const Eigen::Matrix2d inside = aperture.Grown(large ? -kRimPx : 0);
  // A sphere that is close to the camera has many pixels, which all say the same.
  const double rim =
      2 * std::numbers::pi * aperture.a * (std::min(kRimPx, aperture.b) + how.reach_px);
  const double step = std::max(1.0, rim / kEnoughPixels / (how.window.step * how.window.step));
  double turn = 0;
  const auto add = [&](size_t i, int x, int y, const Eigen::Vector2d& d, float direction) {
    if (d.dot(outside * d) > 1 || (!how.near && arcs[arc_of_[i]].blocked)) return;
    turn += large && d.dot(inside * d) < 1 ? 1 / kInsideStep : 1;
    if (turn < step) return;
    turn -= step;
    const auto at_x = static_cast<float>(x), at_y = static_cast<float>(y);
    if (!mosaic_ && !how.near && !by_luma && used.minCoeff() > 0) {
      pixels->Add(at_x, at_y, share_[i], precision);
      return;
    }
    size_t arc = 0;
    const Eigen::Vector3f background = how.background.At(direction, &arc);
    const Eigen::Vector3f above = GreyAt(image, x, y) - background;
    Eigen::Vector3f range = plateau - background;
    if (by_luma) {
      const float contrast = range.dot(luma);
      if (std::abs(contrast) < least) return;
      pixels->Add(at_x, at_y, above.dot(luma) / contrast,
                  1 / Root(single_noise / std::abs(contrast), model_noise), 1,
                  background.maxCoeff() >= kSaturatedGrey);
      return;
    }
    if (!mosaic_) {
      range = range.cwiseProduct(used);
      const float squared = range.squaredNorm();
      if (squared < least * least) return;
      pixels->Add(at_x, at_y, above.dot(range) / squared,
                  1 / Root(single_noise / std::sqrt(squared), model_noise), 1,
                  background.cwiseProduct(used).maxCoeff() >= kSaturatedGrey);
      return;
    }
    const int channel = mosaic_->Channel(x, y);
    if (!(used[channel] > 0)) return;
    if ((how.near ? std::abs(range[channel]) : range[channel]) < least) return;
    pixels->Add(at_x, at_y, above[channel] / range[channel],
                1 / Root(single_noise / range[channel], model_noise),
                std::clamp(range.maxCoeff() / range[channel], -kMostWhite, kMostWhite),
                background[channel] >= kSaturatedGrey);
  };
  how.background.ForDirections(how.window, aperture.centre_px, outside, &turns_, add);
  pixels->FillUp();
}

void MarkerMeter::CollectPixels(const ImageView& image, const MarkerCentre& centre,
                                OutlinePixels* pixels) {
  pixels->Clear();
  if (!has_measured_) return;
  AddPixels(image,
            {*outlined_, centre, background_, window_,
             MarkerAperture::kMarginPx + MarkerAperture::kGapPx, kModelNoise, false},
            pixels);
}

bool MarkerMeter::CollectNear(const ImageView& image, const Blob& blob, const MarkerCentre& centre,
                              OutlinePixels* pixels) {
  pixels->Clear();
  const MarkerAperture aperture(blob);
  const PixelGrid window = GridAround(image, aperture, aperture.a + kBesidePx + kBesideWidthPx + 1);
  if (window.rect.empty() ||
      !beside_.Read(image, aperture, window, centre.plateau_grey.cast<float>(),
                    {kBesidePx, kBesideWidthPx, kBesideArcPx}, nullptr)) {
    return false;
  }
  AddPixels(image, {aperture, centre, beside_, window, kBesidePx, kBesideNoise, true}, pixels);
  return true;
}

}  // namespace rigcal::agent
