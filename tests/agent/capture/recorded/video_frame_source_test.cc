// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/recorded/video_frame_source.h"

#include <filesystem>
#include <map>
#include <opencv2/videoio.hpp>
#include <string>
#include <vector>

#include "agent/capture/pacer.h"
#include "tests/agent/capture/recorded/image_files.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::agent::video_frame_source_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::rigcal::testing::TemporaryDirectory;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Pair;

constexpr int kFrames = 12;

class VideoFrameSourceTest : public ::testing::Test {
 protected:
  // Lossless, 25 frames per second.
  RecordedFramesOptions Write(const std::string& name, const char* codec = "FFV1") {
    const std::string path = (directory_.path() / name).string();
    cv::VideoWriter writer(path, cv::CAP_FFMPEG,
                           cv::VideoWriter::fourcc(codec[0], codec[1], codec[2], codec[3]), 25,
                           {kImageWidth, kImageHeight});
    EXPECT_TRUE(writer.isOpened()) << "this OpenCV cannot write " << name;
    for (int number = 0; number < kFrames; ++number) writer << NumberedFrame(number);
    writer.release();
    RecordedFramesOptions options;
    options.camera = "left";
    options.path = path;
    options.speed = kMaxSpeed;
    return options;
  }
  static std::vector<int64_t> Drain(VideoFrameSource& source, std::vector<int>* numbers = nullptr) {
    EXPECT_THAT(source.Start(Target{}), IsOk());
    std::vector<int64_t> times_ns;
    while (true) {
      const auto frame = source.Next();
      EXPECT_THAT(frame, IsOk());
      if (!frame.ok() || !*frame) return times_ns;
      times_ns.push_back((*frame)->time_ns);
      const uint8_t* const pixel = (*frame)->image.Row(20) + 60;
      if (numbers != nullptr) numbers->push_back(NumberOf({pixel[0], pixel[1], pixel[2]}));
    }
  }
  static std::map<RefusalReason, uint64_t> Counts(const VideoFrameSource& source) {
    std::map<RefusalReason, uint64_t> counts;
    for (const Refusal& refusal : source.Refused()) counts[refusal.reason] = refusal.count;
    return counts;
  }

  TemporaryDirectory directory_;
};

TEST_F(VideoFrameSourceTest, YieldsEveryFrameWithTheTimeOfTheFile) {
  for (const char* name : {"a.mkv", "a.avi"}) {
    ASSERT_OK_AND_ASSIGN(const auto source, VideoFrameSource::Create(Write(name)));
    EXPECT_EQ(source->description().image_size_px, (ImageSize{kImageWidth, kImageHeight}));
    for (int capture = 0; capture < 2; ++capture) {
      std::vector<int> numbers;
      const std::vector<int64_t> times_ns = Drain(*source, &numbers);
      ASSERT_EQ(times_ns.size(), size_t{kFrames}) << name;
      for (int i = 0; i < kFrames; ++i) {
        EXPECT_EQ(times_ns[static_cast<size_t>(i)], 40000000 * i) << name;
        EXPECT_NEAR(numbers[static_cast<size_t>(i)], i, 1) << name;
      }
      EXPECT_EQ(source->counts().received, uint64_t{kFrames});
      EXPECT_THAT(source->Refused(), IsEmpty());
    }
  }
}

TEST_F(VideoFrameSourceTest, NeedsARateWhereTheFileHasNoTimes) {
  RecordedFramesOptions options = Write("raw.mjpg", "MJPG");
  EXPECT_THAT(VideoFrameSource::Create(options),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("camera left"), HasSubstr("has no times"),
                             HasSubstr("fps=RATE"), HasSubstr("raw.timestamps.csv"))));
  options.fps = 50;
  ASSERT_OK_AND_ASSIGN(const auto source, VideoFrameSource::Create(options));
  const std::vector<int64_t> times_ns = Drain(*source);
  ASSERT_EQ(times_ns.size(), size_t{kFrames});
  EXPECT_EQ(times_ns.back(), 20000000 * (kFrames - 1));
}

TEST_F(VideoFrameSourceTest, TakesTimesFromTheFileBeside) {
  std::string text = "timestamp_ns\n";
  for (int i = 0; i < kFrames - 1; ++i) text += std::to_string(1000000000 + 33000000 * i) + "\n";
  const RecordedFramesOptions options = Write("b.mkv");
  directory_.WriteFile("b.timestamps.csv", text);
  ASSERT_OK_AND_ASSIGN(const auto source, VideoFrameSource::Create(options));
  const std::vector<int64_t> times_ns = Drain(*source);
  ASSERT_EQ(times_ns.size(), size_t{kFrames - 1});
  EXPECT_EQ(times_ns.front(), 1000000000);
  EXPECT_THAT(Counts(*source), ElementsAre(Pair(RefusalReason::kFrameNoTime, 1u)));
}

TEST_F(VideoFrameSourceTest, KeepsWhatIsGoodOfATruncatedFile) {
  const RecordedFramesOptions options = Write("a.mkv");
  Truncate(options.path, 0.5);
  ASSERT_OK_AND_ASSIGN(const auto source, VideoFrameSource::Create(options));
  const size_t kept = Drain(*source).size();
  EXPECT_GE(kept, 3u);
  EXPECT_LT(kept, size_t{kFrames});
  EXPECT_THAT(Counts(*source), Contains(Pair(RefusalReason::kVideoTruncated, kFrames - kept)));
  EXPECT_EQ(source->counts().lost + source->counts().received, uint64_t{kFrames});
}

TEST_F(VideoFrameSourceTest, NeverYieldsATimeThatDoesNotGrow) {
  // The last frames of this codec come without their times.
  ASSERT_OK_AND_ASSIGN(const auto source, VideoFrameSource::Create(Write("a.mp4", "mp4v")));
  const std::vector<int64_t> times_ns = Drain(*source);
  ASSERT_GE(times_ns.size(), size_t{kFrames - 4});
  for (size_t i = 1; i < times_ns.size(); ++i) EXPECT_GT(times_ns[i], times_ns[i - 1]);
  EXPECT_EQ(source->counts().received + source->counts().damaged, uint64_t{kFrames});
}

TEST_F(VideoFrameSourceTest, RefusesWhatIsNoVideo) {
  RecordedFramesOptions options = Write("a.mkv");
  options.path = "/nowhere.mkv";
  EXPECT_THAT(VideoFrameSource::Create(options),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("/nowhere.mkv")));
  options.path = directory_.WriteFile("text.mkv", "no video").string();
  EXPECT_THAT(VideoFrameSource::Create(options),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("text.mkv")));
  options = Write("whole.mp4", "mp4v");
  Truncate(options.path, 0.6);
  EXPECT_THAT(VideoFrameSource::Create(options),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("truncated")));
}

TEST_F(VideoFrameSourceTest, RefusesACalibrationOfAnotherSize) {
  RecordedFramesOptions options = Write("a.mkv");
  std::string yaml(kSmallCameraYaml);
  yaml.replace(yaml.find("image_width: 64"), 15, "image_width: 99");
  options.calibration_path = directory_.WriteFile("a.yaml", yaml).string();
  EXPECT_THAT(VideoFrameSource::Create(options),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("99x48")));
}

}  // namespace
}  // namespace rigcal::agent::video_frame_source_test
