// SPDX-License-Identifier: Apache-2.0
#include "agent/command/frame_input.h"

#include <filesystem>
#include <string>

#include "agent/capture/pacer.h"
#include "agent/capture/recorded/recorded_frame_source.h"
#include "agent/capture/recorded/video_frame_source.h"
#include "agent/capture/simulated/simulated_frame_source.h"
#include "tests/agent/capture/recorded/image_files.h"
#include "tests/agent/capture/source_options_of.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::agent::frame_input_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::rigcal::testing::TemporaryDirectory;
using ::testing::AllOf;
using ::testing::HasSubstr;

class ResolveFrameInputTest : public ::testing::Test {
 protected:
  std::string Path(const std::string& name) const { return (directory_.path() / name).string(); }
  TemporaryDirectory directory_;
};

TEST_F(ResolveFrameInputTest, TellsFoldersFramesAndVideosApart) {
  std::filesystem::create_directory(Path("my left"));
  FrameInput input{.input = Path("my left/")};
  ASSERT_OK_AND_ASSIGN(const auto folder, ResolveFrameInput(input));
  const auto& images = OptionsOf<RecordedFramesOptions>(*folder);
  EXPECT_EQ(images.camera, "my_left");
  EXPECT_EQ(images.calibration_path, "");
  EXPECT_EQ(images.speed, kMaxSpeed);

  input.input = directory_.WriteFile("one.PNG", "x").string();
  directory_.WriteFile("one.yaml", kSmallCameraYaml);
  ASSERT_OK_AND_ASSIGN(const auto one, ResolveFrameInput(input));
  EXPECT_EQ(OptionsOf<RecordedFramesOptions>(*one).calibration_path, Path("one.yaml"));

  input.input = directory_.WriteFile("film.mkv", "x").string();
  input.fps = "50";
  input.settings = {"hue_max=44", "speed=2"};
  ASSERT_OK_AND_ASSIGN(const auto film, ResolveFrameInput(input));
  EXPECT_EQ(OptionsOf<RecordedFramesOptions>(*film).fps, 50);
  EXPECT_EQ(OptionsOf<RecordedFramesOptions>(*film).speed, 2);
  EXPECT_NE(
      (dynamic_cast<SpecOf<FrameSourceSpec, VideoFrameSource, RecordedFramesOptions>*>(film.get())),
      nullptr);
  EXPECT_EQ(film->detecting.detector.colour.hue_max_deg, 44);
}

TEST_F(ResolveFrameInputTest, TakesASpecAndACameraOfAConfiguration) {
  ASSERT_OK_AND_ASSIGN(const auto sim, ResolveFrameInput({.input = "sim:camera=1;pixels=1"}));
  EXPECT_EQ(OptionsOf<SimulatedFrameSourceOptions>(*sim).camera_index, 1);
  FrameInput input;
  input.config = directory_
                     .WriteFile("agent.toml",
                                "[[camera]]\nsource = \"sim:camera=0;pixels=1\"\n"
                                "[[camera]]\nname = \"b\"\nsource = \"sim:camera=2;pixels=1\"\n"
                                "[camera.detector]\nvalue_min = 99\n")
                     .string();
  input.camera = "b";
  input.settings = {"hue_max=33"};
  ASSERT_OK_AND_ASSIGN(const auto b, ResolveFrameInput(input));
  EXPECT_EQ(OptionsOf<SimulatedFrameSourceOptions>(*b).camera_index, 2);
  EXPECT_EQ(b->detecting.detector.colour.value_min, 99);
  EXPECT_EQ(b->detecting.detector.colour.hue_max_deg, 33);
  input.camera = "c";
  EXPECT_THAT(ResolveFrameInput(input),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("\"c\""), HasSubstr("sim_0 or b"))));
}

TEST_F(ResolveFrameInputTest, SaysWhatIsWrong) {
  EXPECT_THAT(ResolveFrameInput({}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("name the frames")));
  EXPECT_THAT(ResolveFrameInput({.input = "/nowhere"}),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("/nowhere")));
  EXPECT_THAT(ResolveFrameInput({.input = "sim:camera=0"}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("pixels=1")));
  EXPECT_THAT(ResolveFrameInput({.input = "csv:a.csv"}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("no frames")));
  EXPECT_THAT(ResolveFrameInput({.input = "sim:camera=0;pixels=1", .settings = {"colour=red"}}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("colour")));
  EXPECT_THAT(ResolveFrameInput({.input = "sim:camera=0;pixels=1", .settings = {"colour"}}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("KEY=VALUE")));
}

}  // namespace
}  // namespace rigcal::agent::frame_input_test
