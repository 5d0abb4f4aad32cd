// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>

#include "common/session/session.h"
#include "common/time/clock.h"

namespace rigcal::server {

// How one clock of a camera relates to the server's UTC, from the newest of its samples; coarse, as
// for AlignClocks, which decides in a calibration. Memory is bounded.
class ClockRelation {
 public:
  // A sample of another epoch than the one before begins anew. Those of lights say nothing here.
  void AddSample(uint32_t clock_epoch, const ClockSample& sample);
  void AddAlignment(const HostAlignment& alignment);

  // Server UTC minus the camera's time. None: there are no samples.
  std::optional<int64_t> OffsetNs() const;
  // One sigma of a sample about the line through them, seconds. None: fewer than four samples.
  std::optional<double> SpreadS() const;
  // The last jump that the samples show, in words. Empty: none.
  const std::string& jump() const { return jump_; }

 private:
  struct Point {
    double host_s = 0;  // monotonic, since the first sample
    int64_t utc_minus_device_ns = 0;
    int64_t monotonic_minus_device_ns = 0;
    int64_t utc_minus_monotonic_ns = 0;
    double uncertainty_s = 0;
  };
  void NoteJump(const Point& before, const Point& now);

  std::optional<uint32_t> epoch_;
  int64_t first_host_ns_ = 0;
  std::deque<Point> points_;
  std::deque<HostAlignment> alignments_;
  std::string jump_;
};

// All clocks of the session follow one, so that their times can be compared as they are.
bool HaveCommonTimebase(const Session& session);

}  // namespace rigcal::server
