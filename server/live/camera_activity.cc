// SPDX-License-Identifier: Apache-2.0
#include "server/live/camera_activity.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

#include "common/statistics/robust_statistics.h"

namespace rigcal::server {
namespace {

using std::chrono::duration;
using std::chrono::duration_cast;
using std::chrono::milliseconds;
using std::chrono::nanoseconds;
using std::chrono::seconds;

constexpr seconds kRateWindow{2};
constexpr double kShortestRateWindowS = 0.5;
constexpr seconds kTrailWindow{2};
constexpr size_t kMaxTrail = 40;
constexpr milliseconds kTrailSpacing{50};
constexpr seconds kCheckWindow{4};
constexpr size_t kMaxChecks = 400;
constexpr size_t kFewestChecks = 20;
constexpr seconds kTallyWindow{10};
constexpr size_t kMaxTallies = 128;
constexpr milliseconds kTallySpacing{250};
constexpr seconds kPaceWindow{3};
constexpr double kShortestPaceS = 1.0;
constexpr size_t kMaxPaces = 64;
constexpr size_t kMaxEpochs = 64;
constexpr size_t kMaxStreams = 64;
constexpr seconds kSeesWand{1};
// A wand that moves so far in the image between two rows, which are at most so far apart, is
// another one: ten image widths a second.
constexpr double kJumpShare = 0.15;
constexpr double kLongestStepS = 0.06;
constexpr double kBentShare = 0.05;
constexpr double kBentPx = 4;
constexpr double kWrongPlaceShare = 0.3;

double Seconds(std::chrono::steady_clock::duration time) { return duration<double>(time).count(); }

bool Visible(const ThinnedRow& row, uint32_t marker) {
  return (row.visible_mask >> marker & 1U) != 0;
}

template <typename Entry>
void ForgetBefore(std::chrono::steady_clock::time_point time, std::deque<Entry>* entries) {
  while (!entries->empty() && entries->front().time < time) entries->pop_front();
}

template <typename Entry>
void ForgetBeyond(size_t count, std::deque<Entry>* entries) {
  while (entries->size() > count) entries->pop_front();
}

uint64_t CountOf(const std::vector<Refusal>& refusals) {
  uint64_t count = 0;
  for (const Refusal& refusal : refusals) count += refusal.count;
  return count;
}

// The share of the images from `before` to `after` with one of these outcomes.
double ShareOf(const DetectionCounts& before, const DetectionCounts& after,
               std::initializer_list<DetectionOutcome> outcomes) {
  uint64_t all = 0;
  uint64_t with = 0;
  for (const DetectionOutcome outcome : kDetectionOutcomes) {
    if (after.Of(outcome) < before.Of(outcome)) return 0;  // another stream
    const uint64_t count = after.Of(outcome) - before.Of(outcome);
    all += count;
    if (std::ranges::find(outcomes, outcome) != outcomes.end()) with += count;
  }
  return all == 0 ? 0 : static_cast<double>(with) / static_cast<double>(all);
}

// Most of a camera's JSON are the points of its trail: a tenth of a pixel is enough to draw them.
float ToTenth(float px) { return std::round(10 * px) / 10; }

}  // namespace

CameraActivity::CameraActivity(CameraDescription description, Target target, Time now)
    : description_(std::move(description)), target_(std::move(target)), start_(now) {}

void CameraActivity::SetStored(const SessionCameraCounts& counts) {
  observation_count_ = counts.observation_count;
  wand_count_ = counts.wand_count;
  for (const ClockEpochCount& epoch : counts.clock_epochs) {
    if (clock_epochs_.size() < kMaxEpochs) clock_epochs_.push_back(epoch.clock_epoch);
  }
  for (const StreamStatus& stream : counts.streams) {
    if (streams_.size() >= kMaxStreams) break;
    streams_[stream.stream_epoch].complete = stream.ended();
    streams_[stream.stream_epoch].durable_seq = stream.durable_seq;
  }
}

void CameraActivity::Add(uint32_t stream_epoch, const Arrivals& arrivals, Time now) {
  while (streams_.size() >= kMaxStreams && !streams_.contains(stream_epoch)) {
    streams_.erase(streams_.begin());
  }
  Stream& stream = streams_[stream_epoch];
  stream.complete = arrivals.complete;
  stream.dropped_count += arrivals.dropped_count;
  stream.durable_seq = std::max(stream.durable_seq, arrivals.durable_seq);
  if (arrivals.report) {
    stream.report = arrivals.report;
    const uint32_t freed = stream.report->spool ? stream.report->spool->acknowledged_seq : 0;
    stream.kept_count = stream.durable_seq - std::min(stream.durable_seq, freed);
  }
  observation_count_ += arrivals.stored_count;
  wand_count_ += arrivals.wand_count;
  refused_count_ += arrivals.refused_count;
  if (arrivals.stored_count > 0) {
    intervals_.push_back({now, arrivals.stored_count, arrivals.wand_count});
    if (!first_row_) first_row_ = now;
    last_row_ = now;
  }
  if (arrivals.wand_count > 0) {
    last_wand_ = now;
    unseen_waving_s_ = 0;
  }
  if (arrivals.has_rows) {
    if (std::ranges::find(clock_epochs_, arrivals.clock_epoch) == clock_epochs_.end() &&
        clock_epochs_.size() < kMaxEpochs) {
      clock_epochs_.push_back(arrivals.clock_epoch);
    }
    if (arrivals.clock_epoch != last_epoch_) {
      paces_.clear();
      spacing_.Restart();
    }
    last_epoch_ = arrivals.clock_epoch;
    newest_row_ns_ = arrivals.newest_row_ns;
    paces_.push_back({arrivals.last_time, arrivals.newest_row_ns});
    ForgetBeyond(kMaxPaces, &paces_);
  }
  for (const ThinnedRow& row : arrivals.rows) {
    // As long before its delivery as it is before the newest row.
    const int64_t before_ns = std::clamp<int64_t>(arrivals.newest_row_ns - row.time_ns, 0,
                                                  nanoseconds(kTrailWindow).count());
    AddRow(row, arrivals.last_time - nanoseconds(before_ns));
  }
}

void CameraActivity::SetEarlierSpacing(const RowSpacing& earlier) {
  if (!spacing_.empty()) return;
  spacing_ = earlier;
  spacing_.Restart();
}

void CameraActivity::AddRow(const ThinnedRow& row, Time time) {
  spacing_.Add(row.time_ns);
  if (row.visible_mask == 0) return;
  checks_.push_back(Check(row, time));
  ForgetBeyond(kMaxChecks, &checks_);
  last_wand_row_ = row;
  coverage_.Add(row, description_.image_size_px);
  AddTrail(row, time);
}

void CameraActivity::AddTrail(const ThinnedRow& row, Time time) {
  if (!trail_.empty() && time < trail_.back().time + kTrailSpacing) return;
  const auto first = static_cast<uint32_t>(std::countr_zero(row.visible_mask));
  const auto last = static_cast<uint32_t>(31 - std::countl_zero(row.visible_mask));
  if (last >= row.marker_count) return;
  trail_.push_back({time, row.x_px[first], row.y_px[first], row.x_px[last], row.y_px[last]});
  ForgetBeyond(kMaxTrail, &trail_);
}

CameraActivity::RowCheck CameraActivity::Check(const ThinnedRow& row, Time time) const {
  RowCheck check{.time = time};
  check.shaped = std::popcount(row.visible_mask) >= 3;
  check.implausible = check.shaped && IsImplausible(row);
  if (!last_wand_row_ || last_wand_row_->clock_epoch != row.clock_epoch) return check;
  const double step_s = 1e-9 * static_cast<double>(row.time_ns - last_wand_row_->time_ns);
  const uint32_t both = row.visible_mask & last_wand_row_->visible_mask;
  const int needed = target_.marker_count() > 1 ? 2 : 1;
  check.comparable = step_s > 0 && step_s <= kLongestStepS && std::popcount(both) >= needed;
  check.jumped = check.comparable;
  // One marker may be an outlier; all of them are another wand.
  for (uint32_t m = 0; m < row.marker_count && check.jumped; ++m) {
    if ((both >> m & 1U) == 0) continue;
    const double moved_px =
        std::hypot(row.x_px[m] - last_wand_row_->x_px[m], row.y_px[m] - last_wand_row_->y_px[m]);
    check.jumped = moved_px > kJumpShare * description_.image_size_px.width;
  }
  return check;
}

// Markers in between lie on the line of the outer ones, and about where the target says: however
// the wand is held, perspective moves them little.
bool CameraActivity::IsImplausible(const ThinnedRow& row) const {
  const auto first = static_cast<uint32_t>(std::countr_zero(row.visible_mask));
  const auto last = static_cast<uint32_t>(31 - std::countl_zero(row.visible_mask));
  const std::vector<double>& positions = target_.marker_positions_m;
  if (last >= positions.size() || last >= row.marker_count) return false;
  const double dx = row.x_px[last] - row.x_px[first];
  const double dy = row.y_px[last] - row.y_px[first];
  const double length_px = std::hypot(dx, dy);
  // Seen end on, it says nothing.
  if (length_px < 8 * kBentPx) return false;
  for (uint32_t m = first + 1; m < last; ++m) {
    if (!Visible(row, m)) continue;
    const double px = row.x_px[m] - row.x_px[first];
    const double py = row.y_px[m] - row.y_px[first];
    const double beside_px = std::abs(px * dy - py * dx) / length_px;
    const double along = (px * dx + py * dy) / (length_px * length_px);
    const double expected =
        (positions[m] - positions[first]) / (positions[last] - positions[first]);
    if (beside_px > kBentPx + kBentShare * length_px) return true;
    if (std::abs(along - expected) > kWrongPlaceShare) return true;
  }
  return false;
}

void CameraActivity::Advance(Time now) {
  // Each interval holds what has arrived since the one before.
  while (!intervals_.empty() && intervals_.front().time < now - kRateWindow) {
    rate_begin_ = intervals_.front().time;
    intervals_.pop_front();
  }
  ForgetBefore(now - kTrailWindow, &trail_);
  ForgetBefore(now - kCheckWindow, &checks_);
  ForgetBefore(now - kPaceWindow, &paces_);
  // The best rate of a whole window.
  if (first_row_ && now - *first_row_ > 2 * kRateWindow) {
    usual_rate_hz_ = std::max(usual_rate_hz_, Rate(&Interval::observations, now));
  }
  if (tallies_.empty() || now - tallies_.back().time >= kTallySpacing) {
    Tally tally{.time = now,
                .dropped = dropped_count(),
                .refused = refused_count_,
                .backlog = backlog_count()};
    for (const auto& [epoch, stream] : streams_) {
      if (stream.report && stream.report->detections) tally.detections = stream.report->detections;
    }
    tallies_.push_back(std::move(tally));
    ForgetBefore(now - kTallyWindow, &tallies_);
    ForgetBeyond(kMaxTallies, &tallies_);
  }
}

void CameraActivity::NoteWaving(bool others_see_wand, Time now) {
  const double passed_s = last_noted_ ? Seconds(now - *last_noted_) : 0;
  last_noted_ = now;
  // A long pause of the tracker is no waving.
  if (others_see_wand && !sees_wand(now) && passed_s < 2) unseen_waving_s_ += passed_s;
}

bool CameraActivity::sees_wand(Time now) const {
  return last_wand_ && now - *last_wand_ < kSeesWand;
}

bool CameraActivity::ended() const {
  return !streams_.empty() &&
         std::ranges::all_of(streams_, [](const auto& item) { return item.second.complete; });
}

uint64_t CameraActivity::dropped_count() const {
  uint64_t count = 0;
  for (const auto& [epoch, stream] : streams_) {
    uint64_t reported = 0;
    if (stream.report && stream.report->spool) reported = CountOf(stream.report->spool->dropped);
    count += std::max(reported, stream.dropped_count);
  }
  return count;
}

uint64_t CameraActivity::backlog_count() const {
  uint64_t count = 0;
  for (const auto& [epoch, stream] : streams_) {
    if (stream.complete || !stream.report || !stream.report->spool) continue;
    const uint64_t spooled = stream.report->spool->spooled_count;
    count += spooled - std::min(spooled, stream.kept_count);
  }
  return count;
}

double CameraActivity::Rate(uint64_t Interval::*count, Time now) const {
  if (!first_row_) return 0;
  uint64_t sum = 0;
  for (const Interval& interval : intervals_) sum += interval.*count;
  const double window_s = std::clamp(Seconds(now - rate_begin_.value_or(*first_row_)),
                                     kShortestRateWindowS, 1.1 * Seconds(kRateWindow));
  // A tenth is enough, and does not change with every state.
  return std::round(10 * static_cast<double>(sum) / window_s) / 10;
}

std::optional<double> CameraActivity::ArrivalDelayS() const {
  if (paces_.size() < 3) return std::nullopt;
  const double passed_s = Seconds(paces_.back().time - paces_.front().time);
  const double rows_s = 1e-9 * static_cast<double>(paces_.back().row_ns - paces_.front().row_ns);
  if (passed_s < kShortestPaceS || rows_s < 0.7 * passed_s || rows_s > 1.4 * passed_s) {
    return std::nullopt;
  }
  std::vector<double> delays_s;
  for (const Pace& pace : paces_) {
    delays_s.push_back(Seconds(pace.time.time_since_epoch()) -
                       1e-9 * static_cast<double>(pace.row_ns));
  }
  return LowerMedian(std::move(delays_s));
}

void CameraActivity::Describe(Time now, LiveCamera* camera) const {
  camera->observation_rate_hz = Rate(&Interval::observations, now);
  camera->wand_rate_hz = Rate(&Interval::wands, now);
  camera->observation_count = observation_count_;
  camera->wand_count = wand_count_;
  camera->backlog_count = backlog_count();
  camera->dropped_count = dropped_count() + refused_count_;
  camera->clock.clock_epoch_count = static_cast<uint32_t>(clock_epochs_.size());
  camera->coverage.columns = CoverageGrid::kColumns;
  camera->coverage.rows = CoverageGrid::kRows;
  camera->coverage.counts = coverage_.Counts();
  camera->coverage.covered_share = coverage_.CoveredShare();
  camera->trail.clear();
  for (const TrailPoint& point : trail_) {
    const auto age = duration_cast<milliseconds>(std::max(now - point.time, nanoseconds(0)));
    camera->trail.push_back({.age_ms = static_cast<uint32_t>(age.count()),
                             .x0_px = ToTenth(point.x0),
                             .y0_px = ToTenth(point.y0),
                             .x1_px = ToTenth(point.x1),
                             .y1_px = ToTenth(point.y1)});
  }
}

void CameraActivity::Describe(Time now, CameraFacts* facts) const {
  facts->camera = description_.camera;
  facts->ended = ended();
  facts->silent_s = Seconds(now - last_row_.value_or(start_));
  facts->rate_hz = Rate(&Interval::observations, now);
  facts->usual_rate_hz = usual_rate_hz_;
  facts->seconds_of_rows = first_row_ ? Seconds(now - *first_row_) : 0;
  facts->saw_wand = wand_count_ > 0;
  facts->unseen_waving_s = unseen_waving_s_;
  facts->backlog_count = backlog_count();
  facts->clock_epoch_count = static_cast<uint32_t>(clock_epochs_.size());
  size_t comparable = 0;
  size_t jumped = 0;
  size_t shaped = 0;
  size_t implausible = 0;
  for (const RowCheck& check : checks_) {
    comparable += check.comparable;
    jumped += check.jumped;
    shaped += check.shaped;
    implausible += check.implausible;
  }
  if (comparable >= kFewestChecks) {
    facts->jumping_share = static_cast<double>(jumped) / static_cast<double>(comparable);
  }
  if (shaped >= kFewestChecks) {
    facts->implausible_share = static_cast<double>(implausible) / static_cast<double>(shaped);
  }
  if (tallies_.size() < 2) return;
  const Tally& oldest = tallies_.front();
  const Tally& newest = tallies_.back();
  facts->dropped_lately = newest.dropped - std::min(newest.dropped, oldest.dropped);
  facts->refused_lately = newest.refused - std::min(newest.refused, oldest.refused);
  const double usual_hz = std::max(usual_rate_hz_, 1.0);
  const auto backlog = static_cast<double>(newest.backlog);
  facts->backlog_grows =
      backlog > 3 * usual_hz && backlog > static_cast<double>(oldest.backlog) + 2 * usual_hz;
  if (oldest.detections && newest.detections) {
    facts->ambiguous_share =
        ShareOf(*oldest.detections, *newest.detections, {DetectionOutcome::kAmbiguous});
    facts->dark_share = ShareOf(*oldest.detections, *newest.detections,
                                {DetectionOutcome::kBlack, DetectionOutcome::kSaturated});
  }
}

}  // namespace rigcal::server
