// SPDX-License-Identifier: Apache-2.0
// Boards of circles in simulated events of a screen and of a print that is moved.
#include "agent/detect/event_board/event_board_detector.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "agent/event/evt3_writer.h"
#include "tests/common/lens/known_lens.h"
#include "tests/testing/event_board_scene.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::agent::event_board_detector_test {
namespace {

using namespace rigcal::testing;

constexpr ImageSize kImage{640, 480};

EventRenderOptions QuietPixels() {
  EventRenderOptions pixels;
  pixels.background_hz = 0.5;
  pixels.hot_pixels = 5;
  return pixels;
}

std::vector<uint8_t> Encoded(const std::vector<SimulatedEvent>& events, Evt3Writer* writer) {
  std::vector<CdEvent> plain;
  for (const SimulatedEvent& event : events) {
    plain.push_back({event.time_us, event.x, event.y, event.on});
  }
  std::vector<uint8_t> bytes;
  writer->Write(plain, &bytes);
  return bytes;
}

struct Seen {
  std::vector<EventBoardPicture> pictures;
  EventBoardCounts counts;
};

Seen Watch(const Board& board, EventBoardScene* scene, double seconds) {
  EventBoardDetector detector(board, {kImage.width, kImage.height}, EventFormat::kEvt3, false);
  Evt3Writer writer;
  Seen seen;
  for (int64_t end_us = 10'000; end_us <= std::lround(1e6 * seconds); end_us += 10'000) {
    std::vector<SimulatedEvent> events;
    scene->Render(end_us, &events);
    EXPECT_THAT(detector.Take(Encoded(events, &writer), &seen.pictures), IsOk());
  }
  EXPECT_THAT(detector.Finish(&seen.pictures), IsOk());
  seen.counts = detector.counts();
  return seen;
}

// Root of the mean square distance from the truth, after the mean distance is taken out: the lag
// of the whole board does not matter.
double ScatterPx(const EventBoardPicture& picture, const EventBoardScene& scene) {
  const auto truth = scene.TruthAt(1e-6 * picture.time_us);
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (size_t i = 0; i < truth.size(); ++i) {
    mean += (picture.seen->pixels[i] - truth[i]) / static_cast<double>(truth.size());
  }
  double squares = 0;
  for (size_t i = 0; i < truth.size(); ++i) {
    squares += (picture.seen->pixels[i] - truth[i] - mean).squaredNorm();
  }
  return std::sqrt(squares / static_cast<double>(truth.size()));
}

RigidTransform Facing(const Board& board, double tilt_rad) {
  return BoardAt(board, KnownPinhole(), {320, 240}, 0.5, {tilt_rad, 0.3, 0.2});
}

TEST(EventBoardDetector, FindsTheDiscsOfAScreenThatBlinks) {
  const Board board = *ParseBoard("board:circles,4x11,0.02");
  EventBoardScene scene(board, KnownPinhole(), kImage, {}, QuietPixels(),
                        HandHeld({Facing(board, 0.4), Facing(board, 0.4)}, 10, 0.9));
  const Seen seen = Watch(board, &scene, 2);
  EXPECT_NEAR(seen.counts.blink_hz, 5, 0.2);
  int found = 0;
  for (const EventBoardPicture& picture : seen.pictures) {
    if (!picture.seen) continue;
    ++found;
    EXPECT_LT(ScatterPx(picture, scene), 0.15);
  }
  EXPECT_GE(found, 17);
}

TEST(EventBoardDetector, FindsAPrintThatIsMoved) {
  const Board board = *ParseBoard("board:circles,4x11,0.02");
  EventBoardLight light;
  light.refresh_hz = 0;
  light.black = 0.04;
  EventBoardScene scene(board, KnownPinhole(), kImage, light, QuietPixels(),
                        Waved({BoardAt(board, KnownPinhole(), {230, 240}, 0.5, {0.4, 0.3, 0.2}),
                               BoardAt(board, KnownPinhole(), {410, 260}, 0.5, {0.4, 0.3, 0.2}),
                               BoardAt(board, KnownPinhole(), {250, 250}, 0.5, {0.3, 0.3, 0.2})},
                              1.5));
  const Seen seen = Watch(board, &scene, 2);
  int found = 0;
  double squares = 0;
  for (const EventBoardPicture& picture : seen.pictures) {
    if (!picture.seen) continue;
    ++found;
    squares += std::pow(ScatterPx(picture, scene), 2);
  }
  EXPECT_LT(std::sqrt(squares / found), 0.3);
  EXPECT_GE(found, 30);
}

}  // namespace
}  // namespace rigcal::agent::event_board_detector_test
