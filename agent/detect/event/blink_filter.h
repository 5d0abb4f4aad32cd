// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "agent/detect/event/blink_seeds.h"
#include "agent/detect/event/burst_measurer.h"
#include "agent/detect/event/pixel_answers.h"

namespace rigcal::agent {

struct BlinkTuning {
  double band_rel = 0.15;   // periods within this share of a nominal one are the wand's
  int min_periods = 2;      // in a row, before a pixel is one of the wand's; 1 to 7
  int min_blob_pixels = 8;  // that blink side by side, >= 1
};

struct BlinkFilterOptions : BlinkTuning {
  SensorGeometry geometry = {};
  // 20 to 5000 each; markers are lit for half of each period. Several must be at least kMinRatio
  // apart, and at most kMaxRatio from the lowest to the highest.
  std::vector<double> blink_hz = {500};

  // Nearer ones cannot be distinguished.
  static constexpr double kMinRatio = 1.1;
  // All markers are measured about one time, when the last burst of the slowest is over. A pixel
  // remembers two blinks: of the fastest, both would be newer.
  static constexpr double kMaxRatio = 1.6;

  // Every fault.
  absl::Status Validate() const;
};

// Finds pixels that blink with the wand's frequency, in one pass with decoding: a consumer of the
// batches of events that decoders make (event_batcher.h).
//
// A pixel's brightness, rebuilt from its changes of polarity, crosses zero upwards where an ON
// event follows an OFF event; the time between two such crossings is the blink period (Pfrommer,
// "Frequency Cam: imaging periodic signals in real-time", arXiv 2211.00198, section 3, which
// filters the polarities with a second-order IIR first; a wand is high contrast, so the filter is
// left out and a crossing is asked to come at least 0.3 periods after the last one instead). A
// pixel that lights up late in a burst is still in reset when the LED goes out and emits no OFF
// event; so an ON event more than half a period after the last crossing is one too, but proves no
// period: without it the front of a moving marker is missing and its centre lags by a millisecond.
// Four bytes of state per pixel: the time of the last crossing, the time between the last two, how
// many periods in a row were the wand's, and the last polarity.
//
// A marker that moves is where its pixels light up, and a pixel is known to blink only periods
// after the marker has come to it. So blinking pixels are only where to look: the centre is that of
// all pixels around them that lit up in the last burst that is over. A disc that moves while it
// shines reaches an area that is symmetric about its place in the middle of that time; that is the
// time the centre is given.
//
// With several frequencies a pixel counts while its periods lie between the shortest and the
// longest, which costs events nothing. It is one of the frequency's that its last period is nearest
// to; pixels of one frequency that lie side by side must then in the mean be within band_rel of it,
// and within 0.4 of the way to the next frequency: what blinks between two of them is neither's.
class BlinkFilter {
 public:
  // INVALID_ARGUMENT: see Validate.
  static absl::StatusOr<BlinkFilter> Create(const BlinkFilterOptions& options,
                                            const BlinkKernel& kernel = BestBlinkKernel());

  // The consumer of decoders' batches (EventBatcher).
  void Events(std::span<const PackedEvent> events) {
    kernel_->update(rules_, events.data(), events.size(), states_.data(), tiles_.data());
  }
  void Trigger(const TriggerEvent&) {}
  // Forgets everything: the clock begins anew.
  void TimeStepBack(int64_t time_us);
  // From now on looks for pixels that answer these switches and no others; where it is one, "lit
  // up" below means that they answered it. TimeStepBack must follow.
  void LookFor(PixelAnswers answers);

  // To be called at least every 10 periods: forgets pixels without events, a part of the sensor in
  // each call.
  void Sweep(uint32_t time_us);

  // The sensor was silent between these times: what pixels that blink did then is taken to be what
  // they did in the periods before, so that a light that goes on behind the gap is known to blink.
  // May be called again with the same `from_us` and a later end.
  void Bridge(uint32_t from_us, uint32_t until_us);

  // Markers as they were in the last burst that was over at `time_us`, from top to bottom; with
  // several frequencies for one after the other, each in a burst about as long ago as that of the
  // lowest.
  const std::vector<BlinkBlob>& FindBlobs(uint32_t time_us);

  // Of the blinks of pixels that lie close together and blink with the first frequency but miss
  // blinks, the share that they answer, between 0 and 1; none: there are no such pixels. Looks at
  // every pixel of the sensor.
  std::optional<double> AnsweredShare(uint32_t time_us) const;

  // Marks the tiles (BlinkRules) in which pixels have blinked lately, and those beside them.
  void MarkActive(uint32_t time_us, std::vector<uint8_t>* tiles) const;

  double period_us() const { return period_us_; }  // the longest
  const std::vector<double>& blink_hz() const { return options_.blink_hz; }
  SensorGeometry geometry() const { return options_.geometry; }
  int min_blob_pixels() const { return options_.min_blob_pixels; }
  static constexpr int kBytesPerPixel = 4;

 private:
  static constexpr int kTileShift = BlinkRules::kTileShift;

  BlinkFilter(const BlinkFilterOptions& options, const BlinkKernel& kernel);
  // One pixel, in units; whether it would have lit up.
  bool Bridge(uint32_t from, uint32_t length, uint32_t* state) const;

  BlinkFilterOptions options_;
  double period_us_;
  const BlinkKernel* kernel_;
  BlinkRules rules_;
  int shift_;
  uint32_t tile_rows_;
  std::vector<uint32_t> states_;  // see BlinkRules
  // Sweep went on to this state at this time.
  size_t sweep_from_ = 0;
  uint32_t swept_us_ = 0;
  bool has_swept_ = false;
  std::vector<uint32_t> tiles_;      // when a pixel of it last blinked; 0: never
  std::vector<BlinkPeriod> blinks_;  // as in options_
  BlinkSeeds seeds_;
  BurstMeasurer measurer_;
  std::vector<BlinkBlob> blobs_;
};

}  // namespace rigcal::agent
