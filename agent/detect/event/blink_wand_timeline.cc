// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/event/blink_wand_timeline.h"

#include <cmath>
#include <utility>

namespace rigcal::agent {
namespace {

constexpr double kWaitPeriods = 0.8;  // then the burst nearest to a time is over
// Limit of one Take: a marker of a few pixels takes more bytes for each period.
constexpr size_t kBytesPerDetection = 8;
constexpr int64_t kLeastDetections = 1000;
constexpr int64_t kSilencePeriods = 20;
constexpr size_t kBytesPerForget = 512;
constexpr int64_t kLeastForgets = 16;
constexpr int64_t kSweepPeriods = 2;
// What is recorded of a light that is not known, and until one that was not found so is looked for
// again.
constexpr double kLearnPeriods = 2.4, kRetryPeriods = 100;
// Outputs that follow each other faster ask for bursts before they can be recorded alone.
constexpr double kLeastApartPeriods = 2.5;
// Whatever is older is of no detection that is still to come.
constexpr double kKeepPeriods = 3;

bool AsksForEveryBurst(const OutputTimesOptions& output, double period_us) {
  return output.trigger != TriggerInstant::kNone ||
         1e6 / output.rate_hz < kLeastApartPeriods * period_us;
}

}  // namespace

BlinkWandTimeline::BlinkWandTimeline(BlinkFilter filter, BlinkWandVerifier verifier,
                                     const OutputTimesOptions& output,
                                     absl::InlinedVector<double, 3> marker_period_us)
    : filter_(std::move(filter)),
      verifier_(std::move(verifier)),
      period_us_(filter_.period_us()),
      sweep_us_(static_cast<int64_t>(static_cast<double>(kSweepPeriods) * period_us_)),
      silence_us_(std::min(OutputSchedule::kMaxGapUs, kSilencePeriods * sweep_us_ / kSweepPeriods)),
      schedule_(output, std::llround(kWaitPeriods * period_us_)),
      detections_(period_us_, std::move(marker_period_us), &counts_),
      answers_(period_us_),
      recorder_(filter_.geometry()),
      flashes_(filter_.geometry(), filter_.min_blob_pixels()),
      records_every_burst_(AsksForEveryBurst(output, period_us_)) {}

void BlinkWandTimeline::Begin(int64_t time_us) {
  begun_ = true;
  reached_us_ = time_us;
  next_sweep_us_ = time_us + sweep_us_;
  schedule_.Start(time_us);
}

void BlinkWandTimeline::BeginTake(size_t byte_count, std::vector<Detection>* found) {
  found_ = found;
  detections_left_ = kLeastDetections + static_cast<int64_t>(byte_count / kBytesPerDetection);
  forgets_left_ = kLeastForgets + static_cast<int64_t>(byte_count / kBytesPerForget);
}

void BlinkWandTimeline::EndTake() {
  counts_.dense_triggers = schedule_.dense_triggers();
  if (!std::exchange(must_forget_, false)) return;
  is_clear_ = true;
  filter_.TimeStepBack(reached_us_);
}

void BlinkWandTimeline::Finish(int64_t time_us, std::vector<Detection>* found) {
  BeginTake(0, found);
  if (begun_) {
    AdvanceTo(time_us);
    Run(reached_us_ + static_cast<int64_t>(kWaitPeriods * period_us_));
  }
  detections_.Finish(found);
}

uint32_t BlinkWandTimeline::Reach(uint32_t time_us) {
  const auto reached = static_cast<uint32_t>(reached_us_);
  AdvanceTo(reached_us_ + static_cast<int32_t>(time_us - reached));
  return NextStop();
}

uint32_t BlinkWandTimeline::TakeTrigger(const TriggerEvent& trigger) {
  AdvanceTo(trigger.time_us);
  schedule_.Take(trigger);
  return NextStop();
}

uint32_t BlinkWandTimeline::StepBack(int64_t time_us) {
  detections_.StepBack(found_);
  Forget(time_us);
  Begin(time_us);
  return NextStop();
}

void BlinkWandTimeline::Forget(int64_t time_us) {
  lights_.Clear();
  verifier_.ForgetTrack();
  recorder_.Clear();
  answers_.Restart();
  trial_.reset();
  learn_until_us_ = learn_from_us_ = time_us;
  is_learning_ = rise_alone_ = false;
  if (is_clear_) return;
  must_forget_ = forgets_left_ == 0;
  if (must_forget_) return;
  --forgets_left_;
  is_clear_ = true;
  filter_.TimeStepBack(time_us);
}

void BlinkWandTimeline::AdvanceTo(int64_t time_us) {
  if (!begun_) Begin(time_us);
  if (time_us - reached_us_ > silence_us_) {
    // What was due before is still detected; the rest is skipped without a look at every pixel.
    Run(reached_us_ + static_cast<int64_t>(2 * BlinkDetections::kHoldPeriods * period_us_));
    schedule_.Skip(reached_us_, time_us);
    Forget(time_us);
    next_sweep_us_ = time_us + sweep_us_;
  }
  Run(time_us);
  reached_us_ = std::max(reached_us_, time_us);
}

void BlinkWandTimeline::Run(int64_t time_us) {
  while (NextDue() <= time_us) {
    const int64_t due_us = NextDue();
    if (due_us == recorder_.next_begin_us()) {
      recorder_.Begin(filter_);
    } else if (is_learning_ && due_us == learn_until_us_) {
      is_learning_ = false;
      blobs_.clear();
      if (!must_forget_) blobs_ = filter_.FindBlobs(static_cast<uint32_t>(due_us));
      flashes_.Measure(recorder_, static_cast<uint32_t>(due_us), &lights_, &blobs_);
      rise_alone_ = !blobs_.empty() && lights_.all().empty();
      PlanRecording(due_us);
    } else if (due_us == next_sweep_us_) {
      const auto sweep_us = static_cast<uint32_t>(next_sweep_us_);
      if (!must_forget_ && !is_clear_) filter_.Sweep(sweep_us);
      if (trial_) trial_->filter.Sweep(sweep_us);
      next_sweep_us_ += sweep_us_;
      if (records_every_burst_) PlanRecording(due_us);
    } else {
      DetectNext();
    }
  }
}

void BlinkWandTimeline::DetectNext() {
  const OutputTime asked = schedule_.Pop();
  if (!asked.trigger && detections_left_ <= 0) {
    ++counts_.beyond_data;
    return;
  }
  Detect(asked);
  --detections_left_;
}

void BlinkWandTimeline::Detect(const OutputTime& asked) {
  blobs_.clear();
  const auto due = static_cast<uint32_t>(asked.due_us);
  if (!must_forget_) blobs_ = filter_.FindBlobs(due);
  const bool is_both = answers_.used() == PixelAnswers::kBoth;
  if (!is_both || rise_alone_) {
    flashes_.MeasureOneSwitch(recorder_, answers_.used(), due, &lights_, &blobs_);
  } else if (asked.due_us >= learn_until_us_) {
    flashes_.Measure(recorder_, due, &lights_, &blobs_);
  }
  lights_.Forget(due);
  BlinkWand wand = verifier_.Verify(blobs_);
  const bool is_wand = wand.outcome == DetectionOutcome::kWand;
  if (is_both && is_wand && !wand.is_timed && asked.due_us >= learn_from_us_) Learn(asked.due_us);
  counts_.by_rise += is_wand && answers_.used() == PixelAnswers::kRise ? 1 : 0;
  counts_.by_fall += is_wand && answers_.used() == PixelAnswers::kFall ? 1 : 0;
  detections_.Take(asked, std::move(wand), found_);
  ChooseAnswers(asked.due_us, is_wand);
  PlanRecording(asked.due_us);
}

void BlinkWandTimeline::Learn(int64_t now_us) {
  if (std::exchange(rise_alone_, false)) lights_.Clear();
  learn_until_us_ = now_us + static_cast<int64_t>(kLearnPeriods * period_us_);
  learn_from_us_ = now_us + static_cast<int64_t>(kRetryPeriods * period_us_);
  recorder_.PlanAll(now_us, learn_until_us_);
  is_learning_ = true;
}

void BlinkWandTimeline::ChooseAnswers(int64_t now_us, bool is_wand) {
  bool is_wand_of_trial = false;
  if (trial_) {
    const auto& blobs = trial_->filter.FindBlobs(static_cast<uint32_t>(now_us));
    is_wand_of_trial = trial_->verifier.Verify(blobs).outcome == DetectionOutcome::kWand;
  }
  switch (answers_.Take(now_us, is_wand, is_wand_of_trial)) {
    case AnswersChoice::Step::kStay:
      return;
    case AnswersChoice::Step::kBegin:
      trial_.emplace(filter_, verifier_);
      trial_->filter.LookFor(*answers_.tried());
      trial_->filter.TimeStepBack(now_us);
      trial_->verifier.ForgetTrack();
      return;
    case AnswersChoice::Step::kEnd:
      trial_.reset();
      return;
    case AnswersChoice::Step::kSwitch:
      filter_ = std::move(trial_->filter);
      trial_.reset();
      lights_.Clear();
      recorder_.Clear();
      is_learning_ = rise_alone_ = false;
      learn_until_us_ = learn_from_us_ = now_us;
  }
}

void BlinkWandTimeline::PlanRecording(int64_t now_us) {
  if (now_us < learn_until_us_) return;
  const int64_t due_us = records_every_burst_ ? next_sweep_us_ + sweep_us_ : schedule_.due_us();
  recorder_.Plan(lights_.all(), now_us, std::max(now_us, due_us), records_every_burst_,
                 static_cast<int64_t>(kKeepPeriods * period_us_));
}

}  // namespace rigcal::agent
