// SPDX-License-Identifier: Apache-2.0
#include "agent/stamp/camera_pipeline.h"

#include <atomic>
#include <memory>
#include <new>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "agent/spool/memory_spool.h"
#include "tests/agent/uplink/scripted_source.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::agent::camera_pipeline_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::_;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

const StreamKey kFirst{"s-1", "left", 1};
const StreamKey kSecond{"s-2", "left", 1};

class CameraPipelineTest : public ::testing::Test {
 protected:
  CameraPipelineTest() {
    auto source = std::make_unique<ScriptedSource>("left");
    source_ = source.get();
    pipeline_ =
        std::make_unique<CameraPipeline>(std::move(source), &spool_, [this] { ++progress_count_; });
    pipeline_->Start();
  }

  EndOfCapture EndOf(const StreamKey& stream) {
    const auto spooled = spool_.Find(stream);
    EXPECT_TRUE(spooled && spooled->end) << stream.session_id;
    return spooled && spooled->end ? *spooled->end : EndOfCapture{};
  }

  MemorySpool spool_;
  std::atomic<int> progress_count_ = 0;
  ScriptedSource* source_ = nullptr;
  std::unique_ptr<CameraPipeline> pipeline_;
};

TEST_F(CameraPipelineTest, MovesObservationsAndEndsWithWhatTheSourceRefused) {
  source_->SetRefused({{"", RefusalReason::kCsvBadTime, 2, "f.csv:1: bad"}});
  source_->AddClockSample({1, 2, 3, 4});
  source_->YieldRows(0, 3);
  source_->YieldEnd();
  ASSERT_THAT(pipeline_->Begin(kFirst, MakeTarget(), 1), IsOk());
  pipeline_->WaitUntilIdle();
  const EndOfCapture end = EndOf(kFirst);
  EXPECT_EQ(end.last_seq, 3u);
  EXPECT_EQ(end.report.observation_count, 3u);
  EXPECT_THAT(end.report.refused,
              ElementsAre(Refusal{"", RefusalReason::kCsvBadTime, 2, "f.csv:1: bad"}));
  ASSERT_OK_AND_ASSIGN(const ObservationBatch batch, spool_.Read(kFirst, 1, 10));
  EXPECT_THAT(batch.time_ns, ElementsAre(0, 1000, 2000));
  EXPECT_THAT(batch.clock_samples, ElementsAre(ClockSample{1, 2, 3, 4}));
  EXPECT_EQ(source_->target(), MakeTarget());
  EXPECT_GE(progress_count_, 1);
}

TEST_F(CameraPipelineTest, EndsARunningCaptureWhenTold) {
  ASSERT_THAT(pipeline_->Begin(kFirst, MakeTarget(), 1), IsOk());
  source_->WaitUntilStarted(1);
  EXPECT_THAT(pipeline_->Sessions(), ElementsAre("s-1"));
  pipeline_->End("another");
  EXPECT_THAT(pipeline_->Sessions(), ElementsAre("s-1"));
  pipeline_->End("s-1");
  EXPECT_THAT(pipeline_->Sessions(), IsEmpty());
  pipeline_->WaitUntilIdle();
  EXPECT_EQ(EndOf(kFirst).last_seq, 0u);
}

TEST_F(CameraPipelineTest, EndsACaptureThatIsToldSoBeforeItsSourceHasStarted) {
  for (int attempt = 0; attempt < 200; ++attempt) {
    const StreamKey stream{"s-" + std::to_string(attempt), "left", 1};
    ASSERT_THAT(pipeline_->Begin(stream, MakeTarget(), 1), IsOk());
    pipeline_->End(stream.session_id);
    pipeline_->WaitUntilIdle();
    EXPECT_EQ(EndOf(stream).last_seq, 0u);
  }
}

TEST_F(CameraPipelineTest, BeginsAStreamOnlyOnce) {
  ASSERT_THAT(pipeline_->Begin(kFirst, MakeTarget(), 1), IsOk());
  EXPECT_THAT(pipeline_->Begin(kFirst, MakeTarget(), 1),
              StatusIs(absl::StatusCode::kAlreadyExists, _));
  source_->YieldEnd();
  pipeline_->WaitUntilIdle();
  EXPECT_EQ(source_->starts(), 1);
}

TEST_F(CameraPipelineTest, LetsASecondCaptureWaitItsTurn) {
  ASSERT_THAT(pipeline_->Begin(kFirst, MakeTarget(), 1), IsOk());
  ASSERT_THAT(pipeline_->Begin(kSecond, MakeTarget(), 5), IsOk());
  source_->WaitUntilStarted(1);
  EXPECT_THAT(pipeline_->Sessions(), ElementsAre("s-1", "s-2"));
  source_->YieldRows(0, 2);
  source_->YieldEnd();
  source_->WaitUntilStarted(2);
  EXPECT_EQ(EndOf(kFirst).last_seq, 2u);
  source_->YieldRows(0, 1);
  source_->YieldEnd();
  pipeline_->WaitUntilIdle();
  EXPECT_EQ(EndOf(kSecond).last_seq, 5u);
}

TEST_F(CameraPipelineTest, EndsAWaitingCaptureAtOnceAndEmpty) {
  ASSERT_THAT(pipeline_->Begin(kFirst, MakeTarget(), 1), IsOk());
  source_->WaitUntilStarted(1);
  ASSERT_THAT(pipeline_->Begin(kSecond, MakeTarget(), 1), IsOk());
  pipeline_->End("s-2");
  EXPECT_EQ(EndOf(kSecond).last_seq, 0u);
  EXPECT_THAT(pipeline_->Sessions(), ElementsAre("s-1"));
  source_->YieldEnd();
  pipeline_->WaitUntilIdle();
  EXPECT_EQ(source_->starts(), 1);
}

TEST_F(CameraPipelineTest, ReportsASourceThatFails) {
  source_->FailToStart(absl::InvalidArgumentError("3 markers, not 2"));
  ASSERT_THAT(pipeline_->Begin(kFirst, MakeTarget(), 1), IsOk());
  pipeline_->WaitUntilIdle();
  EXPECT_EQ(EndOf(kFirst).last_seq, 0u);
  EXPECT_THAT(EndOf(kFirst).report.refused,
              ElementsAre(Refusal{"", RefusalReason::kSourceFailed, 1, "3 markers, not 2"}));
  // The next capture is not affected.
  source_->FailToStart(absl::OkStatus());
  source_->YieldRows(0, 1);
  source_->YieldError(absl::DataLossError("cable pulled"));
  ASSERT_THAT(pipeline_->Begin(kSecond, MakeTarget(), 1), IsOk());
  pipeline_->WaitUntilIdle();
  EXPECT_EQ(EndOf(kSecond).last_seq, 1u);
  EXPECT_THAT(EndOf(kSecond).report.refused,
              ElementsAre(Refusal{"", RefusalReason::kSourceFailed, 1, "cable pulled"}));
}

TEST_F(CameraPipelineTest, EndsWhenItsStreamIsDiscarded) {
  ASSERT_THAT(pipeline_->Begin(kFirst, MakeTarget(), 1), IsOk());
  source_->WaitUntilStarted(1);
  spool_.Discard(kFirst);
  source_->YieldRows(0, 1);
  pipeline_->WaitUntilIdle();
  EXPECT_THAT(spool_.Streams(), IsEmpty());
}

TEST_F(CameraPipelineTest, ShutsDownInTheMiddleOfACapture) {
  ASSERT_THAT(pipeline_->Begin(kFirst, MakeTarget(), 1), IsOk());
  ASSERT_THAT(pipeline_->Begin(kSecond, MakeTarget(), 1), IsOk());
  source_->WaitUntilStarted(1);
  pipeline_->Shutdown();
  EXPECT_EQ(EndOf(kFirst).last_seq, 0u);
  EXPECT_EQ(EndOf(kSecond).last_seq, 0u);
  EXPECT_THAT(pipeline_->Begin({"s-3", "left", 1}, MakeTarget(), 1),
              StatusIs(absl::StatusCode::kCancelled, _));
}

class ThrowingSource : public ScriptedSource {
 public:
  using ScriptedSource::ScriptedSource;
  absl::StatusOr<std::optional<Observation>> Next() override {
    throw std::runtime_error("driver gave up");
  }
};

TEST(CameraPipeline, TurnsAnExceptionOfItsSourceIntoAReport) {
  MemorySpool spool;
  CameraPipeline pipeline(std::make_unique<ThrowingSource>("left"), &spool, [] {});
  pipeline.Start();
  ASSERT_THAT(pipeline.Begin(kFirst, MakeTarget(), 1), IsOk());
  pipeline.WaitUntilIdle();
  const auto spooled = spool.Find(kFirst);
  ASSERT_TRUE(spooled && spooled->end);
  ASSERT_EQ(spooled->end->report.refused.size(), 1u);
  EXPECT_EQ(spooled->end->report.refused[0].example, "the source failed: driver gave up");
}

// Gives a few frames, and throws.
class ThrowingAfterFrames : public ScriptedSource {
 public:
  using ScriptedSource::ScriptedSource;
  absl::StatusOr<std::optional<Observation>> Next() override {
    if (++count_ > 3) throw std::bad_alloc();
    return MakeObservation(count_ * 1000, 0, 2);
  }
  std::optional<FrameCounts> frame_counts() const override {
    return FrameCounts{.received = 4, .damaged = 1, .lost = 2};
  }

 private:
  int count_ = 0;
};

TEST(CameraPipeline, KeepsTheCountsOfASourceThatThrows) {
  MemorySpool spool;
  auto source = std::make_unique<ThrowingAfterFrames>("left");
  source->SetRefused({{"", RefusalReason::kFrameIncomplete, 1, "frame 2"}});
  CameraPipeline pipeline(std::move(source), &spool, [] {});
  pipeline.Start();
  ASSERT_THAT(pipeline.Begin(kFirst, MakeTarget(), 1), IsOk());
  pipeline.WaitUntilIdle();
  const auto spooled = spool.Find(kFirst);
  ASSERT_TRUE(spooled && spooled->end);
  const CameraReport& report = spooled->end->report;
  EXPECT_EQ(report.observation_count, 3u);
  ASSERT_TRUE(report.frames);
  EXPECT_EQ(report.frames->received, 4u);
  EXPECT_EQ(report.frames->lost, 2u);
  ASSERT_EQ(report.refused.size(), 2u);
  EXPECT_EQ(report.refused[0].reason, RefusalReason::kFrameIncomplete);
  EXPECT_THAT(report.refused[1].example, HasSubstr("bad_alloc"));
}

TEST(MakePipelines, MakesNoneOfNoCamera) {
  MemorySpool spool;
  const auto pipelines = MakePipelines({}, &spool, [] {});
  ASSERT_THAT(pipelines.status(), IsOk());
  EXPECT_TRUE(pipelines->empty());
}

TEST(MakePipelines, RefusesTwoOfOneName) {
  MemorySpool spool;
  std::vector<std::unique_ptr<ObservationSource>> sources;
  for (const char* name : {"a", "b", "a"}) {
    sources.push_back(std::make_unique<ScriptedSource>(name));
  }
  EXPECT_THAT(MakePipelines(std::move(sources), &spool, [] {}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("two cameras are named a")));
}

}  // namespace
}  // namespace rigcal::agent::camera_pipeline_test
