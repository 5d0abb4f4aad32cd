// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/detecting_observation_source.h"

#include <spdlog/sinks/ostream_sink.h>
#include <spdlog/spdlog.h>

#include <cmath>
#include <deque>
#include <map>
#include <memory>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "agent/capture/image_file.h"
#include "agent/capture/pacer.h"
#include "agent/capture/simulated/simulated_frame_source.h"
#include "common/camera/camera_model.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::agent::detecting_observation_source_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::rigcal::testing::TemporaryDirectory;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::Pair;

constexpr int kWidth = 640;
constexpr int kHeight = 480;
const cv::Scalar kOrange(20, 110, 235);

Target Wand() { return *ParseTarget("wand:0,0.13,0.39;diameter=0.04;hz=500"); }

// Frames that a test has made.
class ScriptedFrames : public FrameSource {
 public:
  explicit ScriptedFrames(std::vector<cv::Mat> images, double exposure_s = 0)
      : images_(std::move(images)), exposure_s_(exposure_s) {
    description_.camera = "left";
    description_.image_size_px = {kWidth, kHeight};
    description_.clock = {"left", "recording"};
  }

  const CameraDescription& description() const override { return description_; }
  absl::Status Start(const Target&) override {
    next_ = 0;
    return absl::OkStatus();
  }
  absl::StatusOr<std::optional<Frame>> Next() override {
    if (stopped_ || next_ == images_.size()) return std::nullopt;
    const auto time_ns = static_cast<int64_t>(next_) * 40'000'000;
    return Frame{.image = ViewOf(images_[next_++]),
                 .time_ns = time_ns,
                 .clock_epoch = 0,
                 .exposure_s = exposure_s_};
  }
  void Stop() override { stopped_ = true; }
  FrameCounts counts() const override { return {.received = next_, .damaged = 2}; }
  std::vector<Refusal> Refused() const override {
    return {
        {.camera = "", .reason = RefusalReason::kFrameUnreadable, .count = 2, .example = "a.png"}};
  }

 private:
  const std::vector<cv::Mat> images_;
  const double exposure_s_;
  CameraDescription description_;
  size_t next_ = 0;
  bool stopped_ = false;
};

cv::Mat Room() { return cv::Mat(kHeight, kWidth, CV_8UC3, cv::Scalar(30, 30, 30)); }

// Spheres on a line at 0, 0.13 and 0.39 of 400 px per 0.39 m.
cv::Mat WandAt(double x, double y) {
  cv::Mat image = Room();
  for (const double along : {0.0, 100.0, 300.0}) {
    cv::circle(image, cv::Point2d(x + along, y), 9, kOrange, cv::FILLED, cv::LINE_AA);
  }
  return image;
}

std::unique_ptr<DetectingObservationSource> Make(std::unique_ptr<FrameSource> frames,
                                                 const DetectingOptions& options = {}) {
  auto source = DetectingObservationSource::Create(std::move(frames), options);
  EXPECT_THAT(source, IsOk());
  return *std::move(source);
}

std::vector<Observation> Drain(DetectingObservationSource& source) {
  EXPECT_THAT(source.Start(Wand()), IsOk());
  std::vector<Observation> observations;
  while (true) {
    const auto observation = source.Next();
    EXPECT_THAT(observation, IsOk());
    if (!observation.ok() || !*observation) return observations;
    observations.push_back(**observation);
  }
}

std::map<RefusalReason, uint64_t> Counts(const DetectingObservationSource& source) {
  std::map<RefusalReason, uint64_t> counts;
  for (const Refusal& refusal : source.Refused()) counts[refusal.reason] = refusal.count;
  return counts;
}

// What was logged during its life.
class LoggedText {
 public:
  LoggedText() : old_(spdlog::default_logger()) {
    spdlog::set_default_logger(std::make_shared<spdlog::logger>(
        "test", std::make_shared<spdlog::sinks::ostream_sink_mt>(stream_)));
  }
  ~LoggedText() { spdlog::set_default_logger(old_); }
  std::string text() const { return stream_.str(); }

 private:
  std::ostringstream stream_;
  std::shared_ptr<spdlog::logger> old_;
};

TEST(DetectingObservationSource, YieldsAnObservationPerFrame) {
  std::vector<cv::Mat> images;
  for (int i = 0; i < 5; ++i) images.push_back(WandAt(100 + 4 * i, 200));
  images.push_back(Room());
  const auto source = Make(std::make_unique<ScriptedFrames>(images));
  for (int capture = 0; capture < 2; ++capture) {
    const std::vector<Observation> observations = Drain(*source);
    ASSERT_EQ(observations.size(), 6u);
    for (size_t i = 0; i < 5; ++i) {
      EXPECT_EQ(observations[i].time_ns, 40'000'000 * static_cast<int64_t>(i));
      ASSERT_EQ(observations[i].VisibleCount(), 3) << i;
      EXPECT_NEAR(observations[i].markers[1].centre_px.x(), 200 + 4 * static_cast<double>(i), 0.1);
    }
    ASSERT_EQ(observations[5].markers.size(), 3u);
    EXPECT_EQ(observations[5].VisibleCount(), 0);
    EXPECT_EQ(source->detection_counts()->Of(DetectionOutcome::kWand), 5u);
    EXPECT_EQ(source->frame_counts()->received, 6u);
    EXPECT_THAT(Counts(*source), Contains(Pair(RefusalReason::kFrameUnreadable, 2u)));
  }
}

TEST(DetectingObservationSource, CountsAndWarnsOfFramesThatAreNoGood) {
  const LoggedText log;
  const cv::Mat black(kHeight, kWidth, CV_8UC3, cv::Scalar(0, 0, 0));
  const cv::Mat white(kHeight, kWidth, CV_8UC3, cv::Scalar(255, 255, 255));
  const auto source = Make(std::make_unique<ScriptedFrames>(
      std::vector<cv::Mat>{black, black, white, WandAt(100, 100)}));
  const std::vector<Observation> observations = Drain(*source);
  ASSERT_EQ(observations.size(), 4u);
  EXPECT_EQ(observations[3].VisibleCount(), 3);
  EXPECT_THAT(Counts(*source), AllOf(Contains(Pair(RefusalReason::kFrameBlack, 2u)),
                                     Contains(Pair(RefusalReason::kFrameSaturated, 1u))));
  EXPECT_THAT(log.text(), AllOf(HasSubstr("camera left"), HasSubstr("lens cap"),
                                HasSubstr("shorten the exposure")));
  const size_t first = log.text().find("lens cap");
  EXPECT_EQ(log.text().find("lens cap", first + 1), std::string::npos) << "warns of every frame";
}

TEST(DetectingObservationSource, WarnsOfAPictureThatIsAllOfTheWandsColour) {
  const LoggedText log;
  const cv::Mat orange(kHeight, kWidth, CV_8UC3, kOrange);
  const auto source = Make(std::make_unique<ScriptedFrames>(std::vector<cv::Mat>{orange}));
  EXPECT_EQ(Drain(*source).size(), 1u);
  EXPECT_THAT(log.text(), AllOf(HasSubstr("camera left"), HasSubstr("100 % of the picture"),
                                HasSubstr("what stands still is ignored")));
}

TEST(DetectingObservationSource, WarnsOnceOfAnExposureShorterThanABlink) {
  const LoggedText log;
  const std::vector<cv::Mat> images(3, WandAt(100, 100));
  const auto enough = Make(std::make_unique<ScriptedFrames>(images, 0.002));
  Drain(*enough);
  EXPECT_THAT(log.text(), Not(HasSubstr("shorter than one blink")));
  const auto unknown = Make(std::make_unique<ScriptedFrames>(images, 0));
  Drain(*unknown);
  EXPECT_THAT(log.text(), Not(HasSubstr("shorter than one blink")));
  const auto source = Make(std::make_unique<ScriptedFrames>(images, 0.001));
  Drain(*source);
  const std::string text = log.text();
  const size_t first = text.find("1 ms is shorter than one blink of the target (2 ms)");
  ASSERT_NE(first, std::string::npos) << text;
  EXPECT_EQ(text.find("shorter than one blink", first + 30), std::string::npos);
}

TEST(DetectingObservationSource, LearnsWhatStandsStillBeforeTheWave) {
  // Lamps that stand like a wand.
  std::vector<cv::Mat> images(3, WandAt(100, 400));
  for (int i = 0; i < 3; ++i) {
    cv::Mat both = WandAt(100, 400);
    const cv::Mat wand = WandAt(150 + 3 * i, 150);
    cv::max(both, wand, both);
    images.push_back(both);
  }
  DetectingOptions options;
  options.learn_mask_s = 0.12;  // three frames
  const auto source = Make(std::make_unique<ScriptedFrames>(images), options);
  const std::vector<Observation> observations = Drain(*source);
  ASSERT_EQ(observations.size(), 6u);
  for (size_t i = 0; i < 3; ++i) EXPECT_EQ(observations[i].VisibleCount(), 0) << i;
  for (size_t i = 3; i < 6; ++i) {
    ASSERT_EQ(observations[i].VisibleCount(), 3) << i;
    EXPECT_NEAR(observations[i].markers[0].centre_px.y(), 150, 1);
  }
}

TEST(DetectingObservationSource, IgnoresLampsThatStandLikeAWandAfterSeconds) {
  std::vector<cv::Mat> images;
  for (int i = 0; i < 60; ++i) {
    cv::Mat both = WandAt(100, 400);
    cv::max(both, WandAt(150 + 2 * i, 150), both);
    images.push_back(both);
  }
  DetectingOptions options;
  options.background_s = 1;
  const auto source = Make(std::make_unique<ScriptedFrames>(images), options);
  const std::vector<Observation> observations = Drain(*source);
  EXPECT_EQ(observations[0].VisibleCount(), 0);
  for (size_t i = 40; i < 60; ++i) {
    ASSERT_EQ(observations[i].VisibleCount(), 3) << i;
    EXPECT_NEAR(observations[i].markers[0].centre_px.y(), 150, 1);
  }
  EXPECT_GT(source->last_detection().background_share, 0);

  options.background_s = 0;
  const auto without = Make(std::make_unique<ScriptedFrames>(images), options);
  EXPECT_EQ(Drain(*without).back().VisibleCount(), 0);
  EXPECT_EQ(without->last_detection().background_share, 0);
}

TEST(DetectingObservationSource, CountsFramesInWhichAWandThatRestsIsIgnored) {
  LoggedText log;
  std::vector<cv::Mat> images(120, WandAt(100, 200));
  images.push_back(WandAt(103, 202));
  DetectingOptions options;
  options.background_s = 1;
  const auto source = Make(std::make_unique<ScriptedFrames>(images), options);
  const std::vector<Observation> observations = Drain(*source);
  for (size_t i = 0; i < 70; ++i) EXPECT_EQ(observations[i].VisibleCount(), 3) << i;
  EXPECT_EQ(observations[115].VisibleCount(), 0);
  EXPECT_EQ(observations[120].VisibleCount(), 3);
  EXPECT_GT(Counts(*source)[RefusalReason::kWandResting], 20u);
  EXPECT_EQ(Counts(*source)[RefusalReason::kWandResting], source->resting_wands());
  EXPECT_THAT(log.text(), HasSubstr("has rested for 3 s and is ignored until it moves"));
}

TEST(DetectingObservationSource, TakesAMaskOfTheRightSizeOnly) {
  const TemporaryDirectory directory;
  const std::string path = (directory.path() / "mask.png").string();
  PixelMask mask(kWidth, kHeight);
  for (int y = 80; y < 120; ++y) {
    for (int x = 0; x < kWidth; ++x) mask.Set(x, y);
  }
  ASSERT_THAT(WriteMask(mask, path), IsOk());
  DetectingOptions options;
  options.mask_path = path;
  const std::vector<cv::Mat> images = {WandAt(100, 100), WandAt(100, 200)};
  const auto source = Make(std::make_unique<ScriptedFrames>(images), options);
  const std::vector<Observation> observations = Drain(*source);
  ASSERT_EQ(observations.size(), 2u);
  EXPECT_EQ(observations[0].VisibleCount(), 0);
  EXPECT_EQ(observations[1].VisibleCount(), 3);

  ASSERT_THAT(WriteMask(PixelMask(64, 48), path), IsOk());
  EXPECT_THAT(DetectingObservationSource::Create(std::make_unique<ScriptedFrames>(images), options),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("camera left"), HasSubstr("64x48"), HasSubstr("640x480"))));
  options.mask_path = "/nowhere.png";
  EXPECT_THAT(DetectingObservationSource::Create(std::make_unique<ScriptedFrames>(images), options),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("/nowhere.png")));
}

TEST(DetectingObservationSource, StopsWithItsFrames) {
  const auto source =
      Make(std::make_unique<ScriptedFrames>(std::vector<cv::Mat>(3, WandAt(100, 100))));
  ASSERT_THAT(source->Start(Wand()), IsOk());
  ASSERT_TRUE((*source->Next()).has_value());
  source->Stop();
  EXPECT_FALSE((*source->Next()).has_value());
}

TEST(DetectingObservationSource, HandsFramesToWhoeverAsksForOne) {
  const auto source =
      Make(std::make_unique<ScriptedFrames>(std::vector<cv::Mat>(2, WandAt(100, 100))));
  std::optional<PreviewFrame> preview;
  source->preview_tap()->Request([&](PreviewFrame frame) { preview = std::move(frame); });
  Drain(*source);
  ASSERT_TRUE(preview.has_value());
  EXPECT_EQ(preview->image.width, kWidth);
  EXPECT_EQ(preview->detection.outcome, DetectionOutcome::kWand);
}

// The way from a simulated camera's pixels to its observations, against the world's truth.
TEST(DetectingObservationSource, FindsTheWandOfASimulatedCamera) {
  SimulatedFrameSourceOptions options;
  options.camera = "sim_0";
  options.simulation.camera_count = 4;
  options.simulation.duration_s = 15;
  options.simulation.rate_hz = 5;
  options.speed = kMaxSpeed;
  const Target target = Wand();
  ASSERT_OK_AND_ASSIGN(const SimulatedWorld world,
                       SimulatedWorld::Create(options.simulation, target));
  ASSERT_OK_AND_ASSIGN(auto frames, SimulatedFrameSource::Create(options));
  const auto source = Make(std::move(frames));
  const std::vector<Observation> observations = Drain(*source);
  ASSERT_EQ(observations.size(), static_cast<size_t>(world.FrameCount(0)));
  int fully_visible = 0;
  int found = 0;
  double square_px2 = 0;
  const SimulatedCamera& camera = world.cameras()[0];
  constexpr double kClearPx = 32;  // a sphere is at most about 25 px wide in this world
  for (size_t i = 0; i < observations.size(); ++i) {
    const int frame = static_cast<int>(i);
    EXPECT_EQ(observations[i].time_ns, world.Observe(0, frame).time_ns);
    const WandPose wand = world.WandAt(world.FrameRigTime(0, frame));
    std::vector<Eigen::Vector2d> truth_px;
    for (const double along_m : world.true_target().marker_positions_m) {
      Eigen::Vector2d pixel;
      if (!Project(camera.true_intrinsics,
                   camera.cam_from_rig * Eigen::Vector3d(wand.origin_m + along_m * wand.direction),
                   &pixel)) {
        break;
      }
      const ImageSize& size = camera.description.image_size_px;
      if (pixel.x() < 20 || pixel.y() < 20 || pixel.x() > size.width - 20.0 ||
          pixel.y() > size.height - 20.0) {
        break;
      }
      truth_px.push_back(pixel);
    }
    if (truth_px.size() < 3 || (truth_px[1] - truth_px[0]).norm() < kClearPx) continue;
    ++fully_visible;
    if (observations[i].VisibleCount() < 3) continue;
    ++found;
    for (size_t m = 0; m < 3; ++m) {
      square_px2 += (observations[i].markers[m].centre_px - truth_px[m]).squaredNorm() / 6;
    }
  }
  ASSERT_GE(fully_visible, 20);
  EXPECT_GE(found, 0.95 * fully_visible);
  EXPECT_LT(std::sqrt(square_px2 / found), 0.15) << "per coordinate";
}

}  // namespace
}  // namespace rigcal::agent::detecting_observation_source_test
