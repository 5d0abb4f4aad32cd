// SPDX-License-Identifier: Apache-2.0
#include "common/wire/spool_wire.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "common/wire/observation_wire.h"

namespace rigcal::wire {
namespace {

constexpr int kMaxDropReasons = 64;
constexpr size_t kMaxSpoolText = 1024;

static_assert(static_cast<int>(StreamHolder::kNone) == v1::StreamAudit::HOLDER_UNSPECIFIED);
static_assert(static_cast<int>(StreamHolder::kConnected) == v1::StreamAudit::HOLDER_CONNECTED);
static_assert(static_cast<int>(StreamHolder::kAway) == v1::StreamAudit::HOLDER_AWAY);
static_assert(static_cast<int>(StreamHolder::kGone) == v1::StreamAudit::HOLDER_GONE);

// Sums of them stay within 64 bits.
uint64_t LimitedCount(uint64_t count) { return std::min(count, uint64_t{1} << 56); }

using RefusalCounts = google::protobuf::RepeatedPtrField<v1::RefusalCount>;

void WriteDrops(const std::vector<Refusal>& dropped, RefusalCounts* proto) {
  for (const Refusal& refusal : dropped) *proto->Add() = ToProto(refusal);
}

void WriteRanges(const std::vector<StreamAudit::Range>& ranges,
                 google::protobuf::RepeatedPtrField<v1::SeqRange>* proto) {
  for (const StreamAudit::Range& range : ranges) {
    v1::SeqRange* const added = proto->Add();
    added->set_first_seq(range.first_seq);
    added->set_count(range.count);
  }
}

absl::StatusOr<std::vector<Refusal>> ReadDrops(const RefusalCounts& proto,
                                               absl::string_view field) {
  if (proto.size() > kMaxDropReasons) {
    return absl::InvalidArgumentError(
        absl::StrCat(field, ".dropped: ", proto.size(), " reasons, at most ", kMaxDropReasons));
  }
  RefusalCounter counter;
  for (const v1::RefusalCount& refusal : proto) {
    counter.Add("", FromProto(refusal.reason()), refusal.count());
  }
  return counter.List();
}

}  // namespace

v1::SpoolReport ToProto(const SpoolReport& report) {
  v1::SpoolReport proto;
  proto.set_last_seq(report.last_seq);
  proto.set_acknowledged_seq(report.acknowledged_seq);
  proto.set_spooled_count(report.spooled_count);
  WriteDrops(report.dropped, proto.mutable_dropped());
  proto.set_end_is_unknown(report.end_is_unknown);
  return proto;
}

absl::StatusOr<SpoolReport> FromProto(const v1::SpoolReport& proto, absl::string_view field) {
  SpoolReport report{.last_seq = proto.last_seq(),
                     .acknowledged_seq = proto.acknowledged_seq(),
                     .spooled_count = LimitedCount(proto.spooled_count())};
  RIGCAL_ASSIGN_OR_RETURN(report.dropped, ReadDrops(proto.dropped(), field));
  report.end_is_unknown = proto.end_is_unknown();
  return report;
}

v1::SpoolStatus ToProto(const SpoolStatus& status) {
  v1::SpoolStatus proto;
  proto.set_row_count(status.row_count);
  proto.set_bytes(status.bytes);
  proto.set_limit_bytes(status.limit_bytes);
  WriteDrops(status.dropped, proto.mutable_dropped());
  proto.set_folder(status.folder.substr(0, kMaxSpoolText));
  proto.set_problem(status.problem.substr(0, kMaxSpoolText));
  return proto;
}

absl::StatusOr<SpoolStatus> FromProto(const v1::SpoolStatus& proto, absl::string_view field) {
  SpoolStatus status{.row_count = LimitedCount(proto.row_count()),
                     .bytes = LimitedCount(proto.bytes()),
                     .limit_bytes = LimitedCount(proto.limit_bytes()),
                     .folder = proto.folder().substr(0, kMaxSpoolText),
                     .problem = proto.problem().substr(0, kMaxSpoolText)};
  RIGCAL_ASSIGN_OR_RETURN(status.dropped, ReadDrops(proto.dropped(), field));
  return status;
}

v1::StreamAudit ToProto(const StreamAudit& audit) {
  v1::StreamAudit proto;
  proto.set_camera(audit.stream.camera);
  proto.set_stream_epoch(audit.stream.stream_epoch);
  proto.set_agent_id(audit.agent_id);
  proto.set_holder(static_cast<v1::StreamAudit::Holder>(audit.holder));
  proto.set_durable_seq(audit.durable_seq);
  proto.set_last_seq(audit.last_seq.value_or(0));
  proto.set_ended(audit.last_seq && audit.durable_seq >= *audit.last_seq);
  proto.set_highest_seq(audit.highest_seq);
  proto.set_stored_count(audit.stored_count);
  proto.set_late_count(audit.late_count);
  proto.set_damaged_count(audit.damaged_count);
  WriteRanges(audit.damaged, proto.mutable_damaged());
  proto.set_damage(audit.damage.substr(0, kMaxSpoolText));
  proto.set_absent_count(audit.absent_count);
  WriteRanges(audit.absent, proto.mutable_absent());
  WriteDrops(audit.dropped, proto.mutable_dropped());
  if (audit.reported) *proto.mutable_reported() = ToProto(*audit.reported);
  return proto;
}

}  // namespace rigcal::wire
