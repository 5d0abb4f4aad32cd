// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "common/session/session.h"
#include "server/live/alert_rules.h"
#include "server/live/arrivals.h"
#include "server/live/coverage_grid.h"
#include "server/live/live_state.h"
#include "server/live/row_spacing.h"

namespace rigcal::server {

// What one camera does in the live session, from what arrives of it. Memory is bounded. Times are
// those of the server's steady clock where they are not the camera's.
class CameraActivity {
 public:
  using Time = std::chrono::steady_clock::time_point;

  CameraActivity(CameraDescription description, Target target, Time now);

  // Counts of what was stored before the tracker began.
  void SetStored(const SessionCameraCounts& counts);
  void Add(uint32_t stream_epoch, const Arrivals& arrivals, Time now);
  // What it has covered in earlier waves.
  void AddCoverage(const CoverageGrid& earlier) { coverage_.Add(earlier); }
  // Time between its rows in earlier waves, until it is known from its own.
  void SetEarlierSpacing(const RowSpacing& earlier);
  // Forgets what is too old. Before the others below, once for each state that is made.
  void Advance(Time now);
  // Others see the wand now; call it once for each state that is made.
  void NoteWaving(bool others_see_wand, Time now);

  bool sees_wand(Time now) const;
  bool ended() const;
  // How much later than its own time a row of it arrives, seconds, where rows come at the pace of
  // their times; relative to whatever its clock counts from. None: not known, or it catches up.
  std::optional<double> ArrivalDelayS() const;
  // Time between rows that were kept, seconds; at least that of thinning.
  double SpacingS() const { return spacing_.Seconds(); }
  size_t stream_count() const { return streams_.size(); }
  // Of the newest row; the camera's clock.
  std::optional<int64_t> newest_row_ns() const { return newest_row_ns_; }
  uint32_t clock_epoch() const { return last_epoch_; }

  // All that this knows; the rest stays as it is.
  void Describe(Time now, LiveCamera* camera) const;
  void Describe(Time now, CameraFacts* facts) const;

 private:
  struct Interval {
    Time time;
    uint64_t observations = 0;
    uint64_t wands = 0;
  };
  struct TrailPoint {
    Time time;
    float x0, y0, x1, y1;
  };
  struct RowCheck {
    Time time;
    bool jumped = false;
    bool comparable = false;
    bool implausible = false;
    bool shaped = false;  // enough markers to say
  };
  struct Pace {
    Time time;
    int64_t row_ns = 0;
  };
  struct Tally {
    Time time;
    uint64_t dropped = 0;
    uint64_t refused = 0;
    uint64_t backlog = 0;
    std::optional<DetectionCounts> detections = {};
  };
  struct Stream {
    bool complete = false;
    std::optional<CameraReport> report;
    uint64_t dropped_count = 0;  // in batches
    uint32_t durable_seq = 0;    // everything up to here is stored
    uint64_t kept_count = 0;     // of the report's rows, those that are stored already
  };

  void AddRow(const ThinnedRow& row, Time time);
  void AddTrail(const ThinnedRow& row, Time time);
  RowCheck Check(const ThinnedRow& row, Time time) const;
  bool IsImplausible(const ThinnedRow& row) const;
  uint64_t dropped_count() const;
  // Rows that the agent has and the server does not. What a spool keeps longer than until the
  // server has it (SpoolConfig::DurableOn::kStandby) does not wait.
  uint64_t backlog_count() const;
  double Rate(uint64_t Interval::*count, Time now) const;

  const CameraDescription description_;
  const Target target_;
  const Time start_;

  uint64_t observation_count_ = 0;
  uint64_t wand_count_ = 0;
  uint64_t refused_count_ = 0;
  std::map<uint32_t, Stream> streams_;
  std::vector<uint32_t> clock_epochs_;
  std::deque<Interval> intervals_;
  std::optional<Time> rate_begin_;  // from here on intervals_ hold everything
  std::optional<Time> first_row_;
  std::optional<Time> last_row_;
  std::optional<Time> last_wand_;
  double usual_rate_hz_ = 0;
  CoverageGrid coverage_;
  std::deque<TrailPoint> trail_;
  std::deque<RowCheck> checks_;
  std::optional<ThinnedRow> last_wand_row_;
  RowSpacing spacing_;
  std::optional<int64_t> newest_row_ns_;
  uint32_t last_epoch_ = 0;
  std::deque<Pace> paces_;
  std::deque<Tally> tallies_;
  double unseen_waving_s_ = 0;
  std::optional<Time> last_noted_;
};

}  // namespace rigcal::server
