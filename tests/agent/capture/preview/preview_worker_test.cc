// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/preview/preview_worker.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <limits>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "common/wire/preview_wire.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::agent::preview_worker_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr uint32_t kLongMs = 60'000;

PreviewOptions SwitchedOn() {
  PreviewOptions options;
  options.enabled = true;
  options.max_rate_hz = 0.001;
  return options;
}

class PreviewWorkerTest : public ::testing::Test {
 protected:
  void Make(const PreviewOptions& options) {
    worker_ = std::make_unique<PreviewWorker>(options, [this] {
      const std::lock_guard lock(mutex_);
      ++answer_count_;
      answered_.notify_all();
    });
  }

  void Ask(uint32_t id, const std::string& camera = "left", uint32_t max_wait_ms = kLongMs) {
    worker_->Request(
        {.request_id = id, .camera = camera, .max_jpeg_bytes = 50'000, .max_wait_ms = max_wait_ms},
        {.known = true, .capturing = true, .tap = &tap_});
  }

  void TakeImage(PreviewTap* tap, const Detection& detection = {}) {
    tap->Offer({.data = pixels_.data(),
                .width = 320,
                .height = 200,
                .stride_bytes = 960,
                .format = PixelFormat::kBgr8},
               1'234, 2, detection);
  }

  Preview WaitForAnswer() {
    std::unique_lock lock(mutex_);
    EXPECT_TRUE(
        answered_.wait_for(lock, std::chrono::seconds(60), [this] { return answer_count_ > 0; }));
    --answer_count_;
    lock.unlock();
    return worker_->TakeAnswer().value_or(Preview{});
  }

  std::vector<uint8_t> pixels_ = std::vector<uint8_t>(320 * 200 * 3, 90);
  PreviewTap tap_;
  std::mutex mutex_;
  std::condition_variable answered_;
  int answer_count_ = 0;
  std::unique_ptr<PreviewWorker> worker_;
};

TEST_F(PreviewWorkerTest, DrawsTheNextFrame) {
  Make(SwitchedOn());
  Ask(7);
  Detection detection;
  detection.outcome = DetectionOutcome::kWand;
  detection.confidence = 0.75;
  detection.blob_count = 5;
  detection.tracked = true;
  detection.observation.markers.resize(3);
  detection.observation.markers[1].visible = true;
  TakeImage(&tap_, detection);
  const Preview preview = WaitForAnswer();
  EXPECT_EQ(preview.request_id, 7u);
  ASSERT_EQ(preview.status, PreviewStatus::kOk) << preview.message;
  EXPECT_EQ(preview.info, (PreviewInfo{.camera = "left",
                                       .time_ns = 1'234,
                                       .clock_epoch = 2,
                                       .image_size_px = {320, 200},
                                       .jpeg_size_px = {320, 200},
                                       .outcome = DetectionOutcome::kWand,
                                       .confidence = 0.75,
                                       .visible_marker_count = 1,
                                       .blob_count = 5,
                                       .tracked = true}));
  EXPECT_EQ(preview.jpeg.substr(0, 3), "\xff\xd8\xff");
  EXPECT_LE(preview.jpeg.size(), 50'000u);
  EXPECT_FALSE(worker_->TakeAnswer());
}

TEST_F(PreviewWorkerTest, IsOffUnlessSwitchedOn) {
  Make({});
  Ask(1);
  const Preview preview = WaitForAnswer();
  EXPECT_EQ(preview.status, PreviewStatus::kDisabled);
  EXPECT_THAT(preview.message, HasSubstr("[preview]"));
  EXPECT_TRUE(preview.jpeg.empty());
}

TEST_F(PreviewWorkerTest, SaysWhyThereIsNoFrame) {
  Make(SwitchedOn());
  const PreviewRequest request{.request_id = 3, .camera = "left", .max_wait_ms = kLongMs};
  worker_->Request(request, {});
  EXPECT_EQ(WaitForAnswer().status, PreviewStatus::kUnknownCamera);
  worker_->Request(request, {.known = true, .capturing = true, .tap = nullptr});
  EXPECT_EQ(WaitForAnswer().status, PreviewStatus::kNoFrames);
  worker_->Request(request, {.known = true, .capturing = false, .tap = &tap_});
  const Preview idle = WaitForAnswer();
  EXPECT_EQ(idle.status, PreviewStatus::kNotCapturing);
  EXPECT_THAT(idle.message, HasSubstr("session start"));
}

TEST_F(PreviewWorkerTest, KeepsToItsRateForEachCamera) {
  Make(SwitchedOn());
  Ask(1);
  Ask(2);
  EXPECT_THAT(WaitForAnswer().message, HasSubstr("under way"));
  TakeImage(&tap_);
  EXPECT_EQ(WaitForAnswer().request_id, 1u);
  Ask(3);
  const Preview too_soon = WaitForAnswer();
  EXPECT_EQ(too_soon.request_id, 3u);
  EXPECT_EQ(too_soon.status, PreviewStatus::kTooOften);
  EXPECT_THAT(too_soon.message, AllOf(HasSubstr("0.001 previews/s"), HasSubstr("ask again in")));
  PreviewTap other;
  worker_->Request({.request_id = 4, .camera = "right", .max_wait_ms = kLongMs},
                   {.known = true, .capturing = true, .tap = &other});
  TakeImage(&other);
  EXPECT_EQ(WaitForAnswer().status, PreviewStatus::kOk);
}

TEST_F(PreviewWorkerTest, ACameraWithoutFramesTimesOut) {
  Make(SwitchedOn());
  Ask(1, "left", 10);
  const Preview preview = WaitForAnswer();
  EXPECT_EQ(preview.status, PreviewStatus::kTimedOut);
  EXPECT_THAT(preview.message, AllOf(HasSubstr("left"), HasSubstr("10 ms")));
  TakeImage(&tap_);
  worker_->Shutdown();
  EXPECT_FALSE(worker_->TakeAnswer()) << "a frame that came after the time";
}

TEST_F(PreviewWorkerTest, ForgetsWhoHasGone) {
  Make(SwitchedOn());
  Ask(1);
  worker_->Forget();
  TakeImage(&tap_);
  Ask(2, "right");
  TakeImage(&tap_);
  EXPECT_EQ(WaitForAnswer().request_id, 2u);
}

TEST_F(PreviewWorkerTest, AFrameThatCannotBeMadeSmallFailsAndSaysSo) {
  Make(SwitchedOn());
  worker_->Request(
      {.request_id = 1, .camera = "left", .max_jpeg_bytes = 50, .max_wait_ms = kLongMs},
      {.known = true, .capturing = true, .tap = &tap_});
  TakeImage(&tap_);
  const Preview preview = WaitForAnswer();
  EXPECT_EQ(preview.status, PreviewStatus::kFailed);
  EXPECT_THAT(preview.message, HasSubstr("50 bytes"));
}

TEST_F(PreviewWorkerTest, ADetectionThatIsNoNumberCanBeSent) {
  Make(SwitchedOn());
  Ask(1);
  Detection detection;
  detection.confidence = std::numeric_limits<double>::quiet_NaN();
  detection.blob_count = -1;
  TakeImage(&tap_, detection);
  EXPECT_THAT(wire::FromProto(wire::ToProto(WaitForAnswer())), IsOk());
}

TEST_F(PreviewWorkerTest, EndsWhileSomebodyWaits) {
  Make(SwitchedOn());
  Ask(1);
  worker_->Shutdown();
  TakeImage(&tap_);
  Ask(2);
  EXPECT_FALSE(worker_->TakeAnswer());
}

}  // namespace
}  // namespace rigcal::agent::preview_worker_test
