// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/event/answers_choice.h"

#include <algorithm>

namespace rigcal::agent {
namespace {

constexpr int kAnswers = 3;
// Between trials: at least so many outputs, and so long at first and in the end.
constexpr int kPauseOutputs = 20;
constexpr int64_t kFirstPauseUs = 100'000, kLongestPauseUs = 2'000'000;
// Of the outputs: nothing is tried if at least so many show the wand.
constexpr double kNearlyAll = 0.9;
// Pixels need some periods to be known to blink.
constexpr double kSettlePeriods = 8;
// Of a trial; it is over earlier if the first few show no wand.
constexpr int kTrialOutputs = 12, kEmptyOutputs = 5;
// In a trial: by so many wands the better one must have more.
constexpr int kClearlyMore = 4;

PixelAnswers After(PixelAnswers answers) {
  return static_cast<PixelAnswers>((static_cast<int>(answers) + 1) % kAnswers);
}

}  // namespace

AnswersChoice::AnswersChoice(double period_us)
    : settle_us_(static_cast<int64_t>(kSettlePeriods * period_us)), pause_us_(kFirstPauseUs) {}

void AnswersChoice::Count(int64_t from_us) {
  from_us_ = from_us;
  outputs_ = wands_ = wands_of_tried_ = 0;
}

void AnswersChoice::Restart() {
  tried_.reset();
  trials_ = 0;
  pause_us_ = kFirstPauseUs;
  has_begun_ = false;
}

AnswersChoice::Step AnswersChoice::Take(int64_t time_us, bool is_wand, bool is_wand_of_tried) {
  if (!has_begun_) Count(time_us + settle_us_);
  has_begun_ = true;
  if (time_us < from_us_) return Step::kStay;
  ++outputs_;
  wands_ += is_wand ? 1 : 0;
  return tried_ ? Compare(time_us, is_wand_of_tried) : Watch(time_us);
}

AnswersChoice::Step AnswersChoice::Watch(int64_t time_us) {
  if (trials_ == 0) {
    if (outputs_ < kPauseOutputs || time_us < from_us_ + pause_us_) return Step::kStay;
    if (wands_ >= kNearlyAll * outputs_) {
      pause_us_ = kFirstPauseUs;
      Count(time_us);
      return Step::kStay;
    }
    next_ = After(used_);
  }
  tried_ = next_;
  next_ = After(next_);
  ++trials_;
  Count(time_us + settle_us_);
  return Step::kBegin;
}

AnswersChoice::Step AnswersChoice::Compare(int64_t time_us, bool is_wand_of_tried) {
  wands_of_tried_ += is_wand_of_tried ? 1 : 0;
  const bool is_empty = outputs_ == kEmptyOutputs && wands_of_tried_ == 0;
  if (outputs_ < kTrialOutputs && !is_empty) return Step::kStay;
  const bool is_better = wands_of_tried_ >= wands_ + kClearlyMore;
  if (is_better) used_ = *tried_;
  tried_.reset();
  if (is_better || trials_ == kAnswers - 1) {
    pause_us_ = is_better ? kFirstPauseUs : std::min(2 * pause_us_, kLongestPauseUs);
    trials_ = 0;
  }
  Count(time_us);
  return is_better ? Step::kSwitch : Step::kEnd;
}

}  // namespace rigcal::agent
