// SPDX-License-Identifier: Apache-2.0
#include "server/live/earlier_waves.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <vector>

#include "common/status/status_macros.h"
#include "server/live/arrivals.h"
#include "server/live/clock_relation.h"

namespace rigcal::server {
namespace {

constexpr size_t kMaxEarlierSessions = 64;
// Of one session, 5.8 hours; what is later is not counted as common.
constexpr int64_t kMaxEarlierSteps = 1 << 20;
// Cameras begin and end so much earlier or later than the session, and clocks are so far off.
constexpr int64_t kMarginNs = 60'000'000'000;

bool IsSameCamera(const CameraDescription& a, const CameraDescription& b) {
  return a.image_size_px == b.image_size_px && a.intrinsics == b.intrinsics;
}

// Reads one session.
class EarlierReader {
 public:
  EarlierReader(const EarlierWaves& waves, const Session& source, const EarlierRowTap& tap,
                EarlierCounts* counts)
      : waves_(waves),
        source_(source),
        tap_(tap),
        counts_(*counts),
        common_timebase_(HaveCommonTimebase(source)),
        overlap_(waves.session.cameras.size(), StepCount(source, waves.now_utc_ns)) {}
  ~EarlierReader() { counts_.overlap.Add(overlap_); }
  EarlierReader(const EarlierReader&) = delete;
  EarlierReader& operator=(const EarlierReader&) = delete;

  // In the order of Store::ReadObservations.
  void Take(StoredBatch stored) {
    if (stored.damaged_rows > 0 || stored.late) return;
    const StreamKey stream = stored.batch.stream;
    if (stream != stream_) Begin(stream);
    if (source_camera_ == nullptr || own_ == waves_.session.cameras.end()) return;
    for (ObservationBatch batch : AcceptedRows(std::move(stored))) {
      if (batch.rows() > 0 && batch.end_seq() - 1 > until_seq_) {
        if (batch.first_seq > until_seq_) continue;
        batch = batch.Slice(0, until_seq_ + 1 - batch.first_seq);
      }
      if (tap_) tap_(*source_camera_, batch);
      Count(batch);
    }
  }

 private:
  static size_t StepCount(const Session& source, int64_t now_utc_ns) {
    const int64_t end_ns = source.stop_utc_ns != 0 ? source.stop_utc_ns : now_utc_ns;
    const int64_t span_ns = std::max<int64_t>(0, end_ns - source.start_utc_ns) + 2 * kMarginNs;
    return static_cast<size_t>(std::min(span_ns / OverlapCounter::kStepNs, kMaxEarlierSteps));
  }

  void Begin(const StreamKey& stream) {
    stream_ = stream;
    const auto& cameras = waves_.session.cameras;
    source_camera_ = source_.FindCamera(stream.camera);
    own_ = std::ranges::find(
        cameras, stream.camera,
        [](const SessionCamera& camera) -> auto& { return camera.description.camera; });
    if (source_camera_ != nullptr && own_ != cameras.end() &&
        !IsSameCamera(source_camera_->description, own_->description)) {
      own_ = cameras.end();
    }
    until_seq_ = kMaxSeq;
    if (source_.id == waves_.session.id) {
      const auto until = waves_.own_until.find({stream.camera, stream.stream_epoch});
      until_seq_ = until == waves_.own_until.end() ? 0 : until->second;
    }
    thinner_ = {};
    spacing_ = {};
  }

  // Rig time minus camera time.
  std::optional<int64_t> OffsetNs() const {
    std::optional<int64_t> offset_ns;
    if (common_timebase_) {
      offset_ns = 0;
    } else if (const auto clock = clocks_.find(source_camera_->description.clock.clock_id);
               clock != clocks_.end()) {
      offset_ns = clock->second.OffsetNs();
    }
    if (offset_ns) *offset_ns -= std::llround(source_camera_->description.latency_s * 1e9);
    return offset_ns;
  }

  void Count(const ObservationBatch& batch) {
    ClockRelation& clock = clocks_[source_camera_->description.clock.clock_id];
    for (const ClockSample& sample : batch.clock_samples) {
      clock.AddSample(batch.clock_epoch, sample);
    }
    for (const HostAlignment& alignment : batch.host_alignments) clock.AddAlignment(alignment);
    const std::optional<int64_t> offset_ns = OffsetNs();
    CoverageGrid& coverage = counts_.coverage[stream_.camera];
    std::vector<size_t> kept;
    for (size_t i = 0; i < batch.rows(); ++i) {
      if (!thinner_.Keep(batch.clock_epoch, batch.time_ns[i])) continue;
      kept.push_back(i);
      spacing_.Add(batch.time_ns[i]);
    }
    if (!spacing_.empty()) counts_.spacing[stream_.camera] = spacing_;
    const auto half_ns = static_cast<int64_t>(0.5e9 * spacing_.Seconds());
    for (const size_t i : kept) {
      if (batch.visible_mask[i] == 0) continue;
      coverage.Add(ThinnedRowOf(batch, i), own_->description.image_size_px);
      if (offset_ns) CountOverlap(batch.time_ns[i] + *offset_ns, half_ns);
    }
  }

  void CountOverlap(int64_t time_ns, int64_t half_ns) {
    // Times of a common time base count from anything. One wrong clock must not hide the rest.
    if (!begin_ns_) begin_ns_ = (common_timebase_ ? time_ns : source_.start_utc_ns) - kMarginNs;
    const int64_t since_ns = time_ns - *begin_ns_;
    if (since_ns < 0 || since_ns >= kMaxEarlierSteps * OverlapCounter::kStepNs) return;
    overlap_.Add(static_cast<size_t>(own_ - waves_.session.cameras.begin()), time_ns - half_ns,
                 time_ns + half_ns);
  }

  const EarlierWaves& waves_;
  const Session& source_;
  const EarlierRowTap& tap_;
  EarlierCounts& counts_;
  const bool common_timebase_;
  OverlapCounter overlap_;
  std::map<std::string, ClockRelation> clocks_;
  std::optional<int64_t> begin_ns_;
  // Of the stream that is being read.
  StreamKey stream_;
  const SessionCamera* source_camera_ = nullptr;
  std::vector<SessionCamera>::const_iterator own_ = waves_.session.cameras.end();
  uint32_t until_seq_ = 0;
  RowThinner thinner_;
  RowSpacing spacing_;
};

// This session and those it continues, oldest first.
std::vector<Session> ChainOf(const Store& store, const EarlierWaves& waves) {
  std::vector<Session> chain;
  std::set<std::string> ids = {waves.session.id};
  if (!waves.own_until.empty()) chain.push_back(waves.session);
  std::string earlier = waves.session.continues;
  while (!earlier.empty() && ids.insert(earlier).second && ids.size() <= kMaxEarlierSessions) {
    absl::StatusOr<Session> session = store.GetSession(earlier);
    if (!session.ok()) {
      // A calibration goes without a deleted one, too.
      spdlog::info("session {}: continues without {}: {}", waves.session.id, earlier,
                   std::string(session.status().message()));
      break;
    }
    earlier = session->continues;
    chain.push_back(*std::move(session));
  }
  std::ranges::reverse(chain);
  return chain;
}

}  // namespace

absl::StatusOr<EarlierCounts> ReadEarlierWaves(const Store& store, const EarlierWaves& waves,
                                               const std::atomic<bool>& cancelled,
                                               const EarlierRowTap& tap) {
  EarlierCounts counts{.session_id = waves.session.id,
                       .coverage = {},
                       .overlap = OverlapCounter(waves.session.cameras.size(), 1),
                       .spacing = {}};
  for (const Session& source : ChainOf(store, waves)) {
    EarlierReader reader(waves, source, tap, &counts);
    const absl::Status read =
        store.ReadObservations(source.id, "", [&](StoredBatch stored) -> absl::Status {
          if (cancelled) return absl::CancelledError("the server ends");
          reader.Take(std::move(stored));
          return absl::OkStatus();
        });
    if (absl::IsCancelled(read)) return read;
    if (!read.ok()) {
      spdlog::warn("session {}: the rows of {} are not all in the live state: {}", waves.session.id,
                   source.id, std::string(read.message()));
    }
  }
  return counts;
}

}  // namespace rigcal::server
