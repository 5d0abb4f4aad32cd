// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/camera/intrinsics.h"
#include "common/geometry/rigid_transform.h"
#include "common/session/session.h"
#include "server/session/monitor_settings.h"

namespace rigcal::server {

// The domain form of rigcal/v1/live.proto, which says what each value means.

// --- The running estimate: made by whoever solves, shown by LiveTracker ---

enum class EstimateState : uint8_t { kWaiting = 1, kReady = 2, kFailed = 3 };

struct LivePairNeed {
  std::string camera_a;
  std::string camera_b;
  uint32_t common_count = 0;
  uint32_t needed_count = 0;
  friend bool operator==(const LivePairNeed&, const LivePairNeed&) = default;
};

struct LiveEstimatedCamera {
  std::string camera;
  RigidTransform cam_from_rig;
  double time_offset_s = 0;  // relative to the median clock
  double time_offset_sigma_s = 0;
  double reprojection_rms_px = 0;
  double focal_length_px = 0;
  bool lens_disagrees = false;
};

struct LiveVolume {
  Eigen::Vector3d origin_m = Eigen::Vector3d::Zero();  // rig frame, as all points here
  double step_m = 0;
  uint32_t count_x = 0;
  uint32_t count_y = 0;
  uint32_t count_z = 0;
  std::vector<float> sigma_mm;        // x fastest, then y; 0: fewer than two cameras see the point
  std::vector<uint32_t> wand_counts;  // as sigma_mm; 0: one step beyond the waved part
  double median_mm = 0;
  double p95_mm = 0;  // what a goal is compared with
  double worst_mm = 0;
  Eigen::Vector3d worst_point_m = Eigen::Vector3d::Zero();
  double scale_sigma_rel = 0;
};

struct LiveFigure {
  double time_s = 0;  // since the session started
  double p95_mm = 0;
};

struct LiveHeldOut {
  double rms_px = 0;
  double expected_rms_px = 0;
  bool agrees = false;
};

struct LiveAdvice {
  std::string text;
  Eigen::Vector3d point_m = Eigen::Vector3d::Zero();
  std::vector<std::string> cameras;
  double expected_p95_mm = 0;
};

// The calibration as it would be if the session ended now. What is beyond the limits of live.proto
// is cut off by LiveTracker::SetEstimate.
struct LiveEstimate {
  std::string session_id;  // the session it was made from; of another one it is not shown
  EstimateState state = EstimateState::kWaiting;
  int64_t time_utc_ns = 0;  // when it was made; 0: there is none yet
  std::string problem;      // kFailed: why
  std::vector<LivePairNeed> needs;
  uint32_t instant_count = 0;
  double solve_duration_s = 0;
  bool scale_known = false;
  bool intrinsics_refined = false;
  std::vector<LiveEstimatedCamera> cameras;  // by name
  std::vector<double> marker_positions_m;
  std::optional<LiveVolume> volume;  // none: not computed
  std::vector<LiveFigure> history;   // oldest first
  std::optional<LiveHeldOut> held_out;
  std::vector<LiveAdvice> advice;       // most useful first
  std::vector<Eigen::Vector3d> wand_m;  // markers at the newest instant, rig frame; empty: unknown
};

// --- Cameras and the rig ---

enum class LiveCameraState : uint8_t { kOffline = 1, kIdle = 2, kCapturing = 3, kEnded = 4 };

struct LiveClock {
  std::optional<double> time_offset_s;  // found by the running estimate
  double time_offset_sigma_s = 0;
  std::optional<double> sample_spread_s;  // one sigma of its clock samples; none: it has none
  uint32_t clock_epoch_count = 0;
  uint32_t wand = 0;       // whose light code the camera has read last; 0: none
  double wand_time_s = 0;  // for which it had been on then
  friend bool operator==(const LiveClock&, const LiveClock&) = default;
};

struct LiveCoverage {
  uint32_t columns = 0;
  uint32_t rows = 0;
  std::string counts;  // one octet per cell, row by row; 255: that many or more
  double covered_share = 0;
  friend bool operator==(const LiveCoverage&, const LiveCoverage&) = default;
};

struct LiveTrailPoint {
  uint32_t age_ms = 0;
  float x0_px = 0;
  float y0_px = 0;
  float x1_px = 0;
  float y1_px = 0;
  friend bool operator==(const LiveTrailPoint&, const LiveTrailPoint&) = default;
};

struct LiveCamera {
  std::string camera;
  std::string agent_id;
  LiveCameraState state = LiveCameraState::kOffline;
  ImageSize image_size_px;
  double observation_rate_hz = 0;
  double wand_rate_hz = 0;
  uint64_t observation_count = 0;
  uint64_t wand_count = 0;
  uint64_t backlog_count = 0;
  uint64_t dropped_count = 0;
  LiveClock clock;
  LiveCoverage coverage;
  std::vector<LiveTrailPoint> trail;  // oldest first
  uint32_t shared_instant_count = 0;
  uint32_t shared_instant_goal = 0;
  double reprojection_rms_px = 0;
  bool has_preview = false;
  friend bool operator==(const LiveCamera&, const LiveCamera&) = default;
};

struct LiveOverlap {
  std::vector<std::string> cameras;
  std::vector<uint32_t> counts = {};  // of the pairs (0,1), (0,2), ..., (1,2), ...
  friend bool operator==(const LiveOverlap&, const LiveOverlap&) = default;
};

enum class AlertSeverity : uint8_t { kInfo = 1, kWarning = 2, kError = 3 };

struct LiveAlert {
  std::string kind;
  AlertSeverity severity = AlertSeverity::kInfo;
  std::string camera;  // empty: the rig or the server
  std::string text;
  int64_t since_utc_ns = 0;
  friend bool operator==(const LiveAlert&, const LiveAlert&) = default;
};

struct LiveAgent {
  std::string agent_id;
  std::string host;
  bool connected = false;
  uint64_t spool_rows = 0;
  uint64_t spool_bytes = 0;
  uint64_t spool_limit_bytes = 0;
  std::string software_version;
  friend bool operator==(const LiveAgent&, const LiveAgent&) = default;
};

struct LiveGoal {
  double until_mm = 0;
  double now_mm = 0;
  bool reached = false;
  std::string why_not;
  friend bool operator==(const LiveGoal&, const LiveGoal&) = default;
};

// --- The monitor: made by whoever compares with the active calibration, shown by LiveTracker ---

enum class MonitorVerdict : uint8_t { kUnknown = 1, kGood = 2, kMoved = 3 };

struct LiveMonitoredCamera {
  std::string camera;
  MonitorVerdict verdict = MonitorVerdict::kUnknown;  // the last one that could be given
  int64_t time_utc_ns = 0;                            // of that; 0: there was none yet
  double translation_m = 0, translation_sigma_m = 0;  // as CameraDifference
  double rotation_rad = 0, rotation_sigma_rad = 0;
  double centre_px = 0, centre_sigma_px = 0;
  double sigmas = 0;
  double time_offset_s = 0, time_offset_sigma_s = 0;  // against the calibration; sigma 0: unknown
  // Of its clock against the others within the session; sigma 0: unknown.
  double clock_change_s = 0, clock_change_sigma_s = 0, clock_change_ppm = 0;
  bool clock_changed = false;  // more than by chance
  friend bool operator==(const LiveMonitoredCamera&, const LiveMonitoredCamera&) = default;
};

enum class MonitorRepairState : uint8_t { kNone = 1, kSolving = 2, kActive = 3, kNotActive = 4 };

struct LiveMonitor {
  MonitorMode mode = MonitorMode::kOff;
  std::string calibration_id;                // the active one; empty: there is none
  std::string session_id;                    // of the last look
  int64_t time_utc_ns = 0;                   // of that; 0: there was none yet
  std::string problem;                       // why the last look could not tell; empty: it could
  bool all_moved = false;                    // which cameras kept their places cannot be told
  std::vector<LiveMonitoredCamera> cameras;  // of the calibration, by name
  MonitorRepairState repair = MonitorRepairState::kNone;  // the last one
  std::string repair_id;                                  // its calibration
  std::string repair_text;                                // what became of it
  friend bool operator==(const LiveMonitor&, const LiveMonitor&) = default;
};

// A part of the state, and the revision at which it last changed.
template <typename Part>
struct Revised {
  std::shared_ptr<const Part> value;  // null: there is none
  uint64_t revision = 0;
};

// The live state of one rig at one time; never changed once it is made.
struct LiveSnapshot {
  std::string incarnation;  // random for each start of the server, and another for each rig
  uint64_t revision = 0;    // grows with each change
  uint64_t full_since = 0;  // who knows an older revision only is told everything
  int64_t time_utc_ns = 0;
  std::string rig;
  double age_s = 0;
  std::map<std::string, Revised<LiveCamera>> cameras;
  std::vector<std::pair<uint64_t, std::string>> removed_cameras;  // with the revision of its going
  Revised<SessionSummary> session;
  Revised<LiveOverlap> overlap;
  Revised<LiveEstimate> estimate;
  Revised<std::vector<LiveAlert>> alerts;
  Revised<std::vector<LiveAgent>> agents;
  Revised<LiveGoal> goal;
  Revised<LiveMonitor> monitor;
};

}  // namespace rigcal::server
