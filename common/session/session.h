// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "common/camera/camera_description.h"
#include "common/session/stream_key.h"
#include "common/status/refusal.h"
#include "common/target/target.h"

namespace rigcal {

enum class SessionState : uint8_t { kCreated = 1, kCapturing = 2, kDraining = 3, kFinished = 4 };

// A camera of a session, with its description as it was when the session started.
struct SessionCamera {
  CameraDescription description;
  std::string agent_id;  // empty: described by hand, delivered without an agent
};

// When a session ends by itself: see SessionGoal in rigcal/v1/session.proto.
struct SessionGoal {
  static constexpr double kDefaultMinDurationS = 20;
  static constexpr double kMaxMinDurationS = 86400;
  static constexpr double kMaxUntilMm = 1000;

  double until_mm = 0;
  double min_duration_s = kDefaultMinDurationS;

  friend bool operator==(const SessionGoal&, const SessionGoal&) = default;
};

// One wave: owns its target, its camera list and (in the store) its observations.
struct Session {
  std::string id;
  std::string rig;
  std::string title;
  SessionState state = SessionState::kCreated;
  Target target;
  std::vector<std::string> requested_cameras;  // empty: all that are connected at the start
  std::vector<SessionCamera> cameras;          // sorted by name; fixed from the start on
  int64_t create_utc_ns = 0;
  int64_t start_utc_ns = 0;  // 0: has not happened, as for those below
  int64_t stop_utc_ns = 0;
  int64_t finish_utc_ns = 0;
  int64_t drain_deadline_utc_ns = 0;
  std::vector<std::string> missing_cameras;  // had not ended when the session finished
  int64_t observations_delete_utc_ns = 0;    // deleted by the retention; 0: still there
  std::optional<SessionGoal> goal = {};      // none: it ends when somebody stops it
  std::string stop_reason = {};              // empty: a person stopped it, or nobody
  std::string continues = {};                // id of the session it goes on with; empty: none
  int64_t discard_utc_ns = 0;                // discarded, its data retained; 0: it was not

  const SessionCamera* FindCamera(std::string_view camera) const {
    for (const SessionCamera& candidate : cameras) {
      if (candidate.description.camera == camera) return &candidate;
    }
    return nullptr;
  }
};

// A session as lists show it.
struct SessionSummary {
  Session session;  // without its cameras, the requested and the missing ones
  uint32_t camera_count = 0;
  uint64_t observation_count = 0;  // sums over the cameras, as in SessionCameraCounts
  uint64_t wand_count = 0;
  uint64_t late_count = 0;
  // Why the stored record cannot be read; only id, rig, state and counts are filled then.
  std::string damage = {};
};

// How much of one stream is on disk.
struct StreamStatus {
  uint32_t stream_epoch = 1;
  uint32_t durable_seq = 0;
  std::optional<uint32_t> last_seq;  // once the end of capture has come
  uint32_t reported_seq = 0;         // last number as the agent reported it; 0: not yet
  bool end_is_unknown = false;       // SpoolReport::end_is_unknown, as the agent reported it

  bool ended() const { return last_seq.has_value() && durable_seq >= *last_seq; }
};

struct ClockEpochCount {
  uint32_t clock_epoch = 0;
  uint64_t observation_count = 0;
};

// Counts of one camera of a session in the store.
struct SessionCameraCounts {
  std::string camera;
  uint64_t observation_count = 0;  // empty and late ones included, refused ones not
  uint64_t wand_count = 0;         // with at least one visible marker
  uint64_t late_count = 0;
  std::vector<ClockEpochCount> clock_epochs;
  std::vector<StreamStatus> streams;  // by stream_epoch
  std::vector<Refusal> refused;       // by ingest, and as the agent's reports say
  // Of all streams, as the agent's reports say; none: nothing was reported.
  std::optional<FrameCounts> frames = {};
  std::optional<DetectionCounts> detections = {};

  // There are streams, and all of them have ended. An agent that was killed leaves one that has
  // not, until it has delivered it.
  bool ended() const {
    return !streams.empty() &&
           std::ranges::all_of(streams, [](const StreamStatus& stream) { return stream.ended(); });
  }
};

}  // namespace rigcal
