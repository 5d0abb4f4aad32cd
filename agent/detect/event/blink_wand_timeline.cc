// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/event/blink_wand_timeline.h"

#include <cmath>
#include <utility>

#include "agent/detect/event/band_advice.h"
#include "agent/detect/event/wrapped_time.h"

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
// Where no wand is found: every pixel is looked at for missed blinks so often, and not more often
// than such a part of the stream takes to decode.
constexpr int64_t kLookUs = 250'000;
constexpr size_t kBytesPerLook = size_t{1} << 18;
// Of a marker's pixels: where fewer answer a blink, some are missing by chance (seen: 0.98
// without).
constexpr double kThinnedShare = 0.93;
// What is recorded of a light that is not known, and until one that was not found so is looked for
// again.
constexpr double kLearnPeriods = 2.4, kRetryPeriods = 100;
// Outputs that follow each other faster ask for bursts before they can be recorded alone.
constexpr double kLeastApartPeriods = 2.5;
// Whatever is older is of no detection that is still to come.
constexpr double kKeepPeriods = 3;
// Of a period: pixels light up within this time of their burst's.
constexpr double kGapMarginShare = 0.06;
constexpr int kMostMissed = 20;  // bursts in a row: of the longest gap

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
      gaps_(period_us_, silence_us_),
      marker_count_(marker_period_us.size()),
      detections_(period_us_, std::move(marker_period_us), &counts_),
      answers_(period_us_),
      recorder_(filter_.geometry()),
      flashes_(filter_.geometry(), filter_.min_blob_pixels()),
      lamps_(filter_.geometry()),
      records_every_burst_(AsksForEveryBurst(output, period_us_)) {}

void BlinkWandTimeline::Begin(int64_t time_us) {
  begun_ = true;
  next_look_us_ = time_us + kLookUs;
  reached_us_ = time_us;
  next_sweep_us_ = time_us + sweep_us_;
  lamps_.Restart(time_us);
  schedule_.Start(time_us);
}

void BlinkWandTimeline::BeginTake(size_t byte_count, std::vector<Detection>* found) {
  found_ = found;
  detections_left_ = kLeastDetections + static_cast<int64_t>(byte_count / kBytesPerDetection);
  looks_left_ = 1 + static_cast<int64_t>(byte_count / kBytesPerLook);
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
    gaps_.End();
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
  gaps_.Restart();
  lamps_.Restart(time_us);
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
    next_look_us_ = time_us;
  }
  Run(time_us);
  if (time_us <= reached_us_) return;
  if (time_us - reached_us_ <= silence_us_) {
    counts_.time_us += static_cast<uint64_t>(time_us - reached_us_);
  }
  reached_us_ = time_us;
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
      flashes_.Measure(recorder_, static_cast<uint32_t>(due_us), gaps_, &lights_, &blobs_);
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

std::span<const PackedEvent> BlinkWandTimeline::FeedUpToGaps(std::span<const PackedEvent> events) {
  size_t before = gaps_.Next(events);
  while (before < events.size()) {
    if (before > 0) FeedWhole(events.first(before));
    Bridge(gaps_.last().from_us, gaps_.last().until_us);
    counts_.gaps = gaps_.count();
    counts_.gap_us = gaps_.total_us();
    // The event behind the gap, whose time is known already, and those that follow it.
    FeedWhole(events.subspan(before, 1));
    events = events.subspan(before + 1);
    if (events.empty()) return events;
    before = gaps_.Next(events);
  }
  return events;
}

void BlinkWandTimeline::Bridge(uint32_t from_us, uint32_t until_us) {
  if (must_forget_ || is_clear_) return;
  filter_.Bridge(from_us, until_us);
  if (trial_) trial_->filter.Bridge(from_us, until_us);
}

void BlinkWandTimeline::DateBlobs(uint32_t due_us) {
  if (gaps_.count() == 0 && !gaps_.IsOpenAt(due_us)) return;
  for (BlinkBlob& blob : blobs_) {
    const double margin_us = kGapMarginShare * blob.period_us;
    int periods = 0;
    const auto is_in_gap = [&](double burst_us) {
      return gaps_.Overlap(WrappedUs(burst_us - margin_us), WrappedUs(burst_us + margin_us));
    };
    while (periods < kMostMissed && is_in_gap(blob.burst_us - periods * blob.period_us)) ++periods;
    blob.burst_us -= periods * blob.period_us;
    blob.time_us -= periods * blob.period_us;
    blob.beside_gap = periods > 0;
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
  if (gaps_.IsOpenAt(due)) Bridge(gaps_.silent_since_us(), due);
  if (!must_forget_) blobs_ = filter_.FindBlobs(due);
  DateBlobs(due);
  const bool is_both = answers_.used() == PixelAnswers::kBoth;
  if (!is_both || rise_alone_) {
    flashes_.MeasureOneSwitch(recorder_, answers_.used(), due, gaps_, &lights_, &blobs_);
  } else if (asked.due_us >= learn_until_us_) {
    flashes_.Measure(recorder_, due, gaps_, &lights_, &blobs_);
  }
  lights_.Forget(due);
  BlinkWand wand = verifier_.Verify(blobs_);
  const bool is_wand = wand.outcome == DetectionOutcome::kWand;
  CountLosses(asked.due_us, wand);
  if (is_both && is_wand && !wand.is_timed && !wand.is_beside_gap && asked.due_us >= learn_from_us_)
    Learn(asked.due_us);
  counts_.by_rise += is_wand && answers_.used() == PixelAnswers::kRise ? 1 : 0;
  counts_.by_fall += is_wand && answers_.used() == PixelAnswers::kFall ? 1 : 0;
  detections_.Take(asked, std::move(wand), found_);
  ChooseAnswers(asked.due_us, is_wand);
  PlanRecording(asked.due_us);
}

void BlinkWandTimeline::CountLosses(int64_t due_us, const BlinkWand& wand) {
  if (wand.outcome == DetectionOutcome::kWand) {
    counts_.beside_gap += wand.is_beside_gap ? 1 : 0;
    if (wand.is_beside_gap) return;
    ++counts_.judged;
    counts_.answered_percent += static_cast<uint64_t>(std::lround(100 * wand.answered_share));
    counts_.thinned += wand.answered_share < kThinnedShare ? 1 : 0;
    return;
  }
  if (wand.outcome == DetectionOutcome::kAmbiguous) {
    const auto advice = AdviseBand(blobs_, marker_count_, filter_.blink_hz());
    if (!advice) return;
    ++counts_.banded;
    counts_.band_10000 += static_cast<uint64_t>(std::lround(1e4 * advice->band_rel));
    counts_.other_hz += static_cast<uint64_t>(std::lround(advice->other_hz));
    return;
  }
  if (must_forget_ || is_clear_ || looks_left_ <= 0 || due_us < next_look_us_) return;
  --looks_left_;
  next_look_us_ = due_us + kLookUs;
  const auto share = filter_.AnsweredShare(static_cast<uint32_t>(due_us));
  if (!share) return;
  ++counts_.missed_looks;
  counts_.missed_answered_percent += static_cast<uint64_t>(std::lround(100 * *share));
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
