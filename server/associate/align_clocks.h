// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "common/status/refusal.h"
#include "common/time/clock_course.h"
#include "server/associate/camera_track.h"
#include "server/associate/clean_track.h"
#include "server/associate/stamp_fault.h"

namespace rigcal::server {

// A track on the common time scale.
struct AlignedTrack {
  CleanTrack track;
  int64_t clock_offset_ns = 0;  // of the clock: rig time minus camera time, coarse
  int64_t latency_ns = 0;       // of the camera: rig time is camera time + offset - latency
  double offset_sigma_s = 0;    // one sigma of the coarse offset; 0 within one time base
  // The wand whose light code relates the clock to those of all tracks of the session with the same
  // number here; 0: none does.
  uint32_t wand = 0;
  double period_s = 0;  // median time between rows; 0 with fewer than two
  // Of the camera's frames: less than period_s where most frames have no row. 0: as period_s.
  double frame_period_s = 0;
  // Of static points (static_points.h): times are made up, and no clock has to do with them.
  bool is_static = false;
  std::vector<int> static_points;  // by row, the point that it shows; empty: each row shows all

  double FramePeriodS() const { return frame_period_s > 0 ? frame_period_s : period_s; }
  ClockCourseLine clock_course;  // where the clock jumped or drifted, as found by a solve

  // Of a moment of the camera's clock.
  int64_t CoarseRigTimeNs(int64_t camera_time_ns) const {
    const auto course_ns =
        static_cast<int64_t>(std::llround(1e9 * ClockCourseOffsetS(clock_course, camera_time_ns)));
    return camera_time_ns + clock_offset_ns - latency_ns + course_ns;
  }
};

// Chooses for each camera and session the clock epochs that can be solved, and aligns them.
//
// Within a session whose clocks follow one time base, every epoch keeps offset 0: StraightenClocks
// has seen to it that they can; those that count from another beginning are brought beside the
// others (far_clocks.h). In any other session rig time is the
// server's UTC: an epoch of a clock with samples gets the median of host UTC minus device time,
// plus the host's own alignment with the server. Everything else is rejected and counted as
// `clock_epoch_without_offset`. Epochs that have read a wand's light code are related by it
// (RelateByLight), whatever else is known. Clocks are identified by clock_id, so that cameras on
// one clock share its samples. The order of `clean` is kept.
std::vector<AlignedTrack> AlignClocks(const std::vector<CameraTrack>& tracks,
                                      std::vector<CleanTrack> clean, RefusalCounter* refused,
                                      std::vector<StampFault>* faults = nullptr);

}  // namespace rigcal::server
