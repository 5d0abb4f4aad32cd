// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "tests/accuracy/detection/event_detection_experiment.h"

namespace rigcal::accuracy {

// Detection rate of event cameras against the frequency at which the wand blinks.
struct BlinkFrequencyOptions {
  EventDetectionOptions detection;  // frequency and warm-up are ignored
  std::vector<double> blink_hz;     // ascending
};

// The wand 1.5 to 5 m away before a sensor with a refractory period of 0.7 ms, with one sigma of
// 10 % over the pixels; sixteen frequencies from 100 to 1 500 Hz. The chain that the paper
// describes gets the same events.
BlinkFrequencyOptions PaperBlinkFrequency();

struct BlinkFrequencyPoint {
  double blink_hz = 0;
  EventDetectionSummary summary;

  // Share of the detections at times of a fully visible wand that contain it; NaN if there are
  // none.
  double WandRate() const;
  // Share of fully visible wands with a blob of the textbook chain in every marker.
  double TextbookRate() const;
};

std::vector<BlinkFrequencyPoint> RunBlinkFrequency(const BlinkFrequencyOptions& options);

// One line of column names, one for each point.
std::string BlinkFrequencyCsv(const BlinkFrequencyOptions& options,
                              const std::vector<BlinkFrequencyPoint>& points);

}  // namespace rigcal::accuracy
