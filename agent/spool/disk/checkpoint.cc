// SPDX-License-Identifier: Apache-2.0
#include "agent/spool/disk/checkpoint.h"

#include <algorithm>
#include <utility>

#include "agent/spool/disk/byte_format.h"
#include "common/target/target.h"

namespace rigcal::agent {
namespace {

constexpr std::string_view kCheckpointMagic = "RCCHECK1";
constexpr size_t kCheckpointPrefix = 16;
constexpr size_t kMaxKeyBytes = 256;
constexpr size_t kMaxExampleBytes = 1024;
constexpr uint32_t kMaxEntries = 1u << 20;
// Of the end of a stream.
constexpr uint8_t kInterrupted = 1;
constexpr uint8_t kEndIsUnknown = 2;

void PutReport(const CameraReport& report, std::string* out) {
  PutNumber(report.observation_count, out);
  PutNumber(static_cast<uint32_t>(report.refused.size()), out);
  for (const Refusal& refusal : report.refused) {
    PutText(refusal.camera, out);
    PutNumber(static_cast<uint32_t>(refusal.reason), out);
    PutNumber(refusal.count, out);
    PutText(std::string_view(refusal.example).substr(0, kMaxExampleBytes), out);
  }
  PutNumber(uint8_t{report.frames.has_value()}, out);
  if (const auto& frames = report.frames) {
    for (const uint64_t count :
         {frames->received, frames->damaged, frames->lost, frames->reconnects}) {
      PutNumber(count, out);
    }
  }
  PutNumber(uint8_t{report.detections.has_value()}, out);
  if (!report.detections) return;
  for (const DetectionOutcome outcome : kDetectionOutcomes) {
    PutNumber(report.detections->Of(outcome), out);
  }
}

RefusalReason TakeReason(ByteReader& reader) {
  const auto number = reader.Take<uint32_t>();
  for (const auto& [reason, name] : kRefusalReasonNames) {
    if (static_cast<uint32_t>(reason) == number) return reason;
  }
  return RefusalReason::kUnspecified;
}

// At most as many as the bytes that are left can hold: a damaged number must not take memory.
uint32_t TakeCount(ByteReader& reader) {
  const auto count = reader.Take<uint32_t>();
  return static_cast<uint32_t>(std::min<size_t>({count, kMaxEntries, reader.left()}));
}

CameraReport TakeReport(ByteReader& reader) {
  CameraReport report;
  report.observation_count = reader.Take<uint64_t>();
  for (uint32_t left = TakeCount(reader); left > 0 && reader.ok(); --left) {
    Refusal& refusal = report.refused.emplace_back();
    refusal.camera = reader.TakeText(kMaxKeyBytes);
    refusal.reason = TakeReason(reader);
    refusal.count = reader.Take<uint64_t>();
    refusal.example = reader.TakeText(kMaxExampleBytes);
  }
  if (reader.Take<uint8_t>() != 0) {
    FrameCounts& frames = report.frames.emplace();
    for (uint64_t* count : {&frames.received, &frames.damaged, &frames.lost, &frames.reconnects}) {
      *count = reader.Take<uint64_t>();
    }
  }
  if (reader.Take<uint8_t>() != 0) {
    DetectionCounts& detections = report.detections.emplace();
    for (const DetectionOutcome outcome : kDetectionOutcomes) {
      detections.Add(outcome, reader.Take<uint64_t>());
    }
  }
  return report;
}

void PutStream(const DiskStream& stream, std::string* out) {
  PutNumber(stream.number, out);
  PutText(stream.stream.session_id, out);
  PutText(stream.stream.camera, out);
  PutNumber(stream.stream.stream_epoch, out);
  for (const uint32_t number : {stream.marker_count, stream.begin_seq, stream.durable_seq,
                                stream.synced_seq, stream.end_seq}) {
    PutNumber(number, out);
  }
  PutNumber(stream.boot, out);
  PutNumber(static_cast<uint32_t>(stream.gaps.size()), out);
  for (const SpoolGap& gap : stream.gaps) {
    PutNumber(gap.first, out);
    PutNumber(gap.end, out);
    PutNumber(static_cast<uint32_t>(gap.reason), out);
  }
  PutNumber(static_cast<uint32_t>(stream.dropped.size()), out);
  for (const auto& [reason, count] : stream.dropped) {
    PutNumber(static_cast<uint32_t>(reason), out);
    PutNumber(count, out);
  }
  PutNumber(uint8_t{stream.end.has_value()}, out);
  if (!stream.end) return;
  PutNumber(stream.end->last_seq, out);
  PutNumber(static_cast<uint8_t>((stream.end->interrupted ? kInterrupted : 0) |
                                 (stream.end_is_unknown ? kEndIsUnknown : 0)),
            out);
  PutReport(stream.end->report, out);
}

DiskStream TakeStream(ByteReader& reader) {
  DiskStream stream;
  stream.number = reader.Take<uint32_t>();
  stream.stream.session_id = reader.TakeText(kMaxKeyBytes);
  stream.stream.camera = reader.TakeText(kMaxKeyBytes);
  stream.stream.stream_epoch = reader.Take<uint32_t>();
  for (uint32_t* number : {&stream.marker_count, &stream.begin_seq, &stream.durable_seq,
                           &stream.synced_seq, &stream.end_seq}) {
    *number = reader.Take<uint32_t>();
  }
  stream.boot = reader.Take<uint64_t>();
  for (uint32_t left = TakeCount(reader); left > 0 && reader.ok(); --left) {
    SpoolGap& gap = stream.gaps.emplace_back();
    gap.first = reader.Take<uint32_t>();
    gap.end = reader.Take<uint32_t>();
    gap.reason = TakeReason(reader);
  }
  for (uint32_t left = TakeCount(reader); left > 0 && reader.ok(); --left) {
    const RefusalReason reason = TakeReason(reader);
    stream.dropped[reason] += reader.Take<uint64_t>();
  }
  if (reader.Take<uint8_t>() == 0) return stream;
  EndOfCapture& end = stream.end.emplace();
  end.stream = stream.stream;
  end.last_seq = reader.Take<uint32_t>();
  const auto flags = reader.Take<uint8_t>();
  end.interrupted = (flags & kInterrupted) != 0;
  stream.end_is_unknown = (flags & kEndIsUnknown) != 0;
  end.report = TakeReport(reader);
  end.report.stream = stream.stream;
  return stream;
}

// The checksum is right, but a file of another make must not lead to overflows.
bool IsPlausible(const DiskStream& stream) {
  if (stream.number == 0 || stream.stream.stream_epoch == 0 || stream.begin_seq == 0 ||
      stream.end_seq < stream.begin_seq || stream.end_seq > kMaxSeq ||
      stream.durable_seq < stream.begin_seq - 1 || stream.durable_seq >= stream.end_seq ||
      stream.synced_seq >= stream.end_seq || stream.marker_count == 0 ||
      stream.marker_count > uint32_t{kMaxMarkers} ||
      (stream.end && stream.end->last_seq != stream.end_seq - 1)) {
    return false;
  }
  uint32_t next = stream.durable_seq + 1;
  for (const SpoolGap& gap : stream.gaps) {
    if (gap.first < next || gap.end <= gap.first || gap.end > stream.end_seq) return false;
    next = gap.end;
  }
  return true;
}

}  // namespace

std::string EncodeCheckpoint(const SpoolCheckpoint& checkpoint) {
  std::string body;
  PutNumber(checkpoint.last_stream_number, &body);
  PutNumber(checkpoint.last_ordinal, &body);
  PutNumber(static_cast<uint32_t>(checkpoint.streams.size()), &body);
  for (const DiskStream& stream : checkpoint.streams) PutStream(stream, &body);
  std::string bytes(kCheckpointMagic);
  PutNumber(static_cast<uint32_t>(body.size()), &bytes);
  PutNumber(SpoolChecksum(body), &bytes);
  return bytes + body;
}

std::optional<SpoolCheckpoint> DecodeCheckpoint(std::string_view bytes) {
  if (bytes.size() < kCheckpointPrefix || !bytes.starts_with(kCheckpointMagic)) return std::nullopt;
  ByteReader prefix(bytes.substr(kCheckpointMagic.size(), 8));
  const auto size = prefix.Take<uint32_t>();
  const auto checksum = prefix.Take<uint32_t>();
  const std::string_view body = bytes.substr(kCheckpointPrefix);
  if (size != body.size() || SpoolChecksum(body) != checksum) return std::nullopt;
  ByteReader reader(body);
  SpoolCheckpoint checkpoint;
  checkpoint.last_stream_number = reader.Take<uint32_t>();
  checkpoint.last_ordinal = reader.Take<uint64_t>();
  for (uint32_t left = TakeCount(reader); left > 0 && reader.ok(); --left) {
    DiskStream stream = TakeStream(reader);
    if (!reader.ok() || !IsPlausible(stream)) return std::nullopt;
    stream.CountRows();
    checkpoint.streams.push_back(std::move(stream));
  }
  if (!reader.complete()) return std::nullopt;
  return checkpoint;
}

}  // namespace rigcal::agent
