// SPDX-License-Identifier: Apache-2.0
// Files of simulated events of a camera whose lens is known.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "agent/command/subcommands.h"
#include "agent/event/evt3_writer.h"
#include "common/import/intrinsics_file.h"
#include "common/lens/lens_difference.h"
#include "tests/common/lens/known_lens.h"
#include "tests/testing/event_board_scene.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::agent::event_intrinsics_test {
namespace {

using namespace rigcal::testing;  // the known lens
using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr const char* kText = "board:circles,4x11,0.02";

class EventIntrinsics : public ::testing::Test {
 protected:
  absl::Status Run(std::vector<std::string> arguments, std::string* printed = nullptr) {
    CLI::App app;
    std::ostringstream out;
    Subcommands subcommands(out);
    subcommands.AddTo(app);
    std::vector<std::string> words = {"intrinsics", file_, "--output", lens_};
    words.insert(words.end(), arguments.begin(), arguments.end());
    app.parse(std::vector<std::string>(words.rbegin(), words.rend()));
    const absl::Status status = subcommands.Chosen()();
    if (printed != nullptr) *printed = out.str();
    return status;
  }

  void Record(const std::string& board, const EventBoardLight& light, BoardPath path,
              double seconds) {
    EventRenderOptions pixels;
    pixels.background_hz = 1;
    EventBoardScene scene(*ParseBoard(board), KnownPinhole(), kKnownImage, light, pixels,
                          std::move(path));
    std::vector<SimulatedEvent> events;
    scene.Render(std::lround(1e6 * seconds), &events);
    std::vector<CdEvent> plain;
    for (const SimulatedEvent& event : events) {
      plain.push_back({event.time_us, event.x, event.y, event.on});
    }
    std::vector<uint8_t> bytes;
    Evt3Writer().Write(plain, &bytes);
    std::ofstream file(file_, std::ios::binary);
    file << Evt3Header({kKnownImage.width, kKnownImage.height}, "1");
    file.write(reinterpret_cast<const char*>(bytes.data()),
               static_cast<std::streamsize>(bytes.size()));
  }

  BoardPath Still(const std::string& board, double distance_m) {
    const RigidTransform pose =
        BoardAt(*ParseBoard(board), KnownPinhole(), {320, 240}, distance_m, {0.2, 0.1, 0.1});
    return [pose](double) { return pose; };
  }

  const TemporaryDirectory folder_;
  const std::string file_ = (folder_.path() / "event.raw").string();
  const std::string lens_ = (folder_.path() / "lens.yaml").string();
};

// The whole way: a RAW file of a screen that blinks in, a lens that agents read out.
TEST_F(EventIntrinsics, FindsTheLensFromAScreenThatBlinks) {
  const Board board = *ParseBoard(kText);
  EventBoardLight light;
  light.blink_refreshes = 3;
  Record(kText, light,
         HandHeld(WavedBoard(board, KnownPinhole(), kKnownImage, 14, 0.4, 0.55, 0.8, 3, 0.4), 0.6,
                  0.8),
         7);
  std::string printed;
  ASSERT_THAT(Run({"--board", kText, "-o", "json"}, &printed), IsOk());
  SCOPED_TRACE(printed);
  const nlohmann::json json = nlohmann::json::parse(printed);
  EXPECT_GE(json["views"], 8);
  EXPECT_NEAR(json["events"]["blink_hz"], 10, 0.2);
  EXPECT_LT(json["rms_px"], 0.25);
  const auto read = ReadIntrinsicsFile(lens_);
  ASSERT_THAT(read, IsOk());
  const auto difference = CompareLenses(KnownPinhole(), read->intrinsics, kKnownImage);
  ASSERT_THAT(difference, IsOk());
  EXPECT_LT(difference->median_px, 0.3);
}

TEST_F(EventIntrinsics, NamesALampThatIsNoBoard) {
  EventBoardLight light;
  light.lamp_hz = 100;
  Record(
      kText, light, [](double) { return RigidTransform(); }, 1.5);
  EXPECT_THAT(Run({"--board", kText}), StatusIs(absl::StatusCode::kFailedPrecondition,
                                                AllOf(HasSubstr("flickers at 100"),
                                                      HasSubstr("lamp"), HasSubstr("/pattern"))));
}

TEST_F(EventIntrinsics, SaysThatNothingBlinks) {
  Record(
      kText, {}, [](double) { return RigidTransform(); }, 1);
  EXPECT_THAT(Run({"--board", kText}),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("nothing blinks")));
}

TEST_F(EventIntrinsics, NamesTheBoardThatIsThere) {
  Record("board:circles,4x10,0.02", {}, Still("board:circles,4x10,0.02", 0.5), 1);
  EXPECT_THAT(Run({"--board", kText}),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("but one of 4x10")));
}

TEST_F(EventIntrinsics, SaysThatTheScreenIsTooSmall) {
  Record(kText, {}, Still(kText, 3), 1);
  EXPECT_THAT(Run({"--board", kText}),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("Go nearer")));
}

TEST_F(EventIntrinsics, RefusesTooFewViewsAndAChessboard) {
  Record(kText, {}, Still(kText, 0.5), 1);
  EXPECT_THAT(Run({"--board", kText}),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("at least 6 pictures")));
  EXPECT_THAT(Run({"--board", "board:checker,9x6,0.02"}),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("board of circles"), HasSubstr("/pattern"))));
}

}  // namespace
}  // namespace rigcal::agent::event_intrinsics_test
