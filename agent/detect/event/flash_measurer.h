// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "agent/detect/event/blink_lights.h"
#include "agent/detect/event/burst_measurer.h"
#include "agent/detect/event/flash_recorder.h"
#include "agent/detect/event/pixel_answers.h"
#include "agent/event/event_gaps.h"

namespace rigcal::agent {

// Where a marker was in the middle of the time that its light shone, whatever share of a period
// that is, from how its pixels answer the light's rise and its fall.
//
// A pixel fires when its light has changed by a threshold since it last fired. At the front of a
// moving marker it has become brighter since then already, and at its back darker. So a pixel at
// the front is quicker to answer the rise and one at the back slower: the pixels that answer it
// lie ahead of the marker. With the fall it is the other way round, and they lie behind. How far
// goes with the contrast, and is a millisecond of motion where there is little; but the mean of the
// two is where the marker was in the middle between rise and fall, to some hundredths of one. Both
// times are those of the median pixel. One thread at a time.
class FlashMeasurer {
 public:
  // Blobs beyond these, the largest, keep what they have: the time is bounded.
  static constexpr size_t kMaxBlobs = 24;

  FlashMeasurer(SensorGeometry geometry, int min_pixels)
      : geometry_(geometry), min_pixels_(min_pixels) {}

  // Gives the blobs the centre, area and time of the last burst of their light that is over at
  // `due_us`, where it was recorded. Lights that are not in `lights` yet are found where everything
  // was recorded for two periods; times of those that are there are renewed. A flash of which a
  // part is in a gap is not measured (BlinkBlob::beside_gap).
  void Measure(const FlashRecorder& recorder, double due_us, const EventGaps& gaps,
               BlinkLights* lights, std::vector<BlinkBlob>* blobs);
  // The same where pixels answer one of the two switches; kBoth: the rise, and the fall not at
  // once. What displaces their area has no counterpart then that it could be weighed against: the
  // centre is that area's and the time that of the switch plus or minus what is usual. Which way
  // the rest of the displacement is, is BlinkBlob::ahead. Blobs are not timed
  // (BlinkBlob::is_timed).
  void MeasureOneSwitch(const FlashRecorder& recorder, PixelAnswers answers, double due_us,
                        const EventGaps& gaps, BlinkLights* lights, std::vector<BlinkBlob>* blobs);

 private:
  struct Answer {
    float since_due_us = 0;
    uint16_t x = 0, y = 0;
    bool on = false;
  };
  struct Flash {
    Blob shape;
    double time_us = 0;         // since due
    double answered_share = 1;  // BlinkBlob::answered_share
  };
  void Collect(std::span<const PackedEvent> events, double due_us,
               const std::vector<BlinkBlob>& blobs);
  // The light of a blob's first burst that was recorded whole from `from_us` to `until_us`.
  std::optional<BlinkLight> FindLight(const BlinkBlob& blob, const std::vector<Answer>& answers,
                                      double due_us, double from_us, double until_us);
  // The pixels that answer about this time, and those that cannot because they fired within
  // BlinkLight::before_us before.
  std::optional<Flash> MeasureFlash(const std::vector<Answer>& answers, bool on, double begin_us,
                                    const BlinkLight& light, int least_pixels);

  SensorGeometry geometry_;
  int min_pixels_;
  std::vector<size_t> largest_;               // indices of blobs
  std::vector<std::vector<Answer>> answers_;  // of each of those
  std::vector<Answer> flash_;
  std::vector<float> first_us_;  // by pixel of a box
  std::vector<float> times_us_;
  PixelList pixels_;
};

}  // namespace rigcal::agent
