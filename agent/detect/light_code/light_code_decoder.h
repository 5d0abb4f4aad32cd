// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "absl/functional/function_ref.h"
#include "common/time/clock.h"

namespace rigcal::agent {

// What a wand's light code said at a moment of a camera's clock.
struct LightCodeReading {
  uint32_t wand = 0;  // its number
  int64_t camera_time_ns = 0;
  int64_t wand_time_ns = 0;  // since it began to blink
  double sigma_s = 0;        // one sigma of either
  double wand_rate = 1;      // seconds of the wand's clock per second of the camera's
};

ClockSample ToClockSample(const LightCodeReading& reading);

enum class LightCodeState : uint8_t {
  kNone,     // no code is seen
  kSeen,     // the light changes between two levels, and is not read yet
  kRead,     // by the last attempt
  kTooSlow,  // the same as kSeen, and there are too few frames to read it
};

// Reads a light code (common/light_code/light_code.h) from how bright a wand's middle sphere was in
// the frames or outputs of one camera. One thread at a time.
//
// Of the last 12 s, the bits' length (the wand's clock may be 3 % off) and phase are those with
// which levels differ most between bits and least within them. The most certain bits then give the
// 20 that all others follow from; a reading is made only where the bits that were not needed agree
// so well that fewer than one in 10^9 attempts on noise would. That takes 6 s of a wand in view.
class LightCodeDecoder {
 public:
  // At least two frames must lie in each bit.
  static constexpr double kLeastRateHz = 20;

  // How bright the middle sphere was, in any unit that the wand's distance does not change: lower
  // during a 1. A time before the last one, or long after it, begins anew.
  void Add(int64_t camera_time_ns, double level);

  // Those made since the last call; about one a second.
  std::vector<LightCodeReading> Take();

  LightCodeState state() const { return state_; }
  double frame_rate_hz() const { return frame_rate_hz_; }  // 0: not known yet

 private:
  struct Sample {
    double time_s = 0, level = 0;  // since origin_ns_
  };
  // Bit floor(time_s * bits_per_s + phase).
  struct BitClock {
    double bits_per_s = 0, phase = 0;
    double At(double time_s) const { return time_s * bits_per_s + phase; }
  };
  struct Fit {
    BitClock clock;
    double sigma_s = 0;  // of a time in the middle of the window
  };
  double MiddleS() const { return 0.5 * (samples_.front().time_s + samples_.back().time_s); }
  // -1 while dimmed, 1 else, more or less, by sample. Empty: the levels are not of two kinds.
  // `is_sure`: they are, whatever else is known.
  std::vector<double> Contrast(bool* is_sure) const;
  BitClock FindClock(const std::vector<double>& contrast) const;
  // Once the bits are known; near `clock`.
  Fit FitTo(const std::vector<double>& contrast, const BitClock& clock,
            absl::FunctionRef<bool(double place)> is_dimmed) const;
  std::optional<LightCodeReading> Read(const std::vector<double>& contrast) const;
  void Attempt();

  int64_t origin_ns_ = 0;
  std::vector<Sample> samples_;  // by time
  double attempted_s_ = 0;
  double last_rate_ = 0;  // of the last reading; 0: none
  double frame_rate_hz_ = 0;
  LightCodeState state_ = LightCodeState::kNone;
  std::vector<LightCodeReading> readings_;
};

}  // namespace rigcal::agent
