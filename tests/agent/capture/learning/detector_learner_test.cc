// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/learning/detector_learner.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <opencv2/imgproc.hpp>
#include <string>
#include <utility>

#include "agent/capture/detecting_observation_source.h"
#include "agent/capture/image_file.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::agent::detector_learner_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::rigcal::testing::TemporaryDirectory;
using ::testing::AllOf;
using ::testing::HasSubstr;
using State = DetectorLearning::State;

constexpr int kWidth = 640;
constexpr int kHeight = 480;
const cv::Scalar kOrange(20, 110, 235);
using Draw = std::function<void(cv::Mat*, int frame)>;

// Spheres at 0, 0.13 and 0.39 of 300 px per 0.39 m.
void DrawWand(cv::Mat* image, double x, double y) {
  for (const double along : {0.0, 100.0, 300.0}) {
    cv::circle(*image, cv::Point2d(x + along, y), 9, kOrange, cv::FILLED, cv::LINE_AA);
  }
}
void MovingWand(cv::Mat* image, int frame) {
  DrawWand(image, 20 + 41 * frame % 290, 30 + 37 * frame % 330);
}
void StillWand(cv::Mat* image, int) { DrawWand(image, 100, 200); }
void Lamp(cv::Mat* image, int) {
  cv::circle(*image, cv::Point2d(500, 430), 20, kOrange, cv::FILLED);
}
void LampAndMovingWand(cv::Mat* image, int frame) {
  Lamp(image, frame);
  MovingWand(image, frame);
}

// A camera without end.
class DrawnFrames : public FrameSource {
 public:
  explicit DrawnFrames(Draw draw) : draw_(std::move(draw)) {
    description_.camera = "left";
    description_.image_size_px = {kWidth, kHeight};
    description_.clock = {"left", "recording"};
  }
  const CameraDescription& description() const override { return description_; }
  absl::Status Start(const Target&) override { return absl::OkStatus(); }
  absl::StatusOr<std::optional<Frame>> Next() override {
    if (stopped_) return std::nullopt;
    image_ = cv::Mat(kHeight, kWidth, CV_8UC3, cv::Scalar(30, 30, 30));
    draw_(&image_, next_);
    return Frame{.image = ViewOf(image_), .time_ns = 20'000'000 * int64_t{next_++}};
  }
  void Stop() override { stopped_ = true; }
  FrameCounts counts() const override { return {}; }

 private:
  const Draw draw_;
  CameraDescription description_;
  cv::Mat image_;
  int next_ = 0;
  bool stopped_ = false;
};

class DetectorLearnerTest : public ::testing::Test {
 protected:
  // A camera "left" that shows this and captures.
  void Capture(Draw draw, const ColourRange& colour = {}) {
    learner_.reset();
    DetectingOptions options;
    options.detector.colour = colour;
    auto source =
        DetectingObservationSource::Create(std::make_unique<DrawnFrames>(std::move(draw)), options);
    ASSERT_THAT(source, IsOk());
    source_ = *std::move(source);
    ASSERT_THAT(source_->Start(*ParseTarget("wand:0,0.13,0.39")), IsOk());
    StartLearner();
  }
  void StartLearner() {
    learner_ = std::make_unique<DetectorLearner>(
        options_,
        DetectorLearner::Detectors{{"left", source_->detector_control()}, {"event", nullptr}},
        [this] {
          const std::lock_guard lock(mutex_);
          ++answer_count_;
          answered_.notify_all();
        });
  }
  DetectorAnswer Ask(DetectorCommand command, uint32_t frame_count = 0,
                     const std::string& camera = "left",
                     const std::optional<ColourRange>& colour = {}) {
    learner_->Request({.request_id = ++last_id_,
                       .camera = camera,
                       .command = command,
                       .frame_count = frame_count,
                       .colour = colour});
    std::unique_lock lock(mutex_);
    EXPECT_TRUE(
        answered_.wait_for(lock, std::chrono::seconds(60), [this] { return answer_count_ > 0; }));
    --answer_count_;
    lock.unlock();
    DetectorAnswer answer = learner_->TakeAnswer().value_or(DetectorAnswer{});
    EXPECT_EQ(answer.request_id, last_id_);
    return answer;
  }
  // The camera goes on until the learning has ended.
  DetectorLearning AwaitEnd() {
    const auto give_up = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    while (std::chrono::steady_clock::now() < give_up) {
      source_->Next().status().IgnoreError();
      const DetectorAnswer answer = Ask(DetectorCommand::kGet);
      if (!answer.state.learning || answer.state.learning->state != State::kRunning) {
        return answer.state.learning.value_or(DetectorLearning{});
      }
    }
    ADD_FAILURE() << "it never ends";
    return {};
  }
  DetectionOutcome NextOutcome() {
    EXPECT_THAT(source_->Next(), IsOk());
    return source_->last_detection().outcome;
  }

  const TemporaryDirectory directory_;
  LearningOptions options_{.folder = directory_.path() / "detectors",
                           .mask_span = std::chrono::milliseconds(0),
                           .colour_span = std::chrono::milliseconds(0)};
  std::unique_ptr<DetectingObservationSource> source_;
  std::mutex mutex_;
  std::condition_variable answered_;
  int answer_count_ = 0;
  uint32_t last_id_ = 0;
  std::unique_ptr<DetectorLearner> learner_;
};

TEST_F(DetectorLearnerTest, AMaskHidesWhatStandsStillAtOnceAndAfterARestart) {
  Capture(LampAndMovingWand);
  const DetectorAnswer begun = Ask(DetectorCommand::kLearnMask, 12);
  ASSERT_THAT(begun.status, IsOk());
  ASSERT_TRUE(begun.state.learning.has_value());
  EXPECT_EQ(begun.state.learning->state, State::kRunning);
  EXPECT_EQ(begun.state.learning->wanted_frame_count, 12u);
  EXPECT_FALSE(begun.state.mask_learnt);
  const DetectorLearning learning = AwaitEnd();
  EXPECT_EQ(learning.state, State::kSucceeded) << learning.message;
  EXPECT_EQ(learning.kind, DetectorLearning::Kind::kMask);
  EXPECT_EQ(learning.frame_count, 12u);
  EXPECT_GE(learning.wand_count, 9u);
  EXPECT_THAT(learning.message, HasSubstr("12 frames"));
  const DetectorState now = Ask(DetectorCommand::kGet).state;
  EXPECT_TRUE(now.mask_learnt);
  // The lamp with its margin, and nothing of the wand.
  EXPECT_GT(now.ignored_pixel_count, 1200u);
  EXPECT_LT(now.ignored_pixel_count, 2600u);

  Capture(Lamp);
  EXPECT_EQ(Ask(DetectorCommand::kGet).state.ignored_pixel_count, now.ignored_pixel_count);
  EXPECT_EQ(NextOutcome(), DetectionOutcome::kNoBlob);
  const DetectorAnswer cleared = Ask(DetectorCommand::kClearMask);
  ASSERT_THAT(cleared.status, IsOk());
  EXPECT_EQ(cleared.state.ignored_pixel_count, 0u);
  EXPECT_NE(NextOutcome(), DetectionOutcome::kNoBlob) << "the lamp is seen again";
  StartLearner();
  EXPECT_FALSE(Ask(DetectorCommand::kGet).state.mask_learnt);
}

TEST_F(DetectorLearnerTest, NoMaskHidesAWandThatIsInView) {
  Capture(StillWand);
  ASSERT_THAT(Ask(DetectorCommand::kLearnMask, 10).status, IsOk());
  const DetectorLearning learning = AwaitEnd();
  EXPECT_EQ(learning.state, State::kFailed);
  EXPECT_THAT(learning.message, AllOf(HasSubstr("in 10 of 10 frames"), HasSubstr("out of view")));
  EXPECT_FALSE(Ask(DetectorCommand::kGet).state.mask_learnt);
  EXPECT_EQ(NextOutcome(), DetectionOutcome::kWand);
}

TEST_F(DetectorLearnerTest, NoMaskHidesMostOfTheImage) {
  Capture([](cv::Mat* image, int) { image->rowRange(0, 400) = kOrange; });
  ASSERT_THAT(Ask(DetectorCommand::kLearnMask, 5).status, IsOk());
  const DetectorLearning learning = AwaitEnd();
  EXPECT_EQ(learning.state, State::kFailed);
  EXPECT_THAT(learning.message, HasSubstr("% of the image"));
}

TEST_F(DetectorLearnerTest, ATunedColourFindsTheWandAtOnceAndAfterARestart) {
  const ColourRange blue{.hue_min_deg = 200, .hue_max_deg = 240, .washed_out_min = 256};
  Capture(MovingWand, blue);
  EXPECT_EQ(NextOutcome(), DetectionOutcome::kNoBlob);
  ASSERT_THAT(Ask(DetectorCommand::kTune, 8).status, IsOk());
  const DetectorLearning learning = AwaitEnd();
  ASSERT_EQ(learning.state, State::kSucceeded) << learning.message;
  EXPECT_EQ(learning.kind, DetectorLearning::Kind::kColour);
  EXPECT_THAT(learning.message, HasSubstr("of 8 frames"));
  EXPECT_EQ(NextOutcome(), DetectionOutcome::kWand);
  Capture(MovingWand, blue);
  EXPECT_TRUE(Ask(DetectorCommand::kGet).state.colour_learnt);
  EXPECT_EQ(NextOutcome(), DetectionOutcome::kWand);
  // Back to the configuration.
  const DetectorAnswer reset = Ask(DetectorCommand::kSetColour);
  EXPECT_EQ(reset.state.colour, blue);
  EXPECT_FALSE(reset.state.colour_learnt);
  EXPECT_EQ(NextOutcome(), DetectionOutcome::kNoBlob);
}

TEST_F(DetectorLearnerTest, NoColourIsLearntWithoutTheWand) {
  Capture(Lamp);
  ASSERT_THAT(Ask(DetectorCommand::kTune, 3).status, IsOk());
  const DetectorLearning learning = AwaitEnd();
  EXPECT_EQ(learning.state, State::kFailed);
  EXPECT_THAT(learning.message, HasSubstr("nothing like the wand"));
  EXPECT_FALSE(Ask(DetectorCommand::kGet).state.colour_learnt);
}

TEST_F(DetectorLearnerTest, SetsAColour) {
  Capture(MovingWand);
  const ColourRange green{.hue_min_deg = 100, .hue_max_deg = 140, .washed_out_min = 256};
  const DetectorAnswer set = Ask(DetectorCommand::kSetColour, 0, "left", green);
  ASSERT_THAT(set.status, IsOk());
  EXPECT_EQ(set.state.colour, green);
  EXPECT_EQ(NextOutcome(), DetectionOutcome::kNoBlob);
  EXPECT_THAT(Ask(DetectorCommand::kSetColour, 0, "left", ColourRange{.value_min = 0}).status,
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("value_min is 0")));
  EXPECT_EQ(Ask(DetectorCommand::kGet).state.colour, green);
}

TEST_F(DetectorLearnerTest, RefusesWhatIsNotPossible) {
  Capture(MovingWand);
  EXPECT_THAT(Ask(DetectorCommand::kGet, 0, "top").status,
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("top")));
  EXPECT_THAT(Ask(DetectorCommand::kLearnMask, 0, "event").status,
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("event camera")));
  EXPECT_THAT(Ask(DetectorCommand::kLearnMask, 1001).status,
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("1001, at most 1000")));
  ASSERT_THAT(Ask(DetectorCommand::kLearnMask, 5).status, IsOk());
  for (const DetectorCommand command : {DetectorCommand::kLearnMask, DetectorCommand::kTune,
                                        DetectorCommand::kClearMask, DetectorCommand::kSetColour}) {
    EXPECT_THAT(Ask(command).status, StatusIs(absl::StatusCode::kFailedPrecondition,
                                              HasSubstr("learns a mask now, from 0 of 5 frames")));
  }
  EXPECT_THAT(Ask(DetectorCommand::kGet).status, IsOk());
}

TEST_F(DetectorLearnerTest, RefusesAColourFromATargetOfTwoMarkers) {
  Capture(MovingWand);
  source_->detector_control()->SetTarget(*ParseTarget("wand:0,0.2"));
  EXPECT_THAT(Ask(DetectorCommand::kTune).status,
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("three markers")));
  EXPECT_FALSE(Ask(DetectorCommand::kGet).state.learning.has_value());
}

TEST_F(DetectorLearnerTest, EndsWithTheCaptureAndNeedsOne) {
  Capture(MovingWand);
  ASSERT_THAT(Ask(DetectorCommand::kLearnMask, 50).status, IsOk());
  source_->Stop();
  const DetectorLearning learning = AwaitEnd();
  EXPECT_EQ(learning.state, State::kFailed);
  EXPECT_THAT(learning.message, HasSubstr("the capture ended after"));
  EXPECT_THAT(Ask(DetectorCommand::kTune).status,
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("only while a session")));
}

TEST_F(DetectorLearnerTest, EndsWhereNoFramesCome) {
  options_.time_limit = std::chrono::milliseconds(1);
  Capture(MovingWand);
  ASSERT_THAT(Ask(DetectorCommand::kTune).status, IsOk());
  DetectorLearning learning;
  do {
    learning = Ask(DetectorCommand::kGet).state.learning.value_or(DetectorLearning{});
  } while (learning.state == State::kRunning);
  EXPECT_EQ(learning.state, State::kFailed);
  EXPECT_THAT(learning.message,
              AllOf(HasSubstr("only 0 of 50 frames"), HasSubstr("within 0.001 s")));
}

TEST_F(DetectorLearnerTest, GoesOnWhenTheClientHasGoneAndEndsWithTheAgent) {
  Capture(LampAndMovingWand);
  ASSERT_THAT(Ask(DetectorCommand::kLearnMask, 5).status, IsOk());
  learner_->Forget();
  EXPECT_EQ(AwaitEnd().state, State::kSucceeded);
  ASSERT_THAT(Ask(DetectorCommand::kLearnMask, 500).status, IsOk());
  learner_->Shutdown();
  EXPECT_THAT(source_->Next(), IsOk());
}

}  // namespace
}  // namespace rigcal::agent::detector_learner_test
