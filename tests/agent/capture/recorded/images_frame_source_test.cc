// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/recorded/images_frame_source.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "agent/capture/pacer.h"
#include "tests/agent/capture/recorded/image_files.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::agent::images_frame_source_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::rigcal::testing::TemporaryDirectory;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Pair;

class ImagesFrameSourceTest : public ::testing::Test {
 protected:
  struct Seen {
    int number;
    int64_t time_ns;
    uint32_t clock_epoch;
    friend bool operator==(const Seen&, const Seen&) = default;
  };

  void SetUp() override { std::filesystem::create_directory(folder()); }
  std::filesystem::path folder() const { return directory_.path() / "left"; }
  void Write(const std::string& name, int number) {
    WriteImage(folder() / name, NumberedFrame(number));
  }
  RecordedFramesOptions Options() const {
    RecordedFramesOptions options;
    options.camera = "left";
    options.path = folder().string();
    options.speed = kMaxSpeed;
    return options;
  }
  static std::vector<Seen> Drain(ImagesFrameSource& source) {
    EXPECT_THAT(source.Start(Target{}), IsOk());
    std::vector<Seen> seen;
    while (true) {
      const auto frame = source.Next();
      EXPECT_THAT(frame, IsOk());
      if (!frame.ok() || !*frame) return seen;
      const cv::Mat image((*frame)->image.height, (*frame)->image.width, CV_8UC3,
                          const_cast<uint8_t*>((*frame)->image.data));
      seen.push_back(
          {NumberOf(image.at<cv::Vec3b>(20, 20)), (*frame)->time_ns, (*frame)->clock_epoch});
    }
  }
  static std::map<RefusalReason, uint64_t> Counts(const ImagesFrameSource& source) {
    std::map<RefusalReason, uint64_t> counts;
    for (const Refusal& refusal : source.Refused()) counts[refusal.reason] = refusal.count;
    return counts;
  }

  TemporaryDirectory directory_;
};

TEST_F(ImagesFrameSourceTest, YieldsFramesInTheirNaturalOrderWithTheTimesOfTheirNames) {
  Write("f10_0000000080000000.png", 3);
  Write("f9_0000000040000000.png", 2);
  Write("f1_0000000000000000.png", 1);
  directory_.WriteFile("left/notes.txt", "no image");
  ASSERT_OK_AND_ASSIGN(const auto source, ImagesFrameSource::Create(Options()));
  EXPECT_EQ(source->description().camera, "left");
  EXPECT_EQ(source->description().image_size_px, (ImageSize{kImageWidth, kImageHeight}));
  EXPECT_EQ(source->description().clock.timebase, "recording");
  EXPECT_FALSE(source->description().intrinsics.has_value());
  const std::vector<Seen> all = {{1, 0, 0}, {2, 40000000, 0}, {3, 80000000, 0}};
  EXPECT_EQ(Drain(*source), all);
  EXPECT_EQ(source->counts().received, 3u);
  EXPECT_THAT(source->Refused(), IsEmpty());
  EXPECT_EQ(Drain(*source), all) << "a second capture begins anew";
  EXPECT_EQ(source->counts().received, 3u);
}

TEST_F(ImagesFrameSourceTest, TakesTimesFromTheFileBeside) {
  Write("b.png", 1);
  Write("a.png", 2);
  Write("c.png", 3);
  directory_.WriteFile("left/timestamps.csv",
                       "name;timestamp_ns\nb.png;50000000\na.png;10000000\nd.png;90000000\n");
  ASSERT_OK_AND_ASSIGN(const auto source, ImagesFrameSource::Create(Options()));
  EXPECT_EQ(Drain(*source), (std::vector<Seen>{{2, 10000000, 0}, {1, 50000000, 0}}));
  EXPECT_THAT(Counts(*source), ElementsAre(Pair(RefusalReason::kFrameNoTime, 1u)));
  EXPECT_EQ(source->counts().damaged, 1u);
}

TEST_F(ImagesFrameSourceTest, CountsOutATimePerFrame) {
  for (const int number : {0, 1, 2}) Write("p" + std::to_string(number) + ".png", number);
  RecordedFramesOptions options = Options();
  options.fps = 25;
  options.exposure_s = 0.004;
  ASSERT_OK_AND_ASSIGN(const auto source, ImagesFrameSource::Create(options));
  EXPECT_EQ(Drain(*source), (std::vector<Seen>{{0, 0, 0}, {1, 40000000, 0}, {2, 80000000, 0}}));
  ASSERT_THAT(source->Start(Target{}), IsOk());
  EXPECT_EQ((*source->Next())->exposure_s, 0.004);
}

TEST_F(ImagesFrameSourceTest, StampsOfTheStartBecomeThoseOfTheMiddle) {
  for (const int number : {0, 1}) Write("p" + std::to_string(number) + ".png", number);
  RecordedFramesOptions options = Options();
  options.fps = 25;
  options.exposure_s = 0.004;
  options.stamps = StampMoment::kStart;
  ASSERT_OK_AND_ASSIGN(const auto source, ImagesFrameSource::Create(options));
  EXPECT_EQ(Drain(*source), (std::vector<Seen>{{0, 2000000, 0}, {1, 42000000, 0}}));
}

TEST_F(ImagesFrameSourceTest, PassesOverWhatIsDamaged) {
  Write("0000000000000000.png", 0);
  Write("0000000040000000.png", 1);
  Truncate(folder() / "0000000040000000.png", 0.5);
  directory_.WriteFile("left/0000000080000000.png", "");
  WriteImage(folder() / "0000000120000000.png", NumberedFrame(3, 32, 24));
  Write("no_time.png", 4);
  Write("0000000200000000.png", 5);
  ASSERT_OK_AND_ASSIGN(const auto source, ImagesFrameSource::Create(Options()));
  EXPECT_EQ(Drain(*source), (std::vector<Seen>{{0, 0, 0}, {5, 200000000, 0}}));
  EXPECT_THAT(Counts(*source), ElementsAre(Pair(RefusalReason::kFrameWrongSize, 1u),
                                           Pair(RefusalReason::kFrameNoTime, 1u),
                                           Pair(RefusalReason::kFrameUnreadable, 2u)));
  EXPECT_EQ(source->counts().received + source->counts().damaged, 6u);
}

TEST_F(ImagesFrameSourceTest, BeginsAnEpochWhereTimesGoBackAndKeepsEqualOnes) {
  Write("a_0000000500000000.png", 0);
  Write("b_0000000500000000.png", 1);
  Write("c_0000000100000000.png", 2);
  Write("d_0000000140000000.png", 3);
  ASSERT_OK_AND_ASSIGN(const auto source, ImagesFrameSource::Create(Options()));
  EXPECT_EQ(Drain(*source),
            (std::vector<Seen>{
                {0, 500000000, 0}, {1, 500000000, 0}, {2, 100000000, 1}, {3, 140000000, 1}}));
}

TEST_F(ImagesFrameSourceTest, TakesASingleFrameWithoutATime) {
  RecordedFramesOptions options = Options();
  options.path = WriteImage(directory_.path() / "one.png", NumberedFrame(4));
  ASSERT_OK_AND_ASSIGN(const auto source, ImagesFrameSource::Create(options));
  EXPECT_EQ(Drain(*source), (std::vector<Seen>{{4, 0, 0}}));
}

TEST_F(ImagesFrameSourceTest, RefusesFoldersItCannotUse) {
  EXPECT_THAT(ImagesFrameSource::Create(Options()),
              StatusIs(absl::StatusCode::kNotFound,
                       AllOf(HasSubstr("camera left"), HasSubstr("no image in the folder"))));
  RecordedFramesOptions missing = Options();
  missing.path = "/nowhere";
  EXPECT_THAT(ImagesFrameSource::Create(missing),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("/nowhere")));
  Write("0001.png", 1);
  Write("0002.png", 2);
  EXPECT_THAT(
      ImagesFrameSource::Create(Options()),
      StatusIs(absl::StatusCode::kInvalidArgument,
               AllOf(HasSubstr("has a time"), HasSubstr("timestamps.csv"), HasSubstr("fps=RATE"))));
}

TEST_F(ImagesFrameSourceTest, RefusesTimesThatAreNoNanoseconds) {
  for (const int number : {0, 1, 2, 3}) {
    Write("1699999999" + std::to_string(100 + 40 * number) + ".png", number);
  }
  EXPECT_THAT(ImagesFrameSource::Create(Options()),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("by 40 ns"), HasSubstr("milliseconds"))));
}

TEST_F(ImagesFrameSourceTest, RefusesACalibrationOfAnotherSize) {
  Write("0000000000000000.png", 0);
  Write("0000000040000000.png", 0);
  RecordedFramesOptions options = Options();
  options.calibration_path = directory_.WriteFile("left.yaml", kSmallCameraYaml).string();
  EXPECT_THAT(ImagesFrameSource::Create(options), IsOk());
  for (const char* name : {"0000000000000000.png", "0000000040000000.png"}) {
    WriteImage(folder() / name, NumberedFrame(1, 32, 24));
  }
  EXPECT_THAT(ImagesFrameSource::Create(options),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("32x24"), HasSubstr("64x48"), HasSubstr("left.yaml"))));
}

TEST_F(ImagesFrameSourceTest, SaysSoWhenNothingCanBeRead) {
  directory_.WriteFile("left/0000000000000000.png", "no");
  EXPECT_THAT(ImagesFrameSource::Create(Options()),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("none of the first")));
}

TEST_F(ImagesFrameSourceTest, StopsBetweenFrames) {
  Write("0000000000000000.png", 0);
  Write("0000000040000000.png", 1);
  ASSERT_OK_AND_ASSIGN(const auto source, ImagesFrameSource::Create(Options()));
  ASSERT_THAT(source->Start(Target{}), IsOk());
  ASSERT_TRUE((*source->Next()).has_value());
  source->Stop();
  EXPECT_FALSE((*source->Next()).has_value());
}

}  // namespace
}  // namespace rigcal::agent::images_frame_source_test
