// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>

#include "agent/detect/event/pixel_answers.h"

namespace rigcal::agent {

// Finds out which switches of the wand's light a sensor's pixels answer, by how often the wand is
// found. Begins with both. While the wand is found in nearly every detection nothing else is tried.
// Otherwise the other answers are, one after the other, beside those that are used, and the first
// that finds it clearly more often at the same times is used from then on. Without a wand none
// does; the pauses between the trials become longer. One thread at a time.
class AnswersChoice {
 public:
  enum class Step : uint8_t {
    kStay,
    kBegin,   // of a trial
    kEnd,     // of a trial
    kSwitch,  // what was tried is used now
  };

  explicit AnswersChoice(double period_us);

  PixelAnswers used() const { return used_; }
  // None: there is no trial.
  std::optional<PixelAnswers> tried() const { return tried_; }

  // After each detection: whether it found the wand by used() and by tried(). After kEnd there may
  // be another trial at once: kBegin comes next.
  Step Take(int64_t time_us, bool is_wand, bool is_wand_of_tried);
  // The clock begins anew: no trial.
  void Restart();

 private:
  Step Watch(int64_t time_us);
  Step Compare(int64_t time_us, bool is_wand_of_tried);
  void Count(int64_t from_us);

  const int64_t settle_us_;
  PixelAnswers used_ = PixelAnswers::kBoth;
  std::optional<PixelAnswers> tried_;
  PixelAnswers next_ = PixelAnswers::kRise;  // to be tried
  int trials_ = 0;                           // since the last pause
  int64_t pause_us_;
  bool has_begun_ = false;
  int64_t from_us_ = 0;  // of what is counted
  int outputs_ = 0, wands_ = 0, wands_of_tried_ = 0;
};

}  // namespace rigcal::agent
