// SPDX-License-Identifier: Apache-2.0
#include "common/wire/observation_wire.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "common/status/validate_name.h"
#include "common/text/printable.h"
#include "common/wire/spool_wire.h"

namespace rigcal::wire {
namespace {

// Of a refusal; a session keeps one for each camera and reason.
constexpr size_t kMaxExampleBytes = 256;

absl::Status Fault(absl::string_view message) {
  return absl::InvalidArgumentError(absl::StrCat("batch.", message));
}

// The key of a message that has its three fields itself. Errors begin with `path` and the field.
template <typename Proto>
absl::StatusOr<StreamKey> ReadKey(const Proto& proto, absl::string_view path) {
  absl::Status status = ValidateName("session_id", proto.session_id());
  if (status.ok()) status = ValidateName("camera", proto.camera());
  if (status.ok() && proto.stream_epoch() == 0) {
    status = absl::InvalidArgumentError("stream_epoch: must be at least 1");
  }
  if (!status.ok()) return absl::InvalidArgumentError(absl::StrCat(path, status.message()));
  return StreamKey{proto.session_id(), proto.camera(), proto.stream_epoch()};
}

template <typename Proto>
void WriteKey(const StreamKey& stream, Proto* proto) {
  proto->set_session_id(stream.session_id);
  proto->set_camera(stream.camera);
  proto->set_stream_epoch(stream.stream_epoch);
}

// Largest count that an agent can report: its sums over all streams stay within 64 bits.
uint64_t Limited(uint64_t count) { return std::min(count, uint64_t{1} << 40); }

// Its number is that of the outcome.
const google::protobuf::FieldDescriptor* FieldOf(DetectionOutcome outcome) {
  return v1::DetectionCounts::descriptor()->FindFieldByNumber(static_cast<int>(outcome));
}

template <typename T, typename Repeated>
void Copy(const Repeated& from, std::vector<T>* to) {
  to->assign(from.begin(), from.end());
}

absl::Status CopyCentreKinds(const v1::ObservationBatch& proto, ObservationBatch* batch) {
  batch->centre_kind.reserve(static_cast<size_t>(proto.centre_kind_size()));
  for (int i = 0; i < proto.centre_kind_size(); ++i) {
    const int kind = proto.centre_kind(i);
    if (kind < 0 || kind > v1::CENTRE_KIND_SPHERE_CENTRE) {
      return Fault(absl::StrCat("centre_kind[", i, "]: ", kind, " is not a known kind of centre"));
    }
    batch->centre_kind.push_back(static_cast<uint8_t>(kind));
  }
  return absl::OkStatus();
}

// Columns that the sender left out because all their values are the same.
void FillOmittedColumns(ObservationBatch* batch) {
  const size_t values = batch->x_px.size();
  if (batch->time_delta_ns.empty()) batch->time_delta_ns.assign(values, 0);
  if (batch->label_confidence.empty()) batch->label_confidence.assign(values, 1.0f);
  if (batch->centre_kind.size() == 1) {
    const uint8_t kind = batch->centre_kind.front();
    batch->centre_kind.assign(values, kind);
  }
}

// Values of invisible markers mean nothing; as zeros they cannot make equal observations differ.
void ClearInvisibleMarkers(ObservationBatch* batch) {
  const uint32_t markers = batch->marker_count;
  for (size_t row = 0; row < batch->rows(); ++row) {
    for (uint32_t m = 0; m < markers; ++m) {
      if (batch->IsVisible(row, m)) continue;
      const size_t i = row * markers + m;
      batch->x_px[i] = batch->y_px[i] = 0;
      batch->cov_xx_px2[i] = batch->cov_xy_px2[i] = batch->cov_yy_px2[i] = 0;
      batch->time_delta_ns[i] = 0;
      batch->label_confidence[i] = 0;
      batch->centre_kind[i] = 0;
    }
  }
}

}  // namespace

absl::StatusOr<ObservationBatch> FromProto(const v1::ObservationBatch& proto) {
  ObservationBatch batch;
  RIGCAL_ASSIGN_OR_RETURN(batch.stream, ReadKey(proto, "batch.key: "));
  batch.first_seq = proto.first_seq();
  batch.clock_epoch = proto.clock_epoch();
  batch.marker_count = proto.marker_count();
  Copy(proto.time_ns(), &batch.time_ns);
  Copy(proto.visible_mask(), &batch.visible_mask);
  Copy(proto.x_px(), &batch.x_px);
  Copy(proto.y_px(), &batch.y_px);
  Copy(proto.cov_xx_px2(), &batch.cov_xx_px2);
  Copy(proto.cov_xy_px2(), &batch.cov_xy_px2);
  Copy(proto.cov_yy_px2(), &batch.cov_yy_px2);
  Copy(proto.time_delta_ns(), &batch.time_delta_ns);
  Copy(proto.label_confidence(), &batch.label_confidence);
  RIGCAL_RETURN_IF_ERROR(CopyCentreKinds(proto, &batch));
  FillOmittedColumns(&batch);
  for (const v1::ClockSample& sample : proto.clock_samples()) {
    batch.clock_samples.push_back({.device_ns = sample.device_ns(),
                                   .host_monotonic_ns = sample.host_monotonic_ns(),
                                   .host_utc_ns = sample.host_utc_ns(),
                                   .uncertainty_ns = sample.uncertainty_ns(),
                                   .light = sample.light(),
                                   .light_ns = sample.light_ns()});
  }
  for (const v1::HostAlignment& alignment : proto.host_alignments()) {
    batch.host_alignments.push_back({alignment.host_monotonic_ns(),
                                     alignment.server_minus_host_ns(), alignment.uncertainty_ns()});
  }
  for (const v1::DroppedRange& range : proto.dropped()) {
    batch.dropped.push_back({range.first_seq(), range.count(), FromProto(range.reason())});
  }
  if (absl::Status shape = CheckShape(batch); !shape.ok()) return Fault(shape.message());
  ClearInvisibleMarkers(&batch);
  return batch;
}

void ToProto(const ObservationBatch& batch, v1::ObservationBatch* proto) {
  proto->Clear();
  WriteKey(batch.stream, proto);
  proto->set_first_seq(batch.first_seq);
  proto->set_clock_epoch(batch.clock_epoch);
  proto->set_marker_count(batch.marker_count);
  proto->mutable_time_ns()->Assign(batch.time_ns.begin(), batch.time_ns.end());
  proto->mutable_visible_mask()->Assign(batch.visible_mask.begin(), batch.visible_mask.end());
  proto->mutable_x_px()->Assign(batch.x_px.begin(), batch.x_px.end());
  proto->mutable_y_px()->Assign(batch.y_px.begin(), batch.y_px.end());
  proto->mutable_cov_xx_px2()->Assign(batch.cov_xx_px2.begin(), batch.cov_xx_px2.end());
  proto->mutable_cov_xy_px2()->Assign(batch.cov_xy_px2.begin(), batch.cov_xy_px2.end());
  proto->mutable_cov_yy_px2()->Assign(batch.cov_yy_px2.begin(), batch.cov_yy_px2.end());
  // The two columns that are mostly of one value are left out when they are.
  const auto not_zero = [](int32_t delta) { return delta != 0; };
  if (std::any_of(batch.time_delta_ns.begin(), batch.time_delta_ns.end(), not_zero)) {
    proto->mutable_time_delta_ns()->Assign(batch.time_delta_ns.begin(), batch.time_delta_ns.end());
  }
  proto->mutable_label_confidence()->Assign(batch.label_confidence.begin(),
                                            batch.label_confidence.end());
  proto->mutable_centre_kind()->Assign(batch.centre_kind.begin(), batch.centre_kind.end());
  for (const ClockSample& sample : batch.clock_samples) {
    v1::ClockSample* out = proto->add_clock_samples();
    out->set_device_ns(sample.device_ns);
    out->set_host_monotonic_ns(sample.host_monotonic_ns);
    out->set_host_utc_ns(sample.host_utc_ns);
    out->set_uncertainty_ns(sample.uncertainty_ns);
    out->set_light(sample.light);
    out->set_light_ns(sample.light_ns);
  }
  for (const HostAlignment& alignment : batch.host_alignments) {
    v1::HostAlignment* out = proto->add_host_alignments();
    out->set_host_monotonic_ns(alignment.host_monotonic_ns);
    out->set_server_minus_host_ns(alignment.server_minus_host_ns);
    out->set_uncertainty_ns(alignment.uncertainty_ns);
  }
  for (const DroppedRange& range : batch.dropped) {
    v1::DroppedRange* out = proto->add_dropped();
    out->set_first_seq(range.first_seq);
    out->set_count(range.count);
    out->set_reason(ToProto(range.reason));
  }
}

v1::StreamKey ToProto(const StreamKey& stream) {
  v1::StreamKey proto;
  WriteKey(stream, &proto);
  return proto;
}

absl::StatusOr<StreamKey> FromProto(const v1::StreamKey& proto) { return ReadKey(proto, ""); }

// The C++ enum is made from the proto's, with the same numbers.
v1::RefusalReason ToProto(RefusalReason reason) { return static_cast<v1::RefusalReason>(reason); }

RefusalReason FromProto(v1::RefusalReason proto) {
  return v1::RefusalReason_IsValid(proto) ? static_cast<RefusalReason>(proto)
                                          : RefusalReason::kUnspecified;
}

v1::RefusalCount ToProto(const Refusal& refusal) {
  v1::RefusalCount proto;
  proto.set_camera(refusal.camera);
  proto.set_reason(ToProto(refusal.reason));
  proto.set_count(static_cast<uint32_t>(std::min<uint64_t>(refusal.count, UINT32_MAX)));
  proto.set_example(refusal.example);
  return proto;
}

Refusal FromProto(const v1::RefusalCount& proto) {
  return {proto.camera(), FromProto(proto.reason()), proto.count(),
          Printable(Beginning(proto.example(), kMaxExampleBytes))};
}

v1::FrameCounts ToProto(const FrameCounts& counts) {
  v1::FrameCounts proto;
  proto.set_received(counts.received);
  proto.set_damaged(counts.damaged);
  proto.set_lost(counts.lost);
  proto.set_reconnects(counts.reconnects);
  return proto;
}

FrameCounts FromProto(const v1::FrameCounts& proto) {
  return {Limited(proto.received()), Limited(proto.damaged()), Limited(proto.lost()),
          Limited(proto.reconnects())};
}

v1::DetectionCounts ToProto(const DetectionCounts& counts) {
  v1::DetectionCounts proto;
  for (const DetectionOutcome outcome : kDetectionOutcomes) {
    proto.GetReflection()->SetUInt64(&proto, FieldOf(outcome), counts.Of(outcome));
  }
  return proto;
}

DetectionCounts FromProto(const v1::DetectionCounts& proto) {
  DetectionCounts counts;
  for (const DetectionOutcome outcome : kDetectionOutcomes) {
    counts.Add(outcome, Limited(proto.GetReflection()->GetUInt64(proto, FieldOf(outcome))));
  }
  return counts;
}

v1::CameraReport ToProto(const CameraReport& report) {
  v1::CameraReport proto;
  WriteKey(report.stream, &proto);
  proto.set_observation_count(report.observation_count);
  for (const Refusal& refusal : report.refused) *proto.add_refused() = ToProto(refusal);
  if (report.frames) *proto.mutable_frames() = ToProto(*report.frames);
  if (report.detections) *proto.mutable_detections() = ToProto(*report.detections);
  if (report.spool) *proto.mutable_spool() = ToProto(*report.spool);
  return proto;
}

absl::StatusOr<CameraReport> FromProto(const v1::CameraReport& proto) {
  // A source has a few reasons; a report with thousands is a fault, not information.
  constexpr int kMaxReasons = 256;
  constexpr size_t kMaxText = 1024;
  if (proto.refused_size() > kMaxReasons) {
    return absl::InvalidArgumentError(
        absl::StrCat("report.refused: ", proto.refused_size(), " entries, at most ", kMaxReasons));
  }
  CameraReport report;
  RIGCAL_ASSIGN_OR_RETURN(report.stream, ReadKey(proto, "report."));
  report.observation_count = Limited(proto.observation_count());
  for (const v1::RefusalCount& refusal : proto.refused()) {
    Refusal& added = report.refused.emplace_back(FromProto(refusal));
    added.example.resize(std::min(added.example.size(), kMaxText));
  }
  if (proto.has_frames()) report.frames = FromProto(proto.frames());
  if (proto.has_detections()) report.detections = FromProto(proto.detections());
  if (proto.has_spool()) {
    RIGCAL_ASSIGN_OR_RETURN(report.spool, FromProto(proto.spool(), "report.spool"));
  }
  return report;
}

v1::EndOfCapture ToProto(const EndOfCapture& end) {
  v1::EndOfCapture proto;
  WriteKey(end.stream, &proto);
  proto.set_last_seq(end.last_seq);
  *proto.mutable_report() = ToProto(end.report);
  return proto;
}

absl::StatusOr<EndOfCapture> FromProto(const v1::EndOfCapture& proto) {
  EndOfCapture end;
  RIGCAL_ASSIGN_OR_RETURN(end.stream, ReadKey(proto, "end_of_capture."));
  end.last_seq = proto.last_seq();
  end.report.stream = end.stream;
  if (proto.has_report()) {
    RIGCAL_ASSIGN_OR_RETURN(end.report, FromProto(proto.report()));
    if (end.report.stream != end.stream) {
      return absl::InvalidArgumentError("end_of_capture.report: of another stream than the end");
    }
  }
  return end;
}

v1::BatchAck ToProto(const BatchAck& ack) {
  v1::BatchAck proto;
  WriteKey(ack.stream, &proto);
  proto.set_durable_seq(ack.durable_seq);
  proto.set_send_limit_seq(ack.send_limit_seq);
  for (const ObservationFault& fault : ack.faults) {
    v1::ObservationFault* out = proto.add_faults();
    out->set_seq(fault.seq);
    out->set_field(fault.field);
    out->set_reason(ToProto(fault.reason));
  }
  proto.set_fault_count(ack.fault_count);
  proto.set_complete(ack.complete);
  proto.set_conflict_count(ack.conflict_count);
  proto.set_standby_durable_seq(ack.standby_durable_seq);
  proto.set_standby_complete(ack.standby_complete);
  return proto;
}

absl::StatusOr<BatchAck> FromProto(const v1::BatchAck& proto) {
  BatchAck ack;
  RIGCAL_ASSIGN_OR_RETURN(ack.stream, ReadKey(proto, ""));
  ack.durable_seq = proto.durable_seq();
  ack.send_limit_seq = proto.send_limit_seq();
  for (const v1::ObservationFault& fault : proto.faults()) {
    ack.faults.push_back({fault.seq(), fault.field(), FromProto(fault.reason())});
  }
  ack.fault_count = proto.fault_count();
  ack.complete = proto.complete();
  ack.conflict_count = proto.conflict_count();
  ack.standby_durable_seq = proto.standby_durable_seq();
  ack.standby_complete = proto.standby_complete();
  return ack;
}

}  // namespace rigcal::wire
