// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "agent/detect/frame/colour_share.h"
#include "common/camera/frame_counts.h"
#include "common/status/refusal.h"
#include "common/target/detection_outcome.h"

namespace rigcal::agent {

// How long something took, per frame.
class Durations {
 public:
  void Add(double seconds) { seconds_.push_back(seconds); }
  double MeanMs() const;                  // 0 without any
  double QuantileMs(double share) const;  // 0.5: the median; 0 without any

 private:
  std::vector<double> seconds_;
};

// Results of one run of the detector.
struct DetectionReport {
  FrameCounts frames;
  DetectionCounts detections;
  uint64_t learning = 0;   // frames that went into the mask only
  uint64_t tracked = 0;    // wands found in the predicted window
  uint64_t cut_short = 0;  // searches that left candidates out, to bound their time
  // Of the frames that were searched whole: means of Detection::passed_share and white_share.
  double passed_share = 0, white_share = 0;
  ExposureFacts exposure;
  double background_share = 0;  // of the last frame: Detection::background_share
  uint64_t resting_wands = 0;   // frames in which a wand was ignored because it rests
  // "sphere" or "blob", as csv: is to be told with ;centres=; empty: no marker was seen.
  std::string centres;
  std::vector<Refusal> refused;
  Durations reading;  // from file or camera, decoding or rendering included
  Durations detecting;
  double wall_s = 0;  // all of it, writing included

  uint64_t looked_at() const;
  double detection_rate() const;  // wands of those looked at, 0 without any
  double frames_per_s() const;
};

// For people: counts and rates, then times.
std::string FormatReport(const DetectionReport& report);
// The same as one JSON object, a contract: pictures, damaged, lost, learning, outcomes{word:
// count}, detection_rate, tracked, centres, refused[{reason, count, example}], reading_ms and
// detecting_ms{mean, median, p95}, pictures_per_s, cut_short, passed_share, white_share,
// background_share, resting_wands.
std::string ReportJson(const DetectionReport& report);

}  // namespace rigcal::agent
