// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "agent/detect/blobs/image_view.h"
#include "common/camera/camera_description.h"
#include "common/simulation/frames/scene_renderer.h"
#include "common/target/target.h"
#include "tests/testing/wand_motion.h"

namespace rigcal::agent {

using ::rigcal::testing::WandMotion;

// Images of a small camera (640x480) with the paper's wand.
class RenderedWand {
 public:
  explicit RenderedWand(const FrameRenderOptions& options = QuietRoom()) {
    camera.camera = "test";
    camera.image_size_px = {640, 480};
    Intrinsics intrinsics;
    intrinsics.fx_px = intrinsics.fy_px = 600;
    intrinsics.cx_px = 320;
    intrinsics.cy_px = 240;
    intrinsics.distortion = {-0.15, 0.05, 0, 0, 0};
    camera.intrinsics = intrinsics;
    target.marker_positions_m = {0, 0.13, 0.39};
    target.diameter_m = 0.04;
    auto renderer = SceneRenderer::Create(intrinsics, camera.image_size_px, target, options);
    EXPECT_TRUE(renderer.ok()) << renderer.status();
    renderer_ = std::make_unique<SceneRenderer>(*std::move(renderer));
    pixels.resize(renderer_->buffer_size());
  }

  static FrameRenderOptions QuietRoom() {
    FrameRenderOptions options;
    options.blink_hz = 0;
    options.led_grey = 180;
    return options;
  }

  static WandMotion Wand(const Eigen::Vector3d& origin_m, const Eigen::Vector3d& direction) {
    WandMotion motion;
    motion.origin_m = origin_m;
    motion.direction = direction.normalized();
    return motion;
  }

  FrameGroundTruth Render(const std::optional<WandMotion>& wand, uint64_t seed = 1) {
    SceneFrame frame;
    if (wand) frame.spheres = wand->Spheres(target);
    frame.seed = seed;
    auto ground_truth = renderer_->Render(frame, pixels);
    EXPECT_TRUE(ground_truth.ok()) << ground_truth.status();
    return *std::move(ground_truth);
  }

  ImageView View() const { return {pixels.data(), 640, 480, 640 * 3, PixelFormat::kBgr8}; }
  void Fill(int x0, int y0, int width, int height, uint8_t b, uint8_t g, uint8_t r) {
    for (int y = y0; y < y0 + height; ++y) {
      for (int x = x0; x < x0 + width; ++x) {
        uint8_t* pixel = &pixels[static_cast<size_t>((y * 640 + x) * 3)];
        pixel[0] = b, pixel[1] = g, pixel[2] = r;
      }
    }
  }

  // The channels of a square around a pixel.
  void Dim(const Eigen::Vector2d& around, int half, const std::array<double, 3>& bgr_factor) {
    for (int y = -half; y <= half; ++y) {
      for (int x = -half; x <= half; ++x) {
        uint8_t* const pixel = At(around, x, y);
        for (size_t c = 0; c < 3; ++c) pixel[c] = static_cast<uint8_t>(bgr_factor[c] * pixel[c]);
      }
    }
  }

  CameraDescription camera;
  Target target;
  std::vector<uint8_t> pixels;

 private:
  uint8_t* At(const Eigen::Vector2d& centre, int x, int y) {
    const auto column = static_cast<size_t>(std::lround(centre.x()) + x);
    return &pixels[3 * (static_cast<size_t>(std::lround(centre.y()) + y) * 640 + column)];
  }

  std::unique_ptr<SceneRenderer> renderer_;
};

}  // namespace rigcal::agent
