// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

namespace rigcal {

// The clock that stamps a camera's observations. Several cameras may share one. For a clock and
// epoch
//   rig_time = camera_time + time_offset + time_rate * (camera_time - time_epoch)
// so a camera whose rows show an earlier instant than their stamps say has a negative offset. Where
// it jumped or drifted, its course is added (clock_course.h).
struct Clock {
  std::string clock_id;
  // Name of a time base this clock already follows to within a second ("recording", "ptp"). Empty:
  // it counts from an origin of its own, and clock samples relate it to the others.
  std::string timebase;

  friend bool operator==(const Clock&, const Clock&) = default;
};

// Values of ClockSample::light: the camera's PC was read; 1 to kMaxWandNumber: the wand of that
// number (light_code.h); lamps on the mains.
inline constexpr uint32_t kNoLight = 0, kMaxWandNumber = 8, kLamps = 100;

// A camera's clock, read together with those of its PC, or with a light that the camera sees.
struct ClockSample {
  int64_t device_ns = 0;
  int64_t host_monotonic_ns = 0;  // 0 where a light was read
  int64_t host_utc_ns = 0;        // likewise
  uint32_t uncertainty_ns = 0;    // one sigma of the time of reading; 0 = not known (1 ms assumed)
  uint32_t light = kNoLight;
  // Of a wand: the time since it began to blink, by its own clock. Of lamps: their period; the
  // camera's clock was read where one began.
  int64_t light_ns = 0;

  bool IsOfHost() const { return light == kNoLight; }
  bool IsOfWand() const { return light >= 1 && light <= kMaxWandNumber; }

  friend bool operator==(const ClockSample&, const ClockSample&) = default;
};

// Difference between the server's UTC and an agent's, measured by a ping on the stream.
struct HostAlignment {
  int64_t host_monotonic_ns = 0;
  int64_t server_minus_host_ns = 0;
  uint32_t uncertainty_ns = 0;  // half the round trip

  friend bool operator==(const HostAlignment&, const HostAlignment&) = default;
};

// Gives each stamp of one camera, in capture order, its clock epoch: a new one whenever the clock
// steps backwards. Equal times stay in the epoch (they are duplicates, not a step).
class ClockEpochCounter {
 public:
  uint32_t EpochOf(int64_t time_ns) {
    if (!first_ && time_ns < last_ns_) ++epoch_;
    first_ = false;
    last_ns_ = time_ns;
    return epoch_;
  }

 private:
  bool first_ = true;
  int64_t last_ns_ = 0;
  uint32_t epoch_ = 0;
};

}  // namespace rigcal
