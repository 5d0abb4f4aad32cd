// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "absl/status/status.h"
#include "agent/detect/frame/wand_detector.h"
#include "tests/accuracy/detection/detection_options.h"

namespace rigcal::accuracy {

// One detected marker, against ground truth.
struct CentreError {
  Eigen::Vector2d error_px = Eigen::Vector2d::Zero();
  double nees = 0;  // e^T C^-1 e, of 2 degrees of freedom
  Eigen::Vector2d true_px = Eigen::Vector2d::Zero();
  Eigen::Vector2d motion = Eigen::Vector2d::Zero();  // unit, in the image; zero without motion
  double distance_m = 0;
  double radial_px = 0;        // of the error, away from the image centre
  double image_radius_px = 0;  // of the true centre, from the image centre
};

struct ImageResult {
  absl::Status status;
  bool has_wand = false;    // the frame shows a wand, or parts of one
  bool shown = false;       // the frame shows a fully visible wand that is lit
  bool lit = true;          // by its LEDs, which add half the room's light on it or more
  bool found = false;       // and it was found, all markers within 1 px
  bool false_wand = false;  // a wand where there is none, off by more than 3 px, or flipped
  DetectionOutcome outcome = DetectionOutcome::kNoBlob;
  // Markers of which nearly all is to be seen, in a wand with two or more of them; and of those the
  // ones that were found within 1 px and with the right label.
  int visible_markers = 0;
  int found_markers = 0;
  int covered_markers = 0;
  double confidence = 0;
  double milliseconds = 0;  // CPU time of Detect
  uint64_t seed = 0;
  double tilt_deg = 0, distance_m = 0;
  std::vector<CentreError> centres;
};

std::vector<ImageResult> RunDetection(const DetectionOptions& options);

struct DetectionSummary {
  int failures = 0, shown = 0, found = 0, false_wands = 0, frames = 0;
  int empty_frames = 0, false_in_empty = 0;  // without a wand
  int unlit = 0;                             // with a wand whose LEDs are dark
  int visible_markers = 0, found_markers = 0;
  double rms_px = 0;          // of each coordinate
  double bias_px = 0;         // length of the mean error
  double motion_bias_px = 0;  // mean error along the motion
  double nees = 0;            // per degree of freedom
  double median_ms = 0;
  double worst_ms = 0;
};
DetectionSummary Summarise(const std::vector<ImageResult>& results);

// Mean radial error of the centres in a bin; none of fewer than `count`.
struct RadialBin {
  double distance_m = 0, image_radius_px = 0;  // upper ends
  int count = 0;
  double mean_px = 0;
  double sigma_px = 0;  // of the mean
};
std::vector<RadialBin> RadialBins(const std::vector<ImageResult>& results);

}  // namespace rigcal::accuracy
