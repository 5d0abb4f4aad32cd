// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <bit>
#include <cstdint>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "agent/detect/disc_splitter.h"
#include "agent/detect/image_view.h"
#include "agent/detect/run_labeller.h"
#include "agent/event/event_decoder.h"

namespace rigcal::agent {

struct BlinkFilterOptions {
  SensorGeometry geometry;
  double blink_hz = 500;    // 20 to 5000; markers are lit for half of each period
  double band_rel = 0.15;   // periods within this share of the nominal one are the wand's
  int min_periods = 2;      // in a row, before a pixel is one of the wand's; 1 to 7
  int min_blob_pixels = 8;  // seeds, side by side
  int reach_px = 40;        // from the seeds, as far as a burst is followed

  // Every fault.
  absl::Status Validate() const;
};

// A marker in one burst of light.
struct BlinkBlob {
  Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();
  Eigen::Matrix2d second_moment_px2 = Eigen::Matrix2d::Zero();  // about the centre
  int area_px = 0;                                              // pixels that lit up in this burst
  double time_us = 0;    // the sensor's clock, lower 32 bits: when the marker was at the centre
  double period_us = 0;  // between the last two bursts, mean over the pixels
  PixelRect box;
  bool touches_border = false;
};

// Finds pixels that blink with the wand's frequency, in one pass with decoding: a sink of the event
// decoders (event_decoder.h).
//
// A pixel's brightness, rebuilt from its changes of polarity, crosses zero upwards where an ON
// event follows an OFF event; the time between two such crossings is the blink period (Pfrommer,
// "Frequency Cam: imaging periodic signals in real-time", arXiv 2211.00198, section 3, which
// filters the polarities with a second-order IIR first; a wand is high contrast, so the filter is
// left out and a crossing is asked to come at least 0.3 periods after the last one instead). A
// pixel that lights up late in a burst is still held in reset when the LED goes out and tells no
// OFF; so an ON event more than half a period after the last crossing is one too, but proves no
// period: without it the front of a moving marker is missing and its centre lags by a millisecond.
// Four bytes of state per pixel: the time of the last crossing, the time between the last two, how
// many periods in a row were the wand's, and the last polarity.
//
// A marker that moves is where its pixels light up, and a pixel is known to blink only periods
// after the marker has come to it. So blinking pixels are only where to look: the centre is that of
// all pixels around them that lit up in the last burst that is over. A disc that moves while it
// shines reaches an area that is symmetric about its place in the middle of that time; that is the
// time the centre is given.
class BlinkFilter {
 public:
  // INVALID_ARGUMENT: see Validate.
  static absl::StatusOr<BlinkFilter> Create(const BlinkFilterOptions& options);

  // The sink for one chunk, at least one every 30 periods: pass it to Decode by itself. It holds
  // what every event needs, so that no store of a state makes the compiler read it again.
  class Pass;
  Pass BeginPass();

  // Forgets everything: the clock begins anew.
  void TimeStepBack(int64_t time_us);

  // To be called with a time at least every 30 periods: forgets pixels that have been silent.
  void Sweep(uint32_t time_us);

  // Markers as they were in the last burst that was over at `time_us`, from top to bottom.
  const std::vector<BlinkBlob>& FindBlobs(uint32_t time_us);

  double period_us() const { return period_us_; }
  static constexpr int kBytesPerPixel = 4;

 private:
  // 16 bits: time of the last upward crossing; 12: units between the last two; 1: brighter; 3:
  // periods in a row. Units of 2^shift_ microseconds, 512 to 1024 of them in a period.
  static constexpr uint32_t kOnBit = 8;
  static constexpr uint32_t kPeriodsMask = 7;
  static constexpr uint32_t kMaxGap = 0xfff;
  static constexpr int kTileShift = 4;

  explicit BlinkFilter(const BlinkFilterOptions& options);

  struct Burst {
    double start_units = 0;  // before `now`
    double period_us = 0;
    bool found = false;
  };
  void MarkSeeds(uint32_t time_us);
  bool IsSeed(uint32_t state, uint32_t now) const;
  // Units since the pixel lit up in the last burst that is over; negative: it did not.
  int UnitsSinceBurst(uint32_t state, uint32_t now) const;
  // In the last burst or in the one before.
  bool LitUpBetween(uint32_t state, uint32_t now, uint32_t newest, uint32_t oldest) const;
  Burst FindBurst(const ComponentSums& seeds, uint32_t now);
  // The pixels that lit up between these ages and are connected with a seed, into lit_.
  void Grow(const ComponentSums& seeds, uint32_t now, uint32_t newest, uint32_t oldest);
  void Measure(const ComponentSums& seeds, const Burst& burst, uint32_t time_us);
  void AddBlob(const PixelList& pixels, const Burst& burst, uint32_t time_us);

  BlinkFilterOptions options_;
  double period_us_;
  int shift_;
  uint32_t period_units_, min_gap_, again_gap_, low_gap_, band_gap_, min_periods_, lit_units_;
  uint32_t stride_, tile_columns_, tile_rows_;
  std::vector<uint32_t> states_;
  std::vector<uint32_t> tiles_;  // time at which a pixel of it was found to blink; 0: never
  std::vector<uint64_t> seed_words_;
  std::vector<int> ages_;
  std::vector<uint8_t> seen_;
  PixelList lit_;
  DiscSplitter splitter_;
  RunLabeller labeller_;
  std::vector<BlinkBlob> blobs_;
};

class BlinkFilter::Pass {
 public:
  void Row(uint32_t) {}
  void Event(uint32_t x, uint32_t y, bool on, uint32_t time_us) {
    Update(x, y, on, time_us >> shift_, time_us);
  }
  void Vector(uint32_t x, uint32_t y, bool on, uint32_t time_us, uint32_t mask) {
    const uint32_t now = time_us >> shift_;
    for (; mask != 0; mask &= mask - 1) {
      Update(x + static_cast<uint32_t>(std::countr_zero(mask)), y, on, now, time_us);
    }
  }
  void Trigger(const TriggerEvent&) {}
  void TimeStepBack(int64_t time_us) { filter_->TimeStepBack(time_us); }

 private:
  friend class BlinkFilter;
  Pass() = default;

  void Update(uint32_t x, uint32_t y, bool on, uint32_t now, uint32_t time_us) {
    uint32_t& state = states_[y * stride_ + x];
    const uint32_t old = state;
    const uint32_t gap = (now - (old >> 16)) & 0xffff;
    const uint32_t count = old & kPeriodsMask;
    static_assert(kOnBit == 8);
    const uint32_t was_on = old >> 3 & 1;
    const bool good = (gap - low_gap_ <= band_gap_) & (was_on == 0);
    const uint32_t periods = good ? count + (count < kPeriodsMask ? 1u : 0u) : 0u;
    const uint32_t crossed = now << 16 | (gap < kMaxGap ? gap : kMaxGap) << 4 | kOnBit | periods;
    // Without a branch: which of the three an event is cannot be foretold.
    const bool crosses = on & (gap >= min_gap_ + (again_gap_ & (0u - was_on)));
    const uint32_t stays = on ? old | kOnBit : old & ~kOnBit;
    state = crosses ? crossed : stays;
    if (crosses & (periods >= min_periods_)) {
      tiles_[(y >> kTileShift) * tile_columns_ + (x >> kTileShift)] = time_us | 1;
    }
  }

  BlinkFilter* filter_;
  uint32_t* states_;
  uint32_t* tiles_;
  int shift_;
  // again_gap_: what an ON after an ON must be later than min_gap_.
  uint32_t stride_, tile_columns_, low_gap_, band_gap_, min_gap_, again_gap_, min_periods_;
};

inline BlinkFilter::Pass BlinkFilter::BeginPass() {
  Pass pass;
  pass.filter_ = this;
  pass.states_ = states_.data();
  pass.tiles_ = tiles_.data();
  pass.shift_ = shift_;
  pass.stride_ = stride_;
  pass.tile_columns_ = tile_columns_;
  pass.low_gap_ = low_gap_;
  pass.band_gap_ = band_gap_;
  pass.min_gap_ = min_gap_;
  pass.again_gap_ = again_gap_ - min_gap_;
  pass.min_periods_ = min_periods_;
  return pass;
}

}  // namespace rigcal::agent
