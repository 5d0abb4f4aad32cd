// SPDX-License-Identifier: Apache-2.0
#include "client/local/recorded_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/testing/recorded_data.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::client::recorded_folder_test {
namespace {

using ::rigcal::testing::StatusIs;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr char kYaml[] =
    "%YAML:1.0\n---\n"
    "image_width: 640\nimage_height: 480\n"
    "camera_matrix: !!opencv-matrix\n  rows: 3\n  cols: 3\n  dt: d\n"
    "  data: [500, 0, 320, 0, 500, 240, 0, 0, 1]\n"
    "distortion_coefficients: !!opencv-matrix\n  rows: 1\n  cols: 5\n  dt: d\n"
    "  data: [0, 0, 0, 0, 0]\n";

class RecordedFolderTest : public ::testing::Test {
 protected:
  void Add(const std::string& stem) {
    directory_.WriteFile(stem + ".csv", "1;2;3;4;5;6;7\n");
    directory_.WriteFile(stem + ".yaml", kYaml);
  }
  auto Read() const { return ReadRecordedFolder(directory_.path()); }

  const rigcal::testing::TemporaryDirectory directory_;
};

TEST_F(RecordedFolderTest, FindsTheCamerasByName) {
  Add("right");
  Add("left");
  directory_.WriteFile("notes.txt", "");
  ASSERT_OK_AND_ASSIGN(const RecordedFolder folder, Read());
  ASSERT_EQ(folder.cameras.size(), 2u);
  EXPECT_EQ(folder.cameras[0].camera, "left");
  EXPECT_EQ(folder.cameras[0].recording, directory_.path() / "left.csv");
  EXPECT_EQ(folder.cameras[1].camera, "right");
  EXPECT_TRUE(folder.warnings.empty());
}

TEST_F(RecordedFolderTest, NamesLensFilesThatAreCopies) {
  for (const char* stem : {"left", "right", "top"}) Add(stem);
  std::string lens = kYaml;
  lens.replace(lens.find("[0, 0, 0, 0, 0]"), 15, "[-0.1, 0, 0, 0, 0]");
  directory_.WriteFile("left.yaml", lens);
  directory_.WriteFile("top.yaml", lens);
  ASSERT_OK_AND_ASSIGN(const RecordedFolder folder, Read());
  EXPECT_THAT(folder.warnings,
              ElementsAre(HasSubstr("cameras left and top have the same intrinsics")));
}

TEST_F(RecordedFolderTest, GivesAbsolutePaths) {
  Add("left");
  Add("right");
  const auto before = std::filesystem::current_path();
  std::filesystem::current_path(directory_.path());
  const auto folder = ReadRecordedFolder(".");
  std::filesystem::current_path(before);
  ASSERT_THAT(folder, rigcal::testing::IsOk());
  EXPECT_TRUE(folder->cameras[0].recording.is_absolute());
}

TEST_F(RecordedFolderTest, FindsEventsBesideMarkers) {
  Add("front");
  for (const char* name : {"left.raw", "right.h5", "top.hdf5"}) {
    directory_.WriteFile(name, "");
    directory_.WriteFile(std::filesystem::path(name).stem().string() + ".yaml", kYaml);
  }
  ASSERT_OK_AND_ASSIGN(const RecordedFolder folder, Read());
  ASSERT_EQ(folder.cameras.size(), 4u);
  EXPECT_EQ(folder.cameras[0].kind, RecordingKind::kMarkers);
  for (size_t i = 1; i < 4; ++i) EXPECT_EQ(folder.cameras[i].kind, RecordingKind::kEvents) << i;
  EXPECT_EQ(folder.cameras[2].camera, "right");
  EXPECT_EQ(folder.cameras[2].recording, directory_.path() / "right.h5");
}

TEST_F(RecordedFolderTest, FindsImagesAndVideosWithALensFile) {
  directory_.WriteFile("left/1000000000.png", "");
  directory_.WriteFile("left.yaml", kYaml);
  directory_.WriteFile("right.MP4", "");
  directory_.WriteFile("right.yaml", kYaml);
  // Markers were found in these already; plots are no camera.
  Add("top");
  directory_.WriteFile("top/1000000000.png", "");
  directory_.WriteFile("plots/error.png", "");
  directory_.WriteFile("notes/notes.txt", "");
  ASSERT_OK_AND_ASSIGN(const RecordedFolder folder, Read());
  ASSERT_EQ(folder.cameras.size(), 3u);
  EXPECT_EQ(folder.cameras[0].kind, RecordingKind::kImages);
  EXPECT_EQ(folder.cameras[0].recording, directory_.path() / "left");
  EXPECT_EQ(folder.cameras[1].camera, "right");
  EXPECT_EQ(folder.cameras[1].kind, RecordingKind::kVideo);
  EXPECT_EQ(folder.cameras[2].kind, RecordingKind::kMarkers);
  EXPECT_THAT(folder.warnings, ElementsAre(HasSubstr("plots shows images")));
}

TEST_F(RecordedFolderTest, NamesTheImagesWhoseLensIsMissingWhereNoRigIsLeft) {
  directory_.WriteFile("left/1000000000.png", "");
  directory_.WriteFile("left.yaml", kYaml);
  directory_.WriteFile("right/1000000000.png", "");
  EXPECT_THAT(Read(),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("only one camera"), HasSubstr("right shows images, but"))));
}

TEST_F(RecordedFolderTest, NamesEventsWithoutIntrinsicsAndSecondRecordings) {
  Add("front");
  directory_.WriteFile("front.raw", "");
  directory_.WriteFile("left.raw", "");
  EXPECT_THAT(Read(),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("front has several recordings: front.csv, front.raw"),
                             HasSubstr("left.raw is there, but"), HasSubstr("left.yaml"))));
}

TEST_F(RecordedFolderTest, NamesEveryFaultAtOnce) {
  Add("left");
  Add("broken");
  directory_.WriteFile("broken.yaml", "%YAML:1.0\ncamera_matrix: [[[\n");
  directory_.WriteFile("alone.csv", "");
  EXPECT_THAT(Read(), StatusIs(absl::StatusCode::kInvalidArgument,
                               AllOf(HasSubstr("alone.yaml"), HasSubstr("broken.yaml"),
                                     Not(HasSubstr("left")))));
}

TEST_F(RecordedFolderTest, RefusesANameThatNoCameraCanHave) {
  Add("left");
  Add("a;speed=1");
  EXPECT_THAT(Read(), StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("a;speed=1.csv")));
}

TEST_F(RecordedFolderTest, RefusesASingleCamera) {
  Add("left");
  EXPECT_THAT(Read(), StatusIs(absl::StatusCode::kInvalidArgument,
                               AllOf(HasSubstr("left"), HasSubstr("at least two"))));
}

TEST_F(RecordedFolderTest, SaysThatThereIsNoRecording) {
  directory_.WriteFile("left.yaml", kYaml);
  EXPECT_THAT(Read(),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("no recording"), HasSubstr(directory_.path().string()))));
}

TEST_F(RecordedFolderTest, SaysThatThereIsNoFolder) {
  EXPECT_THAT(ReadRecordedFolder(directory_.path() / "none"),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("none")));
  const auto file = directory_.WriteFile("file", "");
  EXPECT_THAT(ReadRecordedFolder(file),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("not a folder")));
}

TEST_F(RecordedFolderTest, WarnsOfIntrinsicsWithoutRecording) {
  Add("left");
  Add("right");
  directory_.WriteFile("third.yaml", kYaml);
  ASSERT_OK_AND_ASSIGN(const RecordedFolder folder, Read());
  EXPECT_THAT(folder.warnings, ElementsAre(HasSubstr("third.csv")));
}

TEST_F(RecordedFolderTest, LeavesHiddenFilesAlone) {
  Add("left");
  Add("right");
  directory_.WriteFile("._left.csv", "");
  ASSERT_OK_AND_ASSIGN(const RecordedFolder folder, Read());
  EXPECT_EQ(folder.cameras.size(), 2u);
}

TEST(RecordedFolder, ReadsTheRealRecording) {
  RIGCAL_REQUIRE_RECORDED_DATA(data);
  ASSERT_OK_AND_ASSIGN(const RecordedFolder folder, ReadRecordedFolder(data / "ewand"));
  EXPECT_EQ(folder.cameras.size(), 4u);
}

}  // namespace
}  // namespace rigcal::client::recorded_folder_test
