// SPDX-License-Identifier: Apache-2.0
#include "tests/testing/rendered_frames.h"

#include <algorithm>
#include <cmath>

#include "common/status/status_macros.h"

namespace rigcal::testing {
namespace {

// The channel (of BGR) of a Bayer sensor at a pixel of its first two rows and columns.
constexpr size_t kBlue = 0;
constexpr size_t kGreen = 1;
constexpr size_t kRed = 2;

size_t BayerChannel(const std::string& pixel_format, size_t x, size_t y) {
  const std::string pattern = pixel_format.substr(5, 2);  // "BayerRG8"
  const bool first_is_green = pattern[0] == 'G';
  // Green lies on one diagonal, red and blue on the other.
  if (((x + y) % 2 == 0) == first_is_green) return kGreen;
  const bool red_in_first_row = pattern == "RG" || pattern == "GR";
  return (y % 2 == 0) == red_in_first_row ? kRed : kBlue;
}

}  // namespace

void EncodeImage(const std::string& pixel_format, std::span<const uint8_t> bgr, int width,
                 std::span<uint8_t> pixels) {
  const size_t columns = static_cast<size_t>(width);
  const size_t count = bgr.size() / 3;
  if (pixel_format == "RGB8") {
    for (size_t i = 0; i < count; ++i) {
      pixels[3 * i] = bgr[3 * i + 2];
      pixels[3 * i + 1] = bgr[3 * i + 1];
      pixels[3 * i + 2] = bgr[3 * i];
    }
    return;
  }
  if (pixel_format == "Mono8") {
    for (size_t i = 0; i < count; ++i) {
      const int grey = 29 * bgr[3 * i] + 150 * bgr[3 * i + 1] + 77 * bgr[3 * i + 2];
      pixels[i] = static_cast<uint8_t>(grey >> 8);
    }
    return;
  }
  for (size_t y = 0; y < 2; ++y) {
    for (size_t x = 0; x < 2; ++x) {
      const size_t channel = BayerChannel(pixel_format, x, y);
      for (size_t row = y; row < count / columns; row += 2) {
        for (size_t i = row * columns + x; i < (row + 1) * columns; i += 2) {
          pixels[i] = bgr[3 * i + channel];
        }
      }
    }
  }
}

absl::StatusOr<std::unique_ptr<RenderedFrames>> RenderedFrames::Create(
    RenderedFramesOptions options) {
  std::unique_ptr<RenderedFrames> frames(new RenderedFrames(std::move(options)));
  const RenderedFramesOptions& set = frames->options_;
  RIGCAL_ASSIGN_OR_RETURN(SimulatedWorld world, SimulatedWorld::Create(set.simulation, set.target));
  frames->world_ = std::make_shared<const SimulatedWorld>(std::move(world));
  for (int i = 0; i < std::max(1, set.threads); ++i) {
    RIGCAL_ASSIGN_OR_RETURN(FrameRenderer renderer,
                            FrameRenderer::Create(frames->world_, set.camera_index, set.rendering));
    frames->frame_count_ = static_cast<uint64_t>(frames->world_->FrameCount(set.camera_index));
    frames->threads_.emplace_back([self = frames.get(), renderer = std::move(renderer)]() mutable {
      self->Render(std::move(renderer));
    });
  }
  std::unique_lock lock(frames->mutex_);
  const uint64_t first = std::min(static_cast<uint64_t>(set.ahead), frames->frame_count_);
  frames->changed_.wait(lock, [&] { return frames->ready_.size() >= first; });
  return frames;
}

RenderedFrames::~RenderedFrames() {
  {
    const std::lock_guard lock(mutex_);
    ending_ = true;
  }
  changed_.notify_all();
  for (std::thread& thread : threads_) thread.join();
}

void RenderedFrames::Render(FrameRenderer renderer) {
  std::vector<uint8_t> bgr(renderer.buffer_size());
  const size_t bytes = bgr.size() / (options_.pixel_format == "RGB8" ? 1 : 3);
  const auto width = static_cast<int>(image_size_px().width);
  std::unique_lock lock(mutex_);
  while (true) {
    changed_.wait(lock, [&] {
      return ending_ || next_render_ < next_due_ + static_cast<uint64_t>(options_.ahead);
    });
    // Frames that are late already are not rendered.
    next_render_ = std::max(next_render_, next_due_);
    if (ending_ || next_render_ >= frame_count_) return;
    const uint64_t index = next_render_++;
    lock.unlock();
    std::vector<uint8_t> pixels(bytes);
    // Never fails for an index below the count.
    if (renderer.Render(static_cast<int>(index), bgr).ok()) {
      EncodeImage(options_.pixel_format, bgr, width, pixels);
    }
    lock.lock();
    if (index >= next_due_) ready_.emplace(index, std::move(pixels));
    changed_.notify_all();
  }
}

int64_t RenderedFrames::Take(uint64_t index, double exposure_s, std::span<uint8_t> pixels) {
  const uint64_t known = std::min(index, frame_count_ - 1);
  const int64_t after_the_end_ns =
      static_cast<int64_t>(1e9 / rate_hz() * static_cast<double>(index - known));
  const int64_t middle_ns =
      world_->Observe(options_.camera_index, static_cast<int>(known)).time_ns + after_the_end_ns;
  {
    const std::lock_guard lock(mutex_);
    next_due_ = index + 1;
    const auto frame = ready_.find(index);
    const bool fits = frame != ready_.end() && frame->second.size() == pixels.size();
    if (fits) {
      std::copy(frame->second.begin(), frame->second.end(), pixels.begin());
    } else {
      std::fill(pixels.begin(), pixels.end(), uint8_t{0});
      if (index < frame_count_) ++late_;
    }
    ready_.erase(ready_.begin(), ready_.upper_bound(index));
  }
  changed_.notify_all();
  return middle_ns - std::llround(exposure_s * 0.5e9);
}

int64_t RenderedFrames::TakeNow(double exposure_s, std::span<uint8_t> pixels) {
  const auto now = std::chrono::steady_clock::now();
  if (!began_) began_ = now;
  const double elapsed_s = std::chrono::duration<double>(now - *began_).count();
  const auto due = static_cast<uint64_t>(std::llround(elapsed_s * rate_hz()));
  next_now_ = std::max(next_now_, due);
  return Take(next_now_++, exposure_s, pixels);
}

uint64_t RenderedFrames::late() const {
  const std::lock_guard lock(mutex_);
  return late_;
}

CameraExport RenderedFrames::Export(const std::string& name) const {
  CameraExport result;
  result.camera = name;
  result.image_size_px = camera().description.image_size_px;
  result.intrinsics = camera().description.intrinsics.value_or(camera().true_intrinsics);
  result.cam_from_rig = camera().cam_from_rig;
  return result;
}

}  // namespace rigcal::testing
