// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "absl/status/status.h"
#include "agent/detect/event/blink_filter.h"
#include "agent/detect/event/blink_wand_counts.h"
#include "common/camera/camera_description.h"
#include "common/simulation/events/event_render_options.h"
#include "common/simulation/frames/frame_render_options.h"
#include "common/target/target.h"
#include "tests/accuracy/detection/random_wand_pose.h"
#include "tests/testing/event_disturbance.h"

namespace rigcal::accuracy {

// Streams of a wand that moves through the image of a simulated event camera, or of none, encoded
// as EVT 3.0, decoded and filtered.
struct EventDetectionOptions {
  CameraDescription camera;  // with intrinsics
  Target target;
  FrameRenderOptions scene;
  EventRenderOptions sensor;
  RandomWandPoseOptions pose;   // speed_m_s is drawn from 0 to pose.speed_m_s for each stream
  double min_speed_share = 0;   // of pose.speed_m_s: from that on
  double max_speed_px_s = 1e9;  // slower where the wand would move faster in the image
  agent::BlinkFilterOptions filter;
  bool with_wand = true;
  // One sphere cannot be seen in the second half of the stream; which one goes by the seed.
  bool hide_one = false;
  // An end of the wand is on the image's border in the middle of the stream.
  bool at_border = false;
  // Another wand of the same frequency, LEDs of its own, crosses the first one's way.
  bool second_wand = false;
  testing::EventDisturbance disturbance;  // of the stream; its seed goes by the stream's
  double band_rel = 0.15;                 // of the wand detector
  bool textbook = false;                  // run TextbookChain too
  int streams = 20;
  double warm_up_s = 0.03;  // before the first output
  int outputs = 10;         // of each stream
  double output_hz = 50;
  uint32_t seed = 1;
  int threads = 2;
};

// 1280x720, the wand of the paper, 5 Mev/s of background noise, bars and lamps.
EventDetectionOptions PaperEventDetection();

// A marker at an output.
struct EventCentre {
  bool found = false;  // a blob within 3 px of the true centre at the blob's own time
  Eigen::Vector2d error_px = Eigen::Vector2d::Zero();
  Eigen::Vector2d velocity_px_s = Eigen::Vector2d::Zero();
  Eigen::Matrix2d covariance_px2 = Eigen::Matrix2d::Identity();  // as stated; of wands only
  double distance_m = 0;
  double radius_px = 0;
};

struct EventOutput {
  uint64_t seed = 0;
  bool shown = false;                // the wand is fully within the image
  bool found = false;                // all its markers are
  int false_blobs = 0;               // more than 3 px away from every marker
  int textbook_markers = 0;          // with a blob of TextbookChain in them
  std::vector<EventCentre> centres;  // by marker
};

// The detections of agent::BlinkWandDetector in a stream, after the warm-up.
struct EventWands {
  int detections = 0;
  int shown = 0;        // the wand was fully within the image at the time of the detection
  int found = 0;        // and all its markers are within 3 px
  int false_wands = 0;  // a marker further away, or a wand where there is none
  int ambiguous = 0;    // refused: several wands
  // Spheres seen whole, of wands with two or more of these, and those of them that were delivered.
  int spheres_shown = 0, spheres_found = 0;
  std::vector<EventCentre> centres;
};

struct EventStreamResult {
  absl::Status status;
  EventWands wands;
  agent::BlinkWandCounts counts;
  uint64_t events = 0;
  double rendered_s = 0, render_wall_s = 0;  // simulated, and the time it took
  std::vector<EventOutput> outputs;
};

std::vector<EventStreamResult> RunEventDetection(const EventDetectionOptions& options);

// Selects centres of the detector.
struct EventCentreRange {
  double min_radius_px = 0, max_radius_px = 1e9;
  double min_px_s = 0, max_px_s = 1e9;
};

// Normalised errors squared along and across the motion (x and y if stationary), each 1 in the mean
// if the stated covariance is right.
struct EventCentreErrors {
  int centres = 0;
  double rms_px = 0;  // of each coordinate
  double nees_along = 0, nees_across = 0;
};
EventCentreErrors CentreErrorsOf(const std::vector<EventStreamResult>& results,
                                 const EventCentreRange& range);
// By which the times of the detector's centres are later than the light's: mean of error along the
// motion over speed.
double WandLatencyUs(const std::vector<EventStreamResult>& results);

struct EventDetectionSummary {
  int failures = 0, outputs = 0, shown = 0, found = 0;
  int markers = 0, markers_found = 0, false_blobs = 0;
  int textbook_found = 0;     // of `shown`, with a blob of TextbookChain in every marker
  double latency_us = 0;      // of blobs: mean of error along the motion over speed
  double rms_px = 0;          // of each coordinate, with that latency subtracted
  double raw_rms_px = 0;      // without that
  double motion_bias_px = 0;  // mean error along the motion at 450 to 650 px/s, latency subtracted
  int motion_centres = 0;     // in that mean
  int detections = 0, wands_shown = 0, wands_found = 0, false_wands = 0;  // of the detector
  int ambiguous = 0, spheres_shown = 0, spheres_found = 0;                // likewise
  EventCentreErrors wands;     // of its centres, with nothing subtracted
  double wand_latency_us = 0;  // of the same centres
  double mev_per_s = 0;        // events of a second of the streams
  double render_ratio = 0;     // wall time over simulated time, one thread
};
EventDetectionSummary Summarise(const std::vector<EventStreamResult>& results);

}  // namespace rigcal::accuracy
