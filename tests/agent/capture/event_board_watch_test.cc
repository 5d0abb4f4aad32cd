// SPDX-License-Identifier: Apache-2.0
// A board on a screen that blinks, in the events of a camera, as the target of a session.
#include "agent/capture/event_board_watch.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

#include "agent/capture/event_observation_source.h"
#include "agent/event/evt3_writer.h"
#include "common/camera/camera_model.h"
#include "tests/common/lens/known_lens.h"
#include "tests/testing/event_board_scene.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::agent::event_board_watch_test {
namespace {

using namespace rigcal::testing;
using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr ImageSize kImage{640, 480};
constexpr int64_t kOriginUs = 5'000'000'000;  // more than 32 bits hold

// The events of one board, in pieces of 10 ms.
class BoardEvents : public EventSource {
 public:
  BoardEvents(const Board& board, BoardPath path)
      : scene_(board, KnownPinhole(), kImage, {}, EventRenderOptions(), std::move(path)) {
    description_.camera = "event";
    description_.sensor = SensorKind::kEvent;
    description_.image_size_px = kImage;
    description_.intrinsics = KnownPinhole();
    description_.clock.clock_id = "event";
  }
  const CameraDescription& description() const override { return description_; }
  absl::Status Start(const Target&) override { return absl::OkStatus(); }
  absl::StatusOr<std::optional<EventChunk>> Next() override {
    if (now_us_ == 1'000'000) return std::nullopt;
    now_us_ += 10'000;
    std::vector<SimulatedEvent> events;
    scene_.Render(now_us_, &events);
    plain_.clear();
    for (const SimulatedEvent& event : events) {
      plain_.push_back({.time_us = kOriginUs + event.time_us,
                        .x = event.x,
                        .y = event.y,
                        .kind = event.on ? PlainEvent::kOn : PlainEvent::kOff});
    }
    return EventChunk{.format = EventFormat::kPlain,
                      .bytes = {reinterpret_cast<const uint8_t*>(plain_.data()),
                                plain_.size() * sizeof(PlainEvent)}};
  }
  void Stop() override {}

 private:
  EventBoardScene scene_;
  CameraDescription description_;
  int64_t now_us_ = 0;
  std::vector<PlainEvent> plain_;
};

TEST(EventBoardWatch, ObservesTheCentresOfTheCirclesAtTheTimesOfTheBursts) {
  const Board board = *ParseBoard("board:circles,4x11,0.02");
  const BoardPath path = Waved({BoardAt(board, KnownPinhole(), {310, 240}, 0.5, {0.4, 0.3, 0.2}),
                                BoardAt(board, KnownPinhole(), {350, 250}, 0.5, {0.4, 0.3, 0.2})},
                               1);
  EventObservationSource source(std::make_unique<BoardEvents>(board, path), {});
  ASSERT_THAT(source.Start(*ParseTarget("board:circles,4x11,0.02")), IsOk());
  int found = 0;
  int64_t last_ns = 0;
  while (true) {
    const auto next = source.Next();
    ASSERT_THAT(next, IsOk());
    if (!*next) break;
    const Observation& seen = **next;
    EXPECT_GT(seen.time_ns, last_ns);
    last_ns = seen.time_ns;
    ASSERT_EQ(seen.markers.size(), 44u);
    if (seen.VisibleCount() == 0) continue;
    ++found;
    const RigidTransform pose = path(1e-9 * static_cast<double>(seen.time_ns - 1000 * kOriginUs));
    double squares = 0;
    for (size_t i = 0; i < 44; ++i) {
      Eigen::Vector2d pixel;
      ASSERT_TRUE(Project(KnownPinhole(), pose * board.Points()[i], &pixel));
      squares += (seen.markers[i].centre_px - pixel).squaredNorm();
      EXPECT_LT(seen.markers[i].covariance_px2(0, 0), 0.04);
    }
    // Of 1 px in 25 ms.
    EXPECT_LT(std::sqrt(squares / 44), 0.4) << "at " << seen.time_ns;
  }
  EXPECT_GE(found, 8);  // 10 changes a second
  EXPECT_EQ(source.detection_counts()->Of(DetectionOutcome::kWand), static_cast<uint64_t>(found));
}

TEST(EventBoardWatch, RefusesAChessboardWithWhatToTake) {
  const Board board = *ParseBoard("board:circles,4x11,0.02");
  EventObservationSource source(
      std::make_unique<BoardEvents>(board, [](double) { return RigidTransform(); }), {});
  EXPECT_THAT(source.Start(*ParseTarget("board:checker,9x6,0.03")),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("camera event"), HasSubstr("board:checker,9x6,0.03"),
                             HasSubstr("/pattern"))));
}

}  // namespace
}  // namespace rigcal::agent::event_board_watch_test
