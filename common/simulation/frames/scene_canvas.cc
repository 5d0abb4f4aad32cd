// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/frames/scene_canvas.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/simulation/frames/room_painter.h"

namespace rigcal {

double OccludingBar::InsidePx(const Eigen::Vector2d& pixel) const {
  const Eigen::Vector2d away = pixel - centre_px;
  const Eigen::Vector2d along(-normal.y(), normal.x());
  return std::min(half_width_px - std::abs(away.dot(normal)),
                  half_length_px - std::abs(away.dot(along)));
}

double StickImage::InsidePx(const Eigen::Vector2d& pixel) const {
  const Eigen::Vector2d along = end_px - begin_px, away = pixel - begin_px;
  const double squared = along.squaredNorm();
  const double share = squared > 0 ? std::clamp(away.dot(along) / squared, 0.0, 1.0) : 0;
  return (1 - share) * begin_half_px + share * end_half_px - (away - share * along).norm();
}

SceneCanvas::SceneCanvas(const ImageSize& image_size, const FrameRenderOptions& options,
                         const LightModel& light, std::vector<int16_t> room)
    : image_size_(image_size),
      black_grey_(options.black_grey),
      vignetting_(options.vignetting),
      bar_grey_(light.grey_per_cd_m2 * light.room_cd_m2),
      noise_(options.read_noise_grey, options.electrons_per_grey),
      linear_(std::move(room)),
      sigma_(linear_.size()) {
  noise_.Sigma(linear_, sigma_);
}

size_t SceneCanvas::PixelIndex(int x, int y) const {
  return 3 * (static_cast<size_t>(y) * image_size_.width + static_cast<size_t>(x));
}

std::span<int16_t> SceneCanvas::Row(const ImagePatch& patch, int row) {
  return {&linear_[PixelIndex(patch.x, patch.y + row)], 3 * static_cast<size_t>(patch.width)};
}

void SceneCanvas::Keep(const ImagePatch& patch) {
  kept_patches_.push_back(patch);
  for (int row = 0; row < patch.height; ++row) {
    const auto pixels = Row(patch, row);
    kept_.insert(kept_.end(), pixels.begin(), pixels.end());
  }
}

void SceneCanvas::UpdateSigma(const ImagePatch& patch) {
  for (int row = 0; row < patch.height; ++row) {
    const auto pixels = Row(patch, row);
    noise_.Sigma(pixels, {&sigma_[PixelIndex(patch.x, patch.y + row)], pixels.size()});
  }
}

// The last patch first: they may overlap.
void SceneCanvas::Reset() {
  for (; !kept_patches_.empty(); kept_patches_.pop_back()) {
    const ImagePatch& patch = kept_patches_.back();
    for (int row = patch.height - 1; row >= 0; --row) {
      const auto pixels = Row(patch, row);
      std::copy(kept_.end() - static_cast<ptrdiff_t>(pixels.size()), kept_.end(), pixels.begin());
      kept_.resize(kept_.size() - pixels.size());
    }
    UpdateSigma(patch);
  }
}

double SceneCanvas::Passed(int x, int y) const {
  return VignettingAt(image_size_, vignetting_, x, y);
}

void SceneCanvas::AddSphere(const SphereImage& sphere, const SphereLight& light) {
  Keep(sphere.patch);
  size_t i = 0;
  for (int row = 0; row < sphere.patch.height; ++row) {
    int16_t* pixel = Row(sphere.patch, row).data();
    for (int column = 0; column < sphere.patch.width; ++column, ++i, pixel += 3) {
      const double cover = light.cover * static_cast<double>(sphere.cover[i]);
      const double lit = static_cast<double>(sphere.lit[i]) +
                         light.halo * light.lit_share * static_cast<double>(sphere.halo[i]);
      if (cover <= 0 && lit <= 0) continue;
      const double passed = Passed(sphere.patch.x + column, sphere.patch.y + row);
      const double shell = black_grey_ + passed * light.shell;
      const double spot = light.cover * static_cast<double>(sphere.spot[i]) * passed * light.spot;
      for (size_t channel = 0; channel < 3; ++channel) {
        const double behind = static_cast<double>(pixel[channel]) / kLinearPerGrey;
        pixel[channel] = ToLinear((1 - cover) * behind + cover * shell + spot +
                                  lit * passed * light.led[channel]);
      }
    }
  }
  UpdateSigma(sphere.patch);
}

void SceneCanvas::AddStick(std::span<const StickImage> places, const Bgr& bgr_grey,
                           const EdgeProfile& profile) {
  if (places.empty()) return;
  const Eigen::Array2d last(image_size_.width - 1.0, image_size_.height - 1.0);
  Eigen::Array2d low = last, high = Eigen::Array2d::Zero();
  for (const StickImage& place : places) {
    const double reach =
        std::max(place.begin_half_px, place.end_half_px) + static_cast<double>(profile.reach_px());
    low = low.min(place.begin_px.array().min(place.end_px.array()) - reach);
    high = high.max(place.begin_px.array().max(place.end_px.array()) + reach);
  }
  low = low.max(0.0);
  high = high.min(last);
  if (!(high >= low).all()) return;
  const Eigen::Array2i first = low.cast<int>(), end = high.cast<int>();
  const ImagePatch patch{first.x(), first.y(), end.x() - first.x() + 1, end.y() - first.y() + 1};
  Keep(patch);
  for (int row = 0; row < patch.height; ++row) {
    int16_t* pixel = Row(patch, row).data();
    for (int column = 0; column < patch.width; ++column, pixel += 3) {
      const int x = patch.x + column, y = patch.y + row;
      double cover = 0;
      for (const StickImage& place : places) {
        cover += static_cast<double>(
            profile.At(static_cast<float>(place.InsidePx(Eigen::Vector2d(x, y)))));
      }
      cover /= static_cast<double>(places.size());
      if (cover <= 0) continue;
      const double passed = Passed(x, y);
      for (size_t channel = 0; channel < 3; ++channel) {
        const double behind = static_cast<double>(pixel[channel]) / kLinearPerGrey;
        pixel[channel] =
            ToLinear((1 - cover) * behind + cover * (black_grey_ + passed * bgr_grey[channel]));
      }
    }
  }
  UpdateSigma(patch);
}

void SceneCanvas::AddBar(const OccludingBar& bar, const EdgeProfile& profile) {
  const double reach =
      std::hypot(bar.half_width_px, bar.half_length_px) + static_cast<double>(profile.reach_px());
  const Eigen::Array2d last(image_size_.width - 1.0, image_size_.height - 1.0);
  const Eigen::Array2i low = (bar.centre_px.array() - reach).max(0.0).min(last).cast<int>();
  const Eigen::Array2i high = (bar.centre_px.array() + reach).max(0.0).min(last).cast<int>();
  const ImagePatch patch{low.x(), low.y(), high.x() - low.x() + 1, high.y() - low.y() + 1};
  Keep(patch);
  for (int row = 0; row < patch.height; ++row) {
    int16_t* pixel = Row(patch, row).data();
    for (int column = 0; column < patch.width; ++column, pixel += 3) {
      const int x = patch.x + column, y = patch.y + row;
      const auto inside_px = static_cast<float>(bar.InsidePx(Eigen::Vector2d(x, y)));
      const auto cover = static_cast<double>(profile.At(inside_px));
      if (cover <= 0) continue;
      const double grey = black_grey_ + bar_grey_ * bar.reflectance * Passed(x, y);
      for (int channel = 0; channel < 3; ++channel) {
        const double behind = static_cast<double>(pixel[channel]) / kLinearPerGrey;
        pixel[channel] = ToLinear((1 - cover) * behind + cover * grey);
      }
    }
  }
  UpdateSigma(patch);
}

void SceneCanvas::Expose(uint64_t seed, std::span<uint8_t> bgr) const {
  const size_t row_size = size_t{3} * image_size_.width;
  for (uint32_t y = 0; y < image_size_.height; ++y) {
    const size_t at = y * row_size;
    noise_.Expose({&linear_[at], row_size}, {&sigma_[at], row_size}, seed, static_cast<int>(y),
                  bgr.subspan(at, row_size));
  }
}

}  // namespace rigcal
