// SPDX-License-Identifier: Apache-2.0
#include "agent/command/frame_input.h"

#include <filesystem>
#include <string>

#include "agent/capture/pacer.h"
#include "tests/agent/capture/recorded/image_files.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::agent::frame_input_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::rigcal::testing::TemporaryDirectory;
using ::testing::AllOf;
using ::testing::HasSubstr;

class ResolvePictureInputTest : public ::testing::Test {
 protected:
  std::string Path(const std::string& name) const { return (directory_.path() / name).string(); }
  TemporaryDirectory directory_;
};

TEST_F(ResolvePictureInputTest, TellsFoldersPicturesAndVideosApart) {
  std::filesystem::create_directory(Path("my left"));
  FrameInput input{.input = Path("my left/")};
  ASSERT_OK_AND_ASSIGN(const FrameSourceSpec folder, ResolvePictureInput(input));
  const auto& images = std::get<ImagesSourceOptions>(folder.frames);
  EXPECT_EQ(images.camera, "my_left");
  EXPECT_EQ(images.calibration_path, "");
  EXPECT_EQ(images.speed, kMaxSpeed);

  input.input = directory_.WriteFile("one.PNG", "x").string();
  directory_.WriteFile("one.yaml", kSmallCameraYaml);
  ASSERT_OK_AND_ASSIGN(const FrameSourceSpec one, ResolvePictureInput(input));
  EXPECT_EQ(std::get<ImagesSourceOptions>(one.frames).calibration_path, Path("one.yaml"));

  input.input = directory_.WriteFile("film.mkv", "x").string();
  input.fps = "50";
  input.settings = {"hue_max=44", "speed=2"};
  ASSERT_OK_AND_ASSIGN(const FrameSourceSpec film, ResolvePictureInput(input));
  EXPECT_EQ(std::get<VideoSourceOptions>(film.frames).fps, 50);
  EXPECT_EQ(std::get<VideoSourceOptions>(film.frames).speed, 2);
  EXPECT_EQ(film.detecting.detector.colour.hue_max_deg, 44);
}

TEST_F(ResolvePictureInputTest, TakesASpecAndACameraOfAConfiguration) {
  ASSERT_OK_AND_ASSIGN(const FrameSourceSpec sim,
                       ResolvePictureInput({.input = "sim:camera=1;pixels=1"}));
  EXPECT_EQ(std::get<SimulatedFrameSourceOptions>(sim.frames).camera_index, 1);
  FrameInput input;
  input.config = directory_
                     .WriteFile("agent.toml",
                                "[[camera]]\nsource = \"sim:camera=0;pixels=1\"\n"
                                "[[camera]]\nname = \"b\"\nsource = \"sim:camera=2;pixels=1\"\n"
                                "[camera.detector]\nvalue_min = 99\n")
                     .string();
  input.camera = "b";
  input.settings = {"hue_max=33"};
  ASSERT_OK_AND_ASSIGN(const FrameSourceSpec b, ResolvePictureInput(input));
  EXPECT_EQ(std::get<SimulatedFrameSourceOptions>(b.frames).camera_index, 2);
  EXPECT_EQ(b.detecting.detector.colour.value_min, 99);
  EXPECT_EQ(b.detecting.detector.colour.hue_max_deg, 33);
  input.camera = "c";
  EXPECT_THAT(ResolvePictureInput(input),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("\"c\""), HasSubstr("sim_0 or b"))));
}

TEST_F(ResolvePictureInputTest, SaysWhatIsWrong) {
  EXPECT_THAT(ResolvePictureInput({}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("which pictures")));
  EXPECT_THAT(ResolvePictureInput({.input = "/nowhere"}),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("/nowhere")));
  EXPECT_THAT(ResolvePictureInput({.input = "sim:camera=0"}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("pixels=1")));
  EXPECT_THAT(ResolvePictureInput({.input = "csv:a.csv"}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("no pictures")));
  EXPECT_THAT(ResolvePictureInput({.input = "sim:camera=0;pixels=1", .settings = {"colour=red"}}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("colour")));
  EXPECT_THAT(ResolvePictureInput({.input = "sim:camera=0;pixels=1", .settings = {"colour"}}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("KEY=VALUE")));
}

}  // namespace
}  // namespace rigcal::agent::frame_input_test
