// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

namespace rigcal::agent {

// The answer of many pixels to one change of a screen, in whole milliseconds.
struct Burst {
  int64_t first_ms = 0, last_ms = 0;  // both belong to it
  bool on = false;
  double time_ms = 0;  // the mean of its net events
};

// Finds bursts in how many more pixels became brighter than darker, millisecond by millisecond. A
// screen draws from top to bottom in a refresh and its crystals take 5 to 15 ms, so that a burst
// lasts 5 to 40 ms; 10 ms are summed, which takes lamps at 100 Hz out. What moves has as many
// bright edges as dark ones. A burst counts from a third of the recent ones' height on, and
// from six times what as many events of noise would do.
class BurstFinder {
 public:
  // Behind the last of a burst it takes so many milliseconds at most until it is told.
  static constexpr int kMostMs = 100;

  // The next millisecond: its events, and how many more of them became brighter. A burst that ended
  // now.
  std::optional<Burst> Take(int64_t time_ms, size_t events, int net);

  uint64_t bursts() const { return bursts_; }
  // Changes that come sooner than a screen can blink, as of a lamp.
  uint64_t too_quick() const { return too_quick_; }
  // From shown to shown, by the median of the last ones. 0: too few bursts.
  double BlinkHz() const;

 private:
  static constexpr int kBoxMs = 10;
  struct Sum {
    int64_t time_ms = 0;
    double events = 0;
    int net = 0;
    double sum = 0;  // of net, of the last kBoxMs
  };
  std::optional<Burst> End(int64_t time_ms);

  std::deque<Sum> sums_;
  double sum_ = 0, events_ = 0;  // of the last kBoxMs
  double level_ = 0;             // of recent bursts
  int sign_ = 0;                 // of the burst that goes on; 0: there is none
  double peak_ = 0;
  int64_t peak_ms_ = 0;
  bool is_armed_ = true;
  std::optional<double> last_burst_ms_;
  std::optional<double> last_ms_[2];  // of the last burst of each polarity
  std::deque<double> periods_ms_;
  uint64_t bursts_ = 0, too_quick_ = 0;
};

// The strongest flicker between bursts: of a backlight, of an OLED that goes dark in each refresh,
// of a lamp. Fed with how many more pixels became brighter, in quarters of a millisecond.
class FlickerMeter {
 public:
  static constexpr int64_t kBinUs = 250;
  void Take(int64_t time_us, bool on);
  // What was taken since this time belongs to a burst.
  void Forget(int64_t begin_us, int64_t end_us);
  // 0: nothing flickers from 45 to 1900 Hz.
  double FlickerHz() const;

 private:
  static constexpr size_t kBins = 16384;  // 4 s
  std::optional<int64_t> begin_us_;
  std::vector<float> net_ = std::vector<float>(kBins, 0.0f);
};

}  // namespace rigcal::agent
