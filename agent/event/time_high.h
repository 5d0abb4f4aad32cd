// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

namespace rigcal::agent {

// The upper part of a sensor's time, from its TIME_HIGH words: `kBits` bits in units of 2^kShift
// microseconds, repeated many times a second. Takes the overflows out.
//
// A word that follows its predecessor within kStepUs is believed at once. Any other is a gap, a
// reset, or a damaged word; the next TIME_HIGH word, which the caller looks up, decides.
template <int kBits, int kShift>
class TimeHigh {
 public:
  static constexpr uint32_t kMask = (1u << kBits) - 1;
  static constexpr uint32_t kStepUs = 1 << 16;
  static constexpr uint32_t kStep = kStepUs >> kShift;

  // kNone and kGap: time goes on. kDamaged: the word was not taken.
  enum class Change : uint8_t { kNone, kGap, kStepBack, kDamaged };

  bool known() const { return known_; }
  // Of the last word believed, in microseconds, overflows taken out.
  int64_t time_us() const { return base_us_ + (static_cast<int64_t>(value_) << kShift); }

  // False: nothing has changed, call Decide.
  bool Take(uint32_t value) {
    if (known_ && ((value - value_) & kMask) > kStep) return false;
    if (known_ && value < value_) base_us_ += kPeriodUs;
    value_ = value;
    known_ = true;
    return true;
  }

  // `next`: the TIME_HIGH word behind this one, or nullptr where the stream does not show it yet.
  Change Decide(uint32_t value, const uint32_t* next) {
    const bool confirmed = next == nullptr || ((*next - value) & kMask) <= kStep;
    if (!confirmed && ((*next - value_) & kMask) <= kStep) return Change::kDamaged;
    const uint32_t forward = (value - value_) & kMask;
    // A sensor that restarts counts from zero; an overflow is passed within a step of the end. Of
    // other ways down, the shorter way round is taken: a gap across an overflow, or a step back.
    const bool restarted = value < value_ && value <= kStep && value_ <= kMask - kStep;
    if (restarted || forward > kMask / 2 || base_us_ > kMaxUs) {
      base_us_ = 0;
      value_ = value;
      return Change::kStepBack;
    }
    if (value < value_) base_us_ += kPeriodUs;
    value_ = value;
    return Change::kGap;
  }

 private:
  static constexpr int64_t kPeriodUs = int64_t{1} << (kBits + kShift);
  // No sensor counts for 35 years; nanoseconds must fit 64 bits whatever the words say.
  static constexpr int64_t kMaxUs = int64_t{1} << 50;

  bool known_ = false;
  uint32_t value_ = 0;
  int64_t base_us_ = 0;
};

}  // namespace rigcal::agent
