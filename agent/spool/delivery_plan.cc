// SPDX-License-Identifier: Apache-2.0
#include "agent/spool/delivery_plan.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>

namespace rigcal::agent {
namespace {

constexpr size_t kMaxRemembered = 1024;
constexpr size_t kMaxAlignments = 64;
constexpr int kWaitsOfTheServer = 4;

}  // namespace

void DeliveryPlan::RoundTrip::Add(Clock::duration measured) {
  smoothed = known ? (7 * smoothed + measured) / 8 : measured;
  shortest = known ? std::min(shortest, measured) : measured;
  known = true;
}

void DeliveryPlan::BeginConnection(size_t max_batch_rows) {
  max_batch_rows_ = std::max<size_t>(1, max_batch_rows);
  round_trip_ = {};
  progress_.clear();
  ends_to_repeat_.clear();
  gaps_to_tell_.clear();
  // They were measured against another connection, maybe another server.
  alignments_.clear();
  waits_for_alignment_ = true;
  in_flight_.reset();
  sent_any_ = false;
  if (IsDelivered()) one_at_a_time_ = false;
}

void DeliveryPlan::SetPosition(const StreamKey& stream, uint32_t durable_seq,
                               uint32_t send_limit_seq) {
  if (const auto found = over_.find(stream); found != over_.end()) {
    if (!found->second) return;
    if (durable_seq < found->second->last_seq) {
      spdlog::error(
          "camera {}: the server has only {} of {} observations of session {}, all of which it had "
          "acknowledged; they are no longer here",
          stream.camera, durable_seq, found->second->last_seq, stream.session_id);
      ObservationBatch gap;
      gap.stream = stream;
      gap.first_seq = found->second->last_seq + 1;
      gap.dropped = {{.first_seq = durable_seq + 1,
                      .count = found->second->last_seq - durable_seq,
                      .reason = RefusalReason::kSpoolFreed}};
      gaps_to_tell_.push_back(std::move(gap));
    }
    ends_to_repeat_.push_back(*found->second);
    return;
  }
  progress_.try_emplace(stream);
  Advance({.stream = stream,
           .durable_seq = durable_seq,
           .send_limit_seq = send_limit_seq,
           .faults = {}});
}

bool DeliveryPlan::Acknowledge(const BatchAck& ack, Clock::time_point now) {
  const auto found = progress_.find(ack.stream);
  if (found != progress_.end() && found->second.timed_seq != 0 &&
      ack.durable_seq >= found->second.timed_seq) {
    round_trip_.Add(now - found->second.timed_since);
  }
  return Advance(ack);
}

bool DeliveryPlan::Advance(const BatchAck& ack) {
  const auto found = progress_.find(ack.stream);
  const std::optional<SpooledStream> spooled = spool_->Find(ack.stream);
  if (in_flight_ && in_flight_->stream == ack.stream &&
      (in_flight_->is_end ? ack.complete : ack.durable_seq >= in_flight_->last_seq)) {
    in_flight_.reset();
  }
  if (found == progress_.end() || !spooled) return false;
  Progress& progress = found->second;
  // A server cannot have what was never captured.
  const uint32_t durable_seq = std::min(ack.durable_seq, spooled->end_seq - 1);
  bool is_news = durable_seq > progress.durable_seq;
  progress.durable_seq = std::max(progress.durable_seq, durable_seq);
  progress.next_seq = std::max(progress.next_seq, progress.durable_seq + 1);
  progress.send_limit_seq = std::max(progress.send_limit_seq, ack.send_limit_seq);
  if (progress.durable_seq >= progress.timed_seq) progress.timed_seq = 0;
  const uint32_t safe_seq =
      keeps_until_standby_ ? std::min(ack.standby_durable_seq, spooled->end_seq - 1) : durable_seq;
  spool_->Acknowledge(ack.stream, safe_seq);
  const bool complete = keeps_until_standby_ ? ack.standby_complete : ack.complete;
  const uint32_t complete_seq = keeps_until_standby_ ? safe_seq : progress.durable_seq;
  if (complete && spooled->end && complete_seq >= spooled->end->last_seq) {
    spdlog::info("camera {}: the server has everything of session {} up to observation {}{}",
                 ack.stream.camera, ack.stream.session_id, spooled->end->last_seq,
                 spooled->end_is_unknown ? "; whether that was the last one is not known" : "");
    Remember(ack.stream, spooled->end);
    spool_->Discard(ack.stream);
    progress_.erase(found);
    is_news = true;
  }
  return is_news;
}

std::optional<DeliveryPlan::Message> DeliveryPlan::Next(Clock::time_point now) {
  next_due_ = Clock::time_point::max();
  if (in_flight_) return std::nullopt;
  if (!gaps_to_tell_.empty()) {
    ObservationBatch gap = std::move(gaps_to_tell_.back());
    gaps_to_tell_.pop_back();
    NoteInFlight(gap.stream, gap.first_seq - 1, false);
    return gap;
  }
  if (!ends_to_repeat_.empty()) {
    EndOfCapture end = std::move(ends_to_repeat_.back());
    ends_to_repeat_.pop_back();
    NoteInFlight(end.stream, end.last_seq, true);
    return end;
  }
  auto candidate = progress_.upper_bound(last_sent_);
  for (size_t looked_at = 0; looked_at < progress_.size(); ++looked_at, ++candidate) {
    if (candidate == progress_.end()) candidate = progress_.begin();
    if (auto message = NextOf(candidate->first, candidate->second, now)) {
      last_sent_ = candidate->first;
      return message;
    }
  }
  return std::nullopt;
}

std::optional<DeliveryPlan::Message> DeliveryPlan::NextOf(const StreamKey& key, Progress& progress,
                                                          Clock::time_point now) {
  const std::optional<SpooledStream> spooled = spool_->Find(key);
  if (!spooled) return std::nullopt;
  if (waits_for_alignment_ && alignments_.empty() && !spooled->is_of_other_boot &&
      aligned_cameras_.contains(key.camera)) {
    return std::nullopt;
  }
  if (progress.next_seq < spooled->end_seq) return NextRows(*spooled, progress, now);
  if (!spooled->end || progress.end_sent) return std::nullopt;
  progress.end_sent = true;
  NoteInFlight(key, spooled->end->last_seq, true);
  EndOfCapture end = *spooled->end;
  end.report.spool = SpoolReportOf(*spooled);
  return end;
}

std::optional<DeliveryPlan::Message> DeliveryPlan::NextRows(const SpooledStream& spooled,
                                                            Progress& progress,
                                                            Clock::time_point now) {
  const uint32_t last_seq = std::min(spooled.end_seq - 1, progress.send_limit_seq);
  const bool was_freed = progress.next_seq < spooled.first_seq;
  const size_t available = last_seq < progress.next_seq ? 0 : last_seq - progress.next_seq + 1;
  const bool is_rest = spooled.end && last_seq == spooled.end->last_seq;
  if (!was_freed && available == 0) return std::nullopt;
  if (!was_freed && available < max_batch_rows_ && !is_rest) {
    if (const Clock::time_point due = DueTime(progress, now); due > now) {
      next_due_ = std::min(next_due_, due);
      return std::nullopt;
    }
  }
  absl::StatusOr<ObservationBatch> batch = spool_->Read(
      spooled.stream, progress.next_seq, std::clamp<size_t>(available, 1, max_batch_rows_));
  if (!batch.ok() || (batch->rows() == 0 && batch->dropped.empty())) return std::nullopt;
  for (const DroppedRange& range : batch->dropped) {
    if (range.reason != RefusalReason::kSpoolFreed) continue;
    // Only a server whose store went back in time asks for these again.
    spdlog::error(
        "camera {}: the server lost observations {} to {} of session {} after it had "
        "acknowledged them; they are no longer here",
        spooled.stream.camera, range.first_seq, range.first_seq + range.count - 1,
        spooled.stream.session_id);
  }
  // Rows behind what is dropped may be beyond the credit.
  if (!batch->dropped.empty()) batch = batch->Slice(0, 0);
  // Those of today say nothing about the clock of an earlier run of the operating system.
  if (!spooled.is_of_other_boot) {
    batch->host_alignments.assign(
        alignments_.begin() + static_cast<std::ptrdiff_t>(progress.alignments_sent),
        alignments_.end());
    progress.alignments_sent = alignments_.size();
  }
  progress.next_seq = batch->end_seq();
  progress.last_sent = now;
  if (progress.timed_seq == 0) {
    progress.timed_seq = batch->end_seq() - 1;
    progress.timed_since = now;
  }
  NoteInFlight(spooled.stream, batch->end_seq() - 1, false);
  return *std::move(batch);
}

DeliveryPlan::Clock::time_point DeliveryPlan::DueTime(const Progress& progress,
                                                      Clock::time_point now) const {
  if (!round_trip_.known) return progress.last_sent + flush_interval_;
  Clock::duration round_trip = round_trip_.smoothed;
  // One that is not at its end says more than earlier ones if it takes longer.
  if (progress.timed_seq != 0) round_trip = std::max(round_trip, now - progress.timed_since);
  const Clock::duration wait = kWaitsOfTheServer * (round_trip - round_trip_.shortest);
  return progress.last_sent +
         std::max(flush_interval_, std::min<Clock::duration>(wait, kLongestWait));
}

bool DeliveryPlan::HasEndedBefore(const StreamKey& stream) const {
  const auto is_earlier_end = [&](const StreamKey& key, const std::optional<EndOfCapture>& end) {
    return key.session_id == stream.session_id && key.camera == stream.camera &&
           key.stream_epoch != stream.stream_epoch && end && !end->interrupted;
  };
  for (const SpooledStream& spooled : spool_->Streams()) {
    if (is_earlier_end(spooled.stream, spooled.end)) return true;
  }
  return std::ranges::any_of(
      over_, [&](const auto& over) { return is_earlier_end(over.first, over.second); });
}

uint32_t DeliveryPlan::Discard(const StreamKey& stream) {
  progress_.erase(stream);
  over_.erase(stream);
  return spool_->Discard(stream);
}

void DeliveryPlan::AddAlignment(const HostAlignment& alignment) {
  alignments_.push_back(alignment);
  if (alignments_.size() <= kMaxAlignments) return;
  alignments_.erase(alignments_.begin());
  for (auto& [key, progress] : progress_) {
    progress.alignments_sent -= progress.alignments_sent > 0 ? 1 : 0;
  }
}

std::optional<DeliveryPlan::GivenUp> DeliveryPlan::OnProtocolFault(const std::string& message) {
  if (!one_at_a_time_) {
    one_at_a_time_ = true;
    return std::nullopt;
  }
  if (!in_flight_) return std::nullopt;
  const InFlight guilty = *std::exchange(in_flight_, std::nullopt);
  if (guilty.is_end) {
    const uint32_t lost = spool_->Discard(guilty.stream);
    Remember(guilty.stream, std::nullopt);
    return GivenUp{.stream = guilty.stream, .lost_count = lost};
  }
  EndOfCapture end;
  end.stream = guilty.stream;
  end.last_seq = progress_[guilty.stream].durable_seq;
  SpoolReport spool;
  if (const auto spooled = spool_->Find(guilty.stream)) {
    if (spooled->end) end.report = spooled->end->report;
    spool = SpoolReportOf(*spooled);
    spool.last_seq = spooled->end_seq - 1;
  }
  const uint32_t lost = spool_->Discard(guilty.stream);
  spool.spooled_count = 0;
  spool.dropped.push_back(
      {.camera = "", .reason = RefusalReason::kProtocolFault, .count = lost, .example = ""});
  end.report.spool = std::move(spool);
  end.report.stream = guilty.stream;
  end.report.observation_count = end.last_seq + lost;
  end.report.refused.push_back(
      {.camera = "", .reason = RefusalReason::kProtocolFault, .count = lost, .example = message});
  Remember(guilty.stream, std::move(end));
  return GivenUp{.stream = guilty.stream, .lost_count = lost};
}

void DeliveryPlan::NoteInFlight(const StreamKey& stream, uint32_t last_seq, bool is_end) {
  sent_any_ = true;
  if (one_at_a_time_) in_flight_ = {.stream = stream, .last_seq = last_seq, .is_end = is_end};
}

void DeliveryPlan::Remember(const StreamKey& stream, std::optional<EndOfCapture> end) {
  if (over_.insert_or_assign(stream, std::move(end)).second) over_in_order_.push_back(stream);
  if (over_in_order_.size() > kMaxRemembered) {
    over_.erase(over_in_order_.front());
    over_in_order_.erase(over_in_order_.begin());
  }
}

}  // namespace rigcal::agent
