// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "agent/capture/frame_source.h"

namespace rigcal::agent {

// A source of frames that measures the time to read each, and ends after a number of them.
class TimedFrameSource : public FrameSource {
 public:
  // `limit` 0: none.
  TimedFrameSource(std::unique_ptr<FrameSource> frames, uint64_t limit)
      : frames_(std::move(frames)), limit_(limit) {}

  const CameraDescription& description() const override { return frames_->description(); }
  absl::Status Start(const Target& target) override {
    yielded_ = 0;
    return frames_->Start(target);
  }
  absl::StatusOr<std::optional<Frame>> Next() override {
    last_.reset();
    if (limit_ > 0 && yielded_ == limit_) return std::nullopt;
    const auto begin = std::chrono::steady_clock::now();
    absl::StatusOr<std::optional<Frame>> frame = frames_->Next();
    read_time_ = std::chrono::steady_clock::now() - begin;
    if (frame.ok()) last_ = *frame;
    if (last_) ++yielded_;
    return frame;
  }
  void Stop() override { frames_->Stop(); }
  std::vector<ClockSample> TakeClockSamples() override { return frames_->TakeClockSamples(); }
  FrameCounts counts() const override { return frames_->counts(); }
  std::vector<Refusal> Refused() const override { return frames_->Refused(); }

  // Of the last Next.
  std::chrono::duration<double> read_time() const { return read_time_; }
  const std::optional<Frame>& last() const { return last_; }

 private:
  const std::unique_ptr<FrameSource> frames_;
  const uint64_t limit_;
  uint64_t yielded_ = 0;
  std::chrono::duration<double> read_time_{0};
  std::optional<Frame> last_;
};

}  // namespace rigcal::agent
