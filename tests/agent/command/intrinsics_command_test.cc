// SPDX-License-Identifier: Apache-2.0
// Folders of rendered pictures of a camera whose lens is known.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "agent/command/subcommands.h"
#include "common/import/intrinsics_file.h"
#include "common/lens/lens_difference.h"
#include "common/simulation/world/simulated_world.h"
#include "tests/agent/detect/board/rendered_board.h"
#include "tests/common/lens/known_lens.h"
#include "tests/testing/simulation_text.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::agent::intrinsics_command_test {
namespace {

using namespace rigcal::testing;  // the known lens
using ::testing::HasSubstr;
using ::testing::Not;
namespace fs = std::filesystem;

constexpr double kLensBlurPx = 0.7;
constexpr double kGrain = 1;

struct Outcome {
  absl::Status status;
  std::string out;
};

Outcome RunIntrinsics(const std::vector<std::string>& arguments) {
  CLI::App app;
  std::ostringstream out;
  Subcommands subcommands(out);
  subcommands.AddTo(app);
  std::vector<std::string> reversed(arguments.rbegin(), arguments.rend());
  reversed.push_back("intrinsics");
  app.parse(std::move(reversed));
  const absl::Status status = subcommands.Chosen()();
  return {status, out.str()};
}

void Render(const Board& board, const Intrinsics& lens, const std::vector<RigidTransform>& poses,
            const fs::path& folder) {
  fs::create_directories(folder);
  const BoardRenderer renderer(lens, kKnownImage);
  for (size_t i = 0; i < poses.size(); ++i) {
    const fs::path file = folder / ("shot" + std::to_string(i) + ".png");
    ASSERT_TRUE(cv::imwrite(file.string(), renderer.Render(board, poses[i], kLensBlurPx, kGrain)));
  }
}

// The whole way: pictures of a bare camera in, a file that agents read out.
void ExpectLensFound(const Intrinsics& lens, const std::vector<RigidTransform>& poses) {
  const TemporaryDirectory folder;
  const Board board = *ParseBoard("board:checker,9x6,0.025");
  Render(board, lens, poses, folder.path() / "left");
  const std::string file = folder.path() / "lens.yaml";
  const std::vector<std::string> command = {(folder.path() / "left").string(), "--board",
                                            FormatBoard(board), "--output", file};
  std::vector<std::string> as_json = command;
  as_json.insert(as_json.end(), {"-o", "json"});
  const Outcome outcome = RunIntrinsics(as_json);
  ASSERT_THAT(outcome.status, IsOk());
  const nlohmann::json json = nlohmann::json::parse(outcome.out);
  SCOPED_TRACE(outcome.out);
  EXPECT_EQ(json["pictures"], poses.size());
  EXPECT_GE(json["views"], 10);  // the rest is cut off by the border
  EXPECT_LT(json["held_out_rms_px"], 0.15);
  const auto read = ReadIntrinsicsFile(file);
  ASSERT_THAT(read, IsOk());
  EXPECT_EQ(read->image_size_px, kKnownImage);
  EXPECT_EQ(read->intrinsics.model, lens.model);
  const auto difference = CompareLenses(lens, read->intrinsics, kKnownImage);
  ASSERT_THAT(difference, IsOk());
  EXPECT_LE(difference->p95_px, 0.1);
  EXPECT_LT(difference->unknown_share, 0.01);

  EXPECT_THAT(RunIntrinsics(command).status,
              StatusIs(absl::StatusCode::kAlreadyExists, HasSubstr("--force")));
}

TEST(IntrinsicsCommand, FindsAPinholeFromAFolderOfPictures) {
  const Board board = *ParseBoard("board:checker,9x6,0.025");
  ExpectLensFound(KnownPinhole(),
                  WavedBoard(board, KnownPinhole(), kKnownImage, 25, 0.33, 0.45, 0.7, 5, 0.5));
}

TEST(IntrinsicsCommand, FindsAFisheyeFromAFolderOfPictures) {
  const Board board = *ParseBoard("board:checker,9x6,0.025");
  ExpectLensFound(KnownFisheye(),
                  WavedBoard(board, KnownFisheye(), kKnownImage, 25, 0.18, 0.25, 0.7, 6, 0.6));
}

// Every second picture shows the back.
TEST(IntrinsicsCommand, TakesPicturesOfBothSidesOfABoard) {
  const TemporaryDirectory folder;
  const Board board = *ParseBoard("board:charuco,9x7,0.025,0.018,5x5_100,two-sided=0.005");
  const Intrinsics lens = KnownPinhole();
  auto poses = WavedBoard(board, lens, kKnownImage, 24, 0.33, 0.45, 0.7, 5, 0.5);
  // Half a turn about the vertical middle line of the board.
  const RigidTransform half_turn(Eigen::Quaterniond(0, 0, 1, 0), Eigen::Vector3d(0.175, 0, 0.005));
  for (size_t i = 1; i < poses.size(); i += 2) poses[i] = poses[i] * half_turn;
  Render(board, lens, poses, folder.path() / "left");
  const std::string file = folder.path() / "lens.yaml";
  std::vector<std::string> command = {(folder.path() / "left").string(),
                                      "--board",
                                      FormatBoard(board),
                                      "--output",
                                      file,
                                      "-o",
                                      "json"};
  const Outcome outcome = RunIntrinsics(command);
  ASSERT_THAT(outcome.status, IsOk());
  EXPECT_EQ(nlohmann::json::parse(outcome.out)["views"], 24) << outcome.out;
  const auto read = ReadIntrinsicsFile(file);
  ASSERT_THAT(read, IsOk());
  const auto difference = CompareLenses(lens, read->intrinsics, kKnownImage);
  ASSERT_THAT(difference, IsOk());
  EXPECT_LE(difference->p95_px, 0.1);
  // mrcal has no place for a second side.
  command.insert(command.end(), {"--force", "--corners", (folder.path() / "c.vnl").string()});
  EXPECT_THAT(RunIntrinsics(command).status,
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("the front alone, board:charuco,9x7,0.025,0.018,5x5_100")));
}

TEST(IntrinsicsCommand, FindsTheLensOfASimulatedCamera) {
  const TemporaryDirectory folder;
  const std::string file = folder.path() / "lens.yaml";
  const Outcome outcome =
      RunIntrinsics({"sim:camera=1;pixels=1;near=1;rate=2;duration=20;speed=max", "--board",
                     "board:checker,9x6,0.04", "--output", file});
  ASSERT_THAT(outcome.status, IsOk());
  const auto world = SimulatedWorld::Create(*ParseSimulationOptions("rate=2;duration=20"),
                                            *ParseTarget("wand:0,0.13,0.39"));
  ASSERT_THAT(world, IsOk());
  const SimulatedCamera& camera = world->cameras()[1];
  const auto read = ReadIntrinsicsFile(file);
  ASSERT_THAT(read, IsOk());
  const auto difference =
      CompareLenses(camera.true_intrinsics, read->intrinsics, camera.description.image_size_px);
  ASSERT_THAT(difference, IsOk());
  EXPECT_LE(difference->p95_px, 0.3);
}

TEST(IntrinsicsCommand, NamesFilesThatAreNoPictureOfTheCamera) {
  const TemporaryDirectory folder;
  const Board board = *ParseBoard("board:checker,9x6,0.025");
  const fs::path left = folder.path() / "left";
  Render(board, KnownPinhole(),
         WavedBoard(board, KnownPinhole(), kKnownImage, 12, 0.33, 0.45, 0.7, 5, 0.5), left);
  ASSERT_TRUE(cv::imwrite(left / "small.png", cv::Mat(120, 160, CV_8UC1, cv::Scalar(90))));
  std::ofstream(left / "torn.png") << "not a picture";
  const Outcome outcome = RunIntrinsics({left.string(), "--board", "board:checker,9x6,0.025",
                                         "--output", (folder.path() / "lens.yaml").string()});
  ASSERT_THAT(outcome.status, IsOk());
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("small.png is 160x120 pixels"), HasSubstr("torn.png")));
}

// As of a video: a line after each view says where to hold the board next, until it is enough.
TEST(IntrinsicsCommand, GuidesUntilTheLensIsKnown) {
  const TemporaryDirectory folder;
  const Board board = *ParseBoard("board:checker,9x6,0.025");
  const Intrinsics lens = KnownPinhole();
  Render(board, lens, WavedBoard(board, lens, kKnownImage, 24, 0.3, 0.4, 0.7, 5, 0.35),
         folder.path() / "left");
  const std::string file = folder.path() / "lens.yaml", map = folder.path() / "map.png";
  std::vector<std::string> command = {
      "left=images:" + (folder.path() / "left").string() + ";fps=10",
      "--board",
      FormatBoard(board),
      "--output",
      file,
      "--map",
      map,
      "--until-px",
      "0.3"};
  const Outcome guided = RunIntrinsics(command);
  ASSERT_THAT(guided.status, IsOk());
  SCOPED_TRACE(guided.out);
  EXPECT_THAT(guided.out, ::testing::StartsWith("first: hold the board in the middle, near, with"));
  EXPECT_THAT(guided.out, HasSubstr("view 3 of 40\n  next: hold the board in the middle"));
  EXPECT_THAT(guided.out, HasSubstr("view 7 of 40: 95 % of the image are known within "));
  EXPECT_THAT(guided.out, HasSubstr("which is enough\n"));
  EXPECT_THAT(guided.out, HasSubstr(" px (95 % of the image) by noise alone\n"));
  const cv::Mat picture = cv::imread(map);
  EXPECT_EQ(picture.rows, 720);  // 4 by 3, with the scale beside it
  EXPECT_GT(picture.cols, 960);

  // No camera is this good: all views are taken, and that it was not reached is said.
  command.back() = "0.0001";
  command.insert(command.end(), {"--force", "-o", "json"});
  const Outcome all = RunIntrinsics(command);
  ASSERT_THAT(all.status, IsOk());
  const nlohmann::json json = nlohmann::json::parse(all.out);
  EXPECT_THAT(guided.out, Not(HasSubstr("pictures      " + json["pictures"].dump())));
  EXPECT_THAT(json["advice"].back().get<std::string>(),
              HasSubstr("not within the 0.0001 px of --until-px: hold the board "));
  EXPECT_EQ(json["uncertainty_map_px"]["columns"], 30);
  EXPECT_EQ(json["uncertainty_map_px"]["rows"], 24);
  ASSERT_EQ(json["uncertainty_map_px"]["values"].size(), 720u);
  double most = 0;
  for (const auto& value : json["uncertainty_map_px"]["values"]) {
    if (!value.is_null()) most = std::max(most, value.get<double>());
  }
  EXPECT_GE(most, json["uncertainty"]["p95_px"].get<double>());
  EXPECT_GT(json["uncertainty"]["median_px"].get<double>(), 0);
  const auto difference = CompareLenses(lens, ReadIntrinsicsFile(file)->intrinsics, kKnownImage);
  ASSERT_THAT(difference, IsOk());
  EXPECT_LT(difference->p95_px, 0.3);
}

TEST(IntrinsicsCommand, NamesTheBoardThatIsThere) {
  const TemporaryDirectory folder;
  const Board board = *ParseBoard("board:checker,8x5,0.025");
  Render(board, KnownPinhole(), WavedBoard(board, KnownPinhole(), kKnownImage, 2, 0.4, 0.5, 0.3, 5),
         folder.path() / "left");
  const Outcome outcome =
      RunIntrinsics({(folder.path() / "left").string(), "--board", "board:checker,9x6,0.025",
                     "--output", (folder.path() / "lens.yaml").string()});
  EXPECT_THAT(outcome.status,
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       AllOf(HasSubstr("no 9x6 board in 2 pictures"),
                             HasSubstr("8x5 in 2 of the 2"), HasSubstr("not squares"))));
  EXPECT_FALSE(fs::exists(folder.path() / "lens.yaml"));
}

// A few of the board that was said, and most of another one.
TEST(IntrinsicsCommand, NamesTheBoardThatMostPicturesShow) {
  const TemporaryDirectory folder;
  const Board printed = *ParseBoard("board:checker,8x5,0.025");
  const Board said = *ParseBoard("board:checker,9x6,0.025");
  const auto poses = WavedBoard(printed, KnownPinhole(), kKnownImage, 6, 0.4, 0.5, 0.3, 5);
  Render(printed, KnownPinhole(), poses, folder.path() / "left");
  const cv::Mat one =
      BoardRenderer(KnownPinhole(), kKnownImage)
          .Render(said,
                  BoardAt(said, KnownPinhole(), Eigen::Vector2d(320, 240), 0.45, {0.2, 0.2, 0.1}),
                  kLensBlurPx, kGrain);
  ASSERT_TRUE(cv::imwrite((folder.path() / "left" / "other.png").string(), one));
  EXPECT_THAT(RunIntrinsics({(folder.path() / "left").string(), "--board", FormatBoard(said),
                             "--output", (folder.path() / "lens.yaml").string()})
                  .status,
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("but one of 8x5")));
}

TEST(IntrinsicsCommand, CountsEqualPicturesOnce) {
  const TemporaryDirectory folder;
  const Board board = *ParseBoard("board:checker,9x6,0.025");
  auto poses = WavedBoard(board, KnownPinhole(), kKnownImage, 1, 0.4, 0.5, 0.3, 5);
  poses.resize(12, poses.front());
  Render(board, KnownPinhole(), poses, folder.path() / "left");
  EXPECT_THAT(RunIntrinsics({(folder.path() / "left").string(), "--board", FormatBoard(board),
                             "--output", (folder.path() / "lens.yaml").string()})
                  .status,
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       AllOf(HasSubstr("and 1 does"), HasSubstr("11 more show it exactly"))));
  EXPECT_FALSE(fs::exists(folder.path() / "lens.yaml"));
}

// The gap of an April grid that was said is not that of the print.
TEST(IntrinsicsCommand, WritesNoLensThatNobodyShouldUse) {
  const TemporaryDirectory folder;
  const Board printed = *ParseBoard("board:aprilgrid,5x4,0.03,0.3");
  auto poses = WavedBoard(printed, KnownPinhole(), kKnownImage, 12, 0.4, 0.6, 0.6, 3);
  // Its y points up.
  for (RigidTransform& pose : poses) {
    Eigen::Vector3d middle = Eigen::Vector3d::Zero();
    for (const Eigen::Vector3d& point : printed.Points()) middle += point / printed.point_count();
    const Eigen::Vector3d there = pose * middle;
    pose.rotation = pose.rotation * Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitX());
    pose.translation_m += there - pose * middle;
  }
  Render(printed, KnownPinhole(), poses, folder.path() / "left");
  const std::string file = folder.path() / "lens.yaml";
  std::vector<std::string> command = {(folder.path() / "left").string(), "--board",
                                      "board:aprilgrid,5x4,0.03,0.2", "--output", file};
  const Outcome refused = RunIntrinsics(command);
  EXPECT_THAT(refused.status,
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       AllOf(HasSubstr("lens.yaml was not written: corners are off by"),
                             HasSubstr("--keep-poor"))))
      << refused.out;
  EXPECT_FALSE(fs::exists(file));
  command.push_back("--keep-poor");
  EXPECT_THAT(RunIntrinsics(command).status, IsOk());
  EXPECT_TRUE(fs::exists(file));
}

TEST(IntrinsicsCommand, WritesNoFileTwice) {
  const TemporaryDirectory folder;
  const std::string file = folder.path() / "a.png";
  EXPECT_THAT(RunIntrinsics({folder.path().string(), "--board", "board:checker,9x6,0.025",
                             "--output", file, "--map", file})
                  .status,
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("another option")));
  EXPECT_THAT(RunIntrinsics({folder.path().string(), "--board", "board:checker,9x6,0.025",
                             "--output", file, "--map", "map.jpg"})
                  .status,
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("name it .png")));
}

TEST(IntrinsicsCommand, RefusesWhatIsTypedWrong) {
  const TemporaryDirectory folder;
  const std::string file = folder.path() / "lens.yaml";
  EXPECT_THAT(RunIntrinsics({"x", "--board", "board:checker,9x6,25", "--output", file}).status,
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("25 mm are 0.025")));
  EXPECT_THAT(
      RunIntrinsics({"x", "--board", "board:checker,9x6,0.025", "--output", file, "--views", "4"})
          .status,
      StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("--views 4 are too few")));
  EXPECT_THAT(RunIntrinsics({folder.path().string(), "--board", "board:checker,9x6,0.025",
                             "--output", file, "--until-px", "0.2"})
                  .status,
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("--until-px is of a camera or a video")));
  EXPECT_THAT(RunIntrinsics({(folder.path() / "none").string(), "--board",
                             "board:checker,9x6,0.025", "--output", file})
                  .status,
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("no file or folder")));
}

}  // namespace
}  // namespace rigcal::agent::intrinsics_command_test
