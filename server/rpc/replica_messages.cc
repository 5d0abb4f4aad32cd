// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/replica_messages.h"

#include <zlib.h>

#include <algorithm>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "common/wire/observation_wire.h"

namespace rigcal::server {
namespace {

uint32_t ChecksumOf(const v1::ReadRecordResponse& message) {
  uLong crc = 0;
  for (const v1::ReplicaRow& row : message.rows()) {
    const std::string bytes = row.SerializeAsString();
    crc = crc32_z(crc, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size());
  }
  return static_cast<uint32_t>(crc);
}

}  // namespace

v1::ReadRecordResponse ToMessage(ReplicaRows rows) {
  v1::ReadRecordResponse message;
  message.set_table(rows.table);
  for (ReplicaRow& row : rows.rows) {
    v1::ReplicaRow* const out = message.add_rows();
    out->mutable_numbers()->Add(row.numbers.begin(), row.numbers.end());
    out->set_without_value(row.without_value);
    for (std::string& value : row.values) *out->add_values() = std::move(value);
  }
  message.set_checksum(ChecksumOf(message));
  return message;
}

absl::StatusOr<ReplicaRows> RowsOf(v1::ReadRecordResponse message) {
  if (ChecksumOf(message) != message.checksum()) {
    return absl::DataLossError(absl::StrCat("rows of table ", message.table(),
                                            " have changed on their way from the primary"));
  }
  ReplicaRows rows{.table = message.table(), .rows = {}, .continues = message.continues()};
  for (v1::ReplicaRow& row : *message.mutable_rows()) {
    ReplicaRow& out = rows.rows.emplace_back();
    out.numbers.assign(row.numbers().begin(), row.numbers().end());
    out.without_value = row.without_value();
    for (std::string& value : *row.mutable_values()) out.values.push_back(std::move(value));
  }
  return rows;
}

v1::StandbyPosition ToMessage(const StreamProgress& progress) {
  v1::StandbyPosition message;
  *message.mutable_stream() = wire::ToProto(progress.stream);
  message.set_durable_seq(progress.durable_seq);
  message.set_complete(progress.complete);
  return message;
}

absl::StatusOr<StreamProgress> ProgressOf(const v1::StandbyPosition& message) {
  RIGCAL_ASSIGN_OR_RETURN(StreamKey stream, wire::FromProto(message.stream()));
  return StreamProgress{.stream = std::move(stream),
                        .durable_seq = message.durable_seq(),
                        .complete = message.complete()};
}

v1::ReplicaRecord ToMessage(const ReplicaRecord& record) {
  v1::ReplicaRecord message;
  message.set_id(record.id);
  message.set_mark(record.mark);
  for (const StreamProgress& stream : record.streams) *message.add_streams() = ToMessage(stream);
  return message;
}

absl::StatusOr<ReplicaRecord> RecordOf(const v1::ReplicaRecord& message) {
  ReplicaRecord record{.id = message.id(), .mark = message.mark()};
  for (const v1::StandbyPosition& stream : message.streams()) {
    RIGCAL_ASSIGN_OR_RETURN(StreamProgress progress, ProgressOf(stream));
    record.streams.push_back(std::move(progress));
  }
  return record;
}

v1::ReplicaStream ToMessage(const ReplicaStream& stream) {
  v1::ReplicaStream message;
  message.set_number(stream.number);
  message.set_durable_seq(stream.durable_seq);
  for (const ReplicaSamples& samples : stream.samples) {
    v1::SampleMark* const mark = message.add_samples();
    mark->set_count(samples.count);
    mark->set_clock_epoch(samples.clock_epoch);
    mark->set_time_ns(samples.time_ns);
  }
  return message;
}

ReplicaStream StreamOf(const v1::ReplicaStream& message) {
  ReplicaStream stream{.number = message.number(), .durable_seq = message.durable_seq()};
  const size_t count = std::min(stream.samples.size(), static_cast<size_t>(message.samples_size()));
  for (size_t i = 0; i < count; ++i) {
    const v1::SampleMark& mark = message.samples(static_cast<int>(i));
    stream.samples[i] = {mark.count(), mark.clock_epoch(), mark.time_ns()};
  }
  return stream;
}

v1::ReadRecordRequest::Kind ToMessage(ReplicaKind kind) {
  switch (kind) {
    case ReplicaKind::kShared:
      return v1::ReadRecordRequest::KIND_SHARED;
    case ReplicaKind::kSession:
      return v1::ReadRecordRequest::KIND_SESSION;
    case ReplicaKind::kCalibration:
      return v1::ReadRecordRequest::KIND_CALIBRATION;
    case ReplicaKind::kActivations:
      return v1::ReadRecordRequest::KIND_ACTIVATIONS;
  }
  return v1::ReadRecordRequest::KIND_UNSPECIFIED;
}

absl::StatusOr<ReplicaKind> KindOf(v1::ReadRecordRequest::Kind kind) {
  for (const ReplicaKind known : {ReplicaKind::kShared, ReplicaKind::kSession,
                                  ReplicaKind::kCalibration, ReplicaKind::kActivations}) {
    if (ToMessage(known) == kind) return known;
  }
  return absl::InvalidArgumentError("kind: is not set, or unknown to this server");
}

}  // namespace rigcal::server
