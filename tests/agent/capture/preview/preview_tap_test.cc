// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/preview/preview_tap.h"

#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <optional>
#include <thread>
#include <vector>

namespace rigcal::agent::preview_tap_test {
namespace {

// Two rows of three grey pixels, with a byte between the rows.
class PreviewTapTest : public ::testing::Test {
 protected:
  void Offer(int64_t time_ns) { tap_.Offer(image_, time_ns, 4, detection_, {1, 0, 2, 2}, blobs_); }

  std::array<uint8_t, 7> pixels_ = {1, 2, 3, 99, 4, 5, 6};
  ImageView image_{.data = pixels_.data(),
                   .width = 3,
                   .height = 2,
                   .stride_bytes = 4,
                   .format = PixelFormat::kMono8};
  Detection detection_;
  std::vector<Blob> blobs_{2};
  PreviewTap tap_;
};

TEST_F(PreviewTapTest, GivesTheNextFrameOnce) {
  detection_.outcome = DetectionOutcome::kAmbiguous;
  std::vector<PreviewFrame> taken;
  Offer(1);
  tap_.Request([&](PreviewFrame frame) { taken.push_back(std::move(frame)); });
  Offer(2);
  pixels_.fill(0);  // the source goes on with its memory
  Offer(3);
  ASSERT_EQ(taken.size(), 1u);
  const PreviewFrame& frame = taken[0];
  EXPECT_EQ(frame.time_ns, 2);
  EXPECT_EQ(frame.clock_epoch, 4u);
  EXPECT_EQ(frame.pixels, (std::vector<uint8_t>{1, 2, 3, 4, 5, 6}));
  EXPECT_EQ(frame.image.data, frame.pixels.data());
  EXPECT_EQ(frame.image.Row(1)[2], 6);
  EXPECT_EQ(frame.detection.outcome, DetectionOutcome::kAmbiguous);
  EXPECT_EQ(frame.window, (PixelRect{1, 0, 2, 2}));
  EXPECT_EQ(frame.blobs.size(), 2u);
}

TEST_F(PreviewTapTest, ACancelledRequestGetsNothing) {
  int taken = 0;
  tap_.Request([&](const PreviewFrame&) { ++taken; });
  tap_.Cancel();
  Offer(1);
  EXPECT_EQ(taken, 0);
}

TEST_F(PreviewTapTest, ASecondRequestReplacesTheFirst) {
  int first = 0;
  int second = 0;
  tap_.Request([&](const PreviewFrame&) { ++first; });
  tap_.Request([&](const PreviewFrame&) { ++second; });
  Offer(1);
  Offer(2);
  EXPECT_EQ(first, 0);
  EXPECT_EQ(second, 1);
}

TEST_F(PreviewTapTest, NothingIsTakenAfterCancelReturnsWhileTheCameraRuns) {
  std::atomic<bool> stop{false};
  std::thread camera([&] {
    while (!stop) Offer(1);
  });
  for (int i = 0; i < 500; ++i) {
    // Its address is used by `take` only until Cancel.
    std::optional<int> taken = 0;
    tap_.Request([&](const PreviewFrame&) { taken = *taken + 1; });
    tap_.Cancel();
    EXPECT_LE(*taken, 1);
    taken.reset();
  }
  stop = true;
  camera.join();
}

}  // namespace
}  // namespace rigcal::agent::preview_tap_test
