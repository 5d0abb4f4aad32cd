// SPDX-License-Identifier: Apache-2.0
#include "server/store/sql/observation_writer.h"

#include <algorithm>
#include <tuple>

#include "absl/strings/str_cat.h"
#include "server/store/batch_blob.h"
#include "server/store/report_counts.h"
#include "server/store/sql/sql_database.h"

namespace rigcal::server {
namespace {

// Beyond it, arithmetic on nanoseconds may overflow.
constexpr int64_t kMaxPlausibleNs = int64_t{1} << 62;

bool IsPlausible(const ClockSample& sample) {
  const auto plausible = [](int64_t time_ns) { return time_ns >= 0 && time_ns <= kMaxPlausibleNs; };
  return plausible(sample.device_ns) && plausible(sample.host_monotonic_ns) &&
         plausible(sample.host_utc_ns) && plausible(sample.light_ns) &&
         (sample.IsOfHost() || sample.IsOfWand() ||
          (sample.light == kLamps && sample.light_ns > 0));
}

bool IsPlausible(const HostAlignment& alignment) {
  return alignment.host_monotonic_ns >= 0 && alignment.host_monotonic_ns <= kMaxPlausibleNs &&
         alignment.server_minus_host_ns >= -kMaxPlausibleNs &&
         alignment.server_minus_host_ns <= kMaxPlausibleNs;
}

}  // namespace

CountChanges::CountChanges(SqlDatabase& database)
    : add_to_camera_(database,
                     "UPDATE session_camera SET observation_count=observation_count+?, "
                     "wand_count=wand_count+?, late_count=late_count+? WHERE id=?"),
      add_to_clock_epoch_(
          database,
          "INSERT INTO clock_epoch_count(camera_id, clock_epoch, observation_count) VALUES(?,?,?) "
          "ON CONFLICT(camera_id, clock_epoch) DO UPDATE SET "
          "observation_count=clock_epoch_count.observation_count+excluded.observation_count"),
      add_refusal_(
          database,
          "INSERT INTO refusal_count AS r(camera_id, reason, count, example_stream_epoch, "
          "example_seq, example) VALUES(?,?,?,?,?,?) "
          "ON CONFLICT(camera_id, reason) DO UPDATE SET count=r.count+excluded.count, "
          "example_stream_epoch=CASE WHEN (excluded.example_stream_epoch, excluded.example_seq)<"
          "(r.example_stream_epoch, r.example_seq) THEN excluded.example_stream_epoch "
          "ELSE r.example_stream_epoch END, "
          "example_seq=CASE WHEN (excluded.example_stream_epoch, excluded.example_seq)<"
          "(r.example_stream_epoch, r.example_seq) THEN excluded.example_seq "
          "ELSE r.example_seq END, "
          "example=CASE WHEN (excluded.example_stream_epoch, excluded.example_seq)<"
          "(r.example_stream_epoch, r.example_seq) THEN excluded.example ELSE r.example END") {}

void CountChanges::AddRows(int64_t camera_id, uint32_t clock_epoch, uint32_t observations,
                           uint32_t wands, bool late) {
  if (observations == 0) return;
  CameraChange& change = cameras_[camera_id];
  change.observations += observations;
  change.wands += wands;
  if (late) change.late += observations;
  change.clock_epochs[clock_epoch] += observations;
}

void CountChanges::AddRefusal(int64_t camera_id, RefusalReason reason, uint32_t count,
                              uint32_t stream_epoch, uint32_t first_seq, std::string_view detail) {
  RefusalChange& change = cameras_[camera_id].refusals[reason];
  if (change.count == 0 ||
      std::tie(stream_epoch, first_seq) < std::tie(change.stream_epoch, change.seq)) {
    change.stream_epoch = stream_epoch;
    change.seq = first_seq;
    change.detail = detail;
  }
  change.count += count;
}

void CountChanges::Flush() {
  for (const auto& [camera_id, change] : cameras_) FlushCamera(camera_id, change);
  cameras_.clear();
}

void CountChanges::FlushCamera(int64_t camera_id, const CameraChange& change) {
  if (change.observations > 0) {
    Execute(add_to_camera_, change.observations, change.wands, change.late, camera_id);
  }
  for (const auto& [clock_epoch, observations] : change.clock_epochs) {
    Execute(add_to_clock_epoch_, camera_id, clock_epoch, observations);
  }
  for (const auto& [reason, refusal] : change.refusals) {
    const std::string example = absl::StrCat("seq ", refusal.seq, ": ", refusal.detail);
    Execute(add_refusal_, camera_id, NameOf(reason), refusal.count, refusal.stream_epoch,
            refusal.seq, example);
  }
}

ObservationWriter::ObservationWriter(SqlDatabase& database)
    : streams_(database),
      counts_(database),
      conflicts_(database),
      insert_stream_(database,
                     "INSERT INTO stream(camera_id, stream_epoch, durable_seq, "
                     "report_observation_count, report_refused_count) VALUES(?,?,0,0,0) "
                     "RETURNING id"),
      update_stream_(database,
                     "UPDATE stream SET durable_seq=?, last_seq=?, report_observation_count=?, "
                     "report_refused_count=? WHERE id=?"),
      insert_batch_(database, "INSERT INTO batch(id, row_count, late, body) VALUES(?,?,?,?)"),
      insert_dropped_(
          database, "INSERT INTO dropped(stream_id, first_seq, seq_count, reason) VALUES(?,?,?,?)"),
      insert_clock_sample_(
          database, "INSERT INTO clock_sample VALUES(?,?,?,?,?,?,?,?) ON CONFLICT DO NOTHING"),
      insert_light_sample_(
          database, "INSERT INTO light_sample VALUES(?,?,?,?,?,?,?,?) ON CONFLICT DO NOTHING"),
      insert_host_alignment_(
          database, "INSERT INTO host_alignment VALUES(?,?,?,?,?,?,?) ON CONFLICT DO NOTHING"),
      delete_report_(database, "DELETE FROM report_refusal WHERE stream_id=?"),
      insert_report_(
          database,
          "INSERT INTO report_refusal(stream_id, reason, count, example) VALUES(?,?,?,?)"),
      replace_report_count_(database,
                            "INSERT INTO report_count(stream_id, name, count) VALUES(?,?,?) "
                            "ON CONFLICT(stream_id, name) DO UPDATE SET count=excluded.count"),
      sum_spool_counts_(
          database,
          "SELECT CAST(coalesce(sum(count), 0) AS BIGINT) FROM report_count WHERE stream_id=? AND "
          "name LIKE 'spool.%' AND name<>'spool.rows'") {}

void ObservationWriter::Forget() {
  changed_.clear();
  counts_.Clear();
  conflicts_.Forget();
  streams_.Forget();
}

void ObservationWriter::Append(absl::Span<const Delivery> deliveries,
                               std::vector<AppendOutcome>* outcomes) {
  streams_.Trim();
  outcomes->assign(deliveries.size(), {});
  for (size_t i = 0; i < deliveries.size(); ++i) AppendOne(deliveries[i], &(*outcomes)[i]);
  WriteBack();
}

void ObservationWriter::AppendOne(const Delivery& delivery, AppendOutcome* outcome) {
  StreamState* state = streams_.Find(delivery.stream());
  if (state == nullptr) {
    outcome->unknown = true;
    return;
  }
  if (delivery.opens_stream && state->stream_id == 0) Touch(delivery.stream(), state);
  AppendRows(delivery, state, outcome);
  AppendDropped(delivery, state);
  AppendClockReadings(delivery, state);
  if (delivery.last_seq && (!state->last_seq || *state->last_seq < *delivery.last_seq)) {
    Touch(delivery.stream(), state);
    state->last_seq = delivery.last_seq;
  }
  if (delivery.report) ReplaceReport(delivery.stream(), *delivery.report, state);
  outcome->durable_seq = state->ledger.durable_seq();
  outcome->late = state->session_finished;
  outcome->complete = state->last_seq && outcome->durable_seq >= *state->last_seq;
}

void ObservationWriter::AppendRows(const Delivery& delivery, StreamState* state,
                                   AppendOutcome* outcome) {
  const ObservationBatch& batch = delivery.batch;
  if (batch.rows() == 0) return;
  uint32_t repeated_from = batch.first_seq;
  for (const SeqRange& range : state->ledger.Missing({batch.first_seq, batch.end_seq()})) {
    NoteRepeatedRows(delivery, {repeated_from, range.first}, *state, outcome);
    Touch(delivery.stream(), state);
    InsertRows(delivery, range, *state, outcome);
    state->ledger.Add(range);
    repeated_from = range.end;
  }
  NoteRepeatedRows(delivery, {repeated_from, batch.end_seq()}, *state, outcome);
}

void ObservationWriter::NoteRepeatedRows(const Delivery& delivery, SeqRange range,
                                         const StreamState& state, AppendOutcome* outcome) {
  if (range.size() == 0) return;
  const RowConflicts conflicts = conflicts_.Compare(state.stream_id, delivery.batch, range);
  outcome->duplicate_rows += range.size() - conflicts.count;
  outcome->conflict_rows += conflicts.count;
  if (conflicts.count == 0) return;
  counts_.AddRefusal(state.camera_id, RefusalReason::kConflict, conflicts.count,
                     delivery.stream().stream_epoch, conflicts.first_seq,
                     "delivered again with other values; the first ones stay");
}

void ObservationWriter::InsertRows(const Delivery& delivery, SeqRange range,
                                   const StreamState& state, AppendOutcome* outcome) {
  const ObservationBatch& batch = delivery.batch;
  const size_t begin = range.first - batch.first_seq;
  const size_t end = range.end - batch.first_seq;
  EncodeBatch(batch, delivery.refused_rows, begin, end, &blob_);
  Execute(insert_batch_, (state.stream_id << 32) + range.first, range.size(),
          state.session_finished, Blob{blob_});

  const auto wands_begin = batch.visible_mask.begin();
  auto wands = range.size() -
               static_cast<uint32_t>(std::count(wands_begin + static_cast<ptrdiff_t>(begin),
                                                wands_begin + static_cast<ptrdiff_t>(end), 0u));
  const absl::Span<const RefusedRow> refused_rows = RowsWithin(delivery.refused_rows, begin, end);
  for (const RefusedRow& row : refused_rows) {
    if (batch.visible_mask[row.row] != 0) --wands;
    counts_.AddRefusal(state.camera_id, row.reason, 1, delivery.stream().stream_epoch,
                       batch.first_seq + row.row, row.detail);
  }
  const auto refused = static_cast<uint32_t>(refused_rows.size());
  counts_.AddRows(state.camera_id, batch.clock_epoch, range.size() - refused, wands,
                  state.session_finished);
  outcome->stored_rows += range.size() - refused;
  outcome->refused_rows += refused;
}

void ObservationWriter::AppendDropped(const Delivery& delivery, StreamState* state) {
  for (const DroppedRange& dropped : delivery.batch.dropped) {
    const SeqRange whole{dropped.first_seq, dropped.first_seq + dropped.count};
    for (const SeqRange& range : state->ledger.Missing(whole)) {
      Touch(delivery.stream(), state);
      Execute(insert_dropped_, state->stream_id, range.first, range.size(), NameOf(dropped.reason));
      state->ledger.Add(range);
      counts_.AddRefusal(state->camera_id, dropped.reason, range.size(),
                         delivery.stream().stream_epoch, range.first, "lost at the agent");
    }
  }
}

void ObservationWriter::AppendClockReadings(const Delivery& delivery, StreamState* state) {
  const ObservationBatch& batch = delivery.batch;
  if (batch.clock_samples.empty() && batch.host_alignments.empty()) return;
  Touch(delivery.stream(), state);
  // What was refused before is not counted again.
  const auto insert = [&](SqlStatement& statement, bool plausible, const auto&... values) {
    if (plausible) {
      Execute(statement, state->stream_id, batch.clock_epoch, values..., state->session_finished,
              plausible);
    } else if (ExecuteAndCount(statement, state->stream_id, batch.clock_epoch, values...,
                               state->session_finished, plausible) > 0) {
      counts_.AddRefusal(state->camera_id, RefusalReason::kImplausibleClockSample, 1,
                         delivery.stream().stream_epoch, 0,
                         "a clock sample is negative, beyond 2^62 ns, or of an unknown light");
    }
  };
  for (const ClockSample& sample : batch.clock_samples) {
    if (sample.IsOfHost()) {
      insert(insert_clock_sample_, IsPlausible(sample), sample.host_monotonic_ns, sample.device_ns,
             sample.host_utc_ns, sample.uncertainty_ns);
    } else {
      insert(insert_light_sample_, IsPlausible(sample), sample.device_ns, sample.light,
             sample.light_ns, sample.uncertainty_ns);
    }
  }
  for (const HostAlignment& alignment : batch.host_alignments) {
    insert(insert_host_alignment_, IsPlausible(alignment), alignment.host_monotonic_ns,
           alignment.server_minus_host_ns, alignment.uncertainty_ns);
  }
}

// Totals only grow, so of two reports the one with the larger totals is the later one, in whatever
// order they arrive.
void ObservationWriter::ReplaceReport(const StreamKey& stream, const CameraReport& report,
                                      StreamState* state) {
  if (report.spool) ReplaceSpoolReport(stream, *report.spool, state);
  uint64_t refused_count = 0;
  RefusalCounter refusals;
  for (const Refusal& refusal : report.refused) {
    refused_count += refusal.count;
    refusals.Add("", refusal.reason, refusal.count, refusal.example);
  }
  const auto counts = NamedCounts(report);
  uint64_t counted = 0;
  for (const auto& [name, count] : counts) counted += count;
  if (std::tie(report.observation_count, refused_count, counted) <=
      std::tie(state->report_observation_count, state->report_refused_count,
               state->report_counted)) {
    return;
  }
  Touch(stream, state);
  state->report_observation_count = report.observation_count;
  state->report_refused_count = refused_count;
  state->report_counted = counted;
  Execute(delete_report_, state->stream_id);
  for (const Refusal& refusal : refusals.List()) {
    Execute(insert_report_, state->stream_id, NameOf(refusal.reason), refusal.count,
            refusal.example);
  }
  for (const auto& [name, count] : counts) {
    Execute(replace_report_count_, state->stream_id, name, count);
  }
}

// Its numbers grow too, all but that of the rows in the spool.
void ObservationWriter::ReplaceSpoolReport(const StreamKey& stream, const SpoolReport& report,
                                           StreamState* state) {
  const auto counts = NamedCounts(report);
  uint64_t counted = 0;
  for (const auto& [name, count] : counts) counted += name == kSpoolRows ? 0 : count;
  if (!state->spool_counted) {
    const StatementScope scope(sum_spool_counts_);
    BindAll(sum_spool_counts_, state->stream_id);
    state->spool_counted = sum_spool_counts_.Step() ? sum_spool_counts_.Uint64(0) : 0;
  }
  if (counted <= *state->spool_counted) return;
  Touch(stream, state);
  state->spool_counted = counted;
  for (const auto& [name, count] : counts) {
    Execute(replace_report_count_, state->stream_id, name, count);
  }
}

void ObservationWriter::Touch(const StreamKey& stream, StreamState* state) {
  if (state->changed) return;
  if (state->stream_id == 0) {
    const StatementScope scope(insert_stream_);
    BindAll(insert_stream_, state->camera_id, stream.stream_epoch);
    insert_stream_.Step();
    state->stream_id = insert_stream_.Int64(0);
    while (insert_stream_.Step()) {
    }
  }
  state->changed = true;
  changed_.push_back(state);
}

void ObservationWriter::WriteBack() {
  counts_.Flush();
  for (StreamState* state : changed_) {
    Execute(update_stream_, state->ledger.durable_seq(), state->last_seq,
            state->report_observation_count, state->report_refused_count, state->stream_id);
    state->changed = false;
  }
  changed_.clear();
}

}  // namespace rigcal::server
