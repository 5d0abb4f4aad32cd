// SPDX-License-Identifier: Apache-2.0
#include "agent/spool/disk/segment_format.h"

#include <algorithm>
#include <array>

#include "absl/strings/numbers.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_split.h"
#include "absl/strings/strip.h"
#include "agent/spool/disk/byte_format.h"
#include "common/target/target.h"

namespace rigcal::agent {
namespace {

constexpr std::string_view kMagic = "RCSPOOL1";
constexpr std::string_view kSyncWord = "\xa5RC1";
constexpr size_t kMaxNameBytes = 256;
constexpr size_t kSampleBytes = 28;
constexpr size_t kLightBytes = 12;  // of a sample, behind all of them; not in older segments
constexpr size_t kMaxSamples = 1024;
static_assert(kMaxSamples * (kSampleBytes + kLightBytes) + 4096 < kMaxRecordBytes);

}  // namespace

std::string EncodeHeader(const SegmentHeader& header) {
  std::string body;
  PutNumber(header.stream_number, &body);
  PutText(header.stream.session_id, &body);
  PutText(header.stream.camera, &body);
  PutNumber(header.stream.stream_epoch, &body);
  PutNumber(header.marker_count, &body);
  PutNumber(header.begin_seq, &body);
  PutNumber(header.first_seq, &body);
  PutNumber(header.boot, &body);
  std::string bytes(kMagic);
  PutNumber(static_cast<uint32_t>(body.size()), &bytes);
  PutNumber(SpoolChecksum(body), &bytes);
  return bytes + body;
}

std::optional<SegmentHeader> DecodeHeader(std::string_view bytes, size_t* size) {
  constexpr size_t kPrefix = kMagic.size() + 8;
  if (bytes.size() < kPrefix || !bytes.starts_with(kMagic)) return std::nullopt;
  ByteReader prefix(bytes.substr(kMagic.size(), 8));
  const auto body_size = prefix.Take<uint32_t>();
  const auto checksum = prefix.Take<uint32_t>();
  if (body_size > kMaxHeaderBytes - kPrefix || body_size > bytes.size() - kPrefix) {
    return std::nullopt;
  }
  const std::string_view body = bytes.substr(kPrefix, body_size);
  if (SpoolChecksum(body) != checksum) return std::nullopt;
  ByteReader reader(body);
  SegmentHeader header;
  header.stream_number = reader.Take<uint32_t>();
  header.stream.session_id = reader.TakeText(kMaxNameBytes);
  header.stream.camera = reader.TakeText(kMaxNameBytes);
  header.stream.stream_epoch = reader.Take<uint32_t>();
  header.marker_count = reader.Take<uint32_t>();
  header.begin_seq = reader.Take<uint32_t>();
  header.first_seq = reader.Take<uint32_t>();
  header.boot = reader.Take<uint64_t>();
  const bool plausible = header.stream.stream_epoch >= 1 && header.begin_seq >= 1 &&
                         header.first_seq >= header.begin_seq && header.first_seq <= kMaxSeq &&
                         header.marker_count >= 1 && header.marker_count <= uint32_t{kMaxMarkers};
  if (!reader.complete() || !plausible) return std::nullopt;
  *size = kPrefix + body_size;
  return header;
}

static_assert(kMaxMarkers <= 255, "their number is a byte");
// Which markers of a record are visible: one word, and one more for every 32 markers beyond 32.
using VisibleMasks = std::array<uint32_t, 8>;
static size_t MaskWords(size_t marker_count) {
  return std::max<size_t>(1, (marker_count + 31) / 32);
}

void EncodeRecord(uint32_t seq, const Observation& observation,
                  const std::vector<ClockSample>& clock_samples, std::string* out) {
  const size_t begin = out->size();
  out->append(kRecordPrefixBytes, '\0');
  const size_t payload_begin = out->size();
  PutNumber(observation.clock_epoch, out);
  PutNumber(observation.time_ns, out);
  VisibleMasks masks{};
  const size_t marker_count = observation.markers.size();
  for (size_t m = 0; m < marker_count; ++m) {
    masks[m / 32] |= uint32_t{observation.markers[m].visible} << m % 32;
  }
  PutNumber(static_cast<uint8_t>(marker_count), out);
  for (size_t word = 0; word < MaskWords(marker_count); ++word) PutNumber(masks[word], out);
  for (const MarkerObservation& marker : observation.markers) {
    if (!marker.visible) continue;
    for (const double value :
         {marker.centre_px.x(), marker.centre_px.y(), marker.covariance_px2(0, 0),
          marker.covariance_px2(0, 1), marker.covariance_px2(1, 1)}) {
      PutNumber(static_cast<float>(value), out);
    }
    PutNumber(marker.time_delta_ns, out);
    PutNumber(marker.label_confidence, out);
    PutNumber(static_cast<uint8_t>(marker.centre_kind), out);
  }
  const size_t samples = std::min(clock_samples.size(), kMaxSamples);
  PutNumber(static_cast<uint16_t>(samples), out);
  for (size_t i = 0; i < samples; ++i) {
    PutNumber(clock_samples[i].device_ns, out);
    PutNumber(clock_samples[i].host_monotonic_ns, out);
    PutNumber(clock_samples[i].host_utc_ns, out);
    PutNumber(clock_samples[i].uncertainty_ns, out);
  }
  for (size_t i = 0; i < samples; ++i) {
    PutNumber(clock_samples[i].light, out);
    PutNumber(clock_samples[i].light_ns, out);
  }
  const size_t payload_size = out->size() - payload_begin;
  std::string prefix(kSyncWord);
  PutNumber(static_cast<uint32_t>(payload_size), &prefix);
  std::memcpy(out->data() + begin + 12, &seq, 4);
  PutNumber(SpoolChecksum(std::string_view(*out).substr(begin + 12)), &prefix);
  std::copy(prefix.begin(), prefix.end(), out->begin() + static_cast<std::ptrdiff_t>(begin));
}

bool DecodePayload(std::string_view payload, uint32_t marker_count, SpooledObservation* row) {
  ByteReader reader(payload);
  Observation& observation = row->observation;
  row->clock_samples.clear();
  observation.clock_epoch = reader.Take<uint32_t>();
  observation.time_ns = reader.Take<int64_t>();
  const auto markers = reader.Take<uint8_t>();
  if (!reader.ok() || markers != marker_count || markers == 0 || markers > kMaxMarkers) {
    return false;
  }
  VisibleMasks masks{};
  const size_t words = MaskWords(markers);
  for (size_t word = 0; word < words; ++word) masks[word] = reader.Take<uint32_t>();
  if (!reader.ok() || uint64_t{masks[words - 1]} >> (markers - 32 * (words - 1)) != 0) return false;
  observation.markers.assign(markers, {});
  for (uint32_t m = 0; m < markers; ++m) {
    if ((masks[m / 32] >> m % 32 & 1u) == 0) continue;
    MarkerObservation& marker = observation.markers[m];
    marker.visible = true;
    marker.centre_px.x() = reader.Take<float>();
    marker.centre_px.y() = reader.Take<float>();
    const auto xx = reader.Take<float>();
    const auto xy = reader.Take<float>();
    const auto yy = reader.Take<float>();
    marker.covariance_px2 << xx, xy, xy, yy;
    marker.time_delta_ns = reader.Take<int32_t>();
    marker.label_confidence = reader.Take<float>();
    const auto kind = reader.Take<uint8_t>();
    if (kind != static_cast<uint8_t>(CentreKind::kImageBlob) &&
        kind != static_cast<uint8_t>(CentreKind::kSphereCentre)) {
      return false;
    }
    marker.centre_kind = CentreKind{kind};
  }
  const auto samples = reader.Take<uint16_t>();
  const bool has_lights = reader.left() != samples * kSampleBytes;
  if (has_lights && reader.left() != samples * (kSampleBytes + kLightBytes)) return false;
  for (uint16_t i = 0; i < samples; ++i) {
    ClockSample& sample = row->clock_samples.emplace_back();
    sample.device_ns = reader.Take<int64_t>();
    sample.host_monotonic_ns = reader.Take<int64_t>();
    sample.host_utc_ns = reader.Take<int64_t>();
    sample.uncertainty_ns = reader.Take<uint32_t>();
  }
  for (uint16_t i = 0; has_lights && i < samples; ++i) {
    row->clock_samples[i].light = reader.Take<uint32_t>();
    row->clock_samples[i].light_ns = reader.Take<int64_t>();
  }
  return reader.complete();
}

std::optional<RecordView> RecordAtFront(std::string_view bytes) {
  if (bytes.size() < kRecordPrefixBytes || !bytes.starts_with(kSyncWord)) return std::nullopt;
  ByteReader reader(bytes.substr(kSyncWord.size()));
  const auto size = reader.Take<uint32_t>();
  const auto checksum = reader.Take<uint32_t>();
  const auto seq = reader.Take<uint32_t>();
  if (size > kMaxRecordBytes || size > bytes.size() - kRecordPrefixBytes || seq == 0 ||
      seq > kMaxSeq || SpoolChecksum(bytes.substr(12, 4 + size)) != checksum) {
    return std::nullopt;
  }
  return RecordView{.seq = seq,
                    .payload = bytes.substr(kRecordPrefixBytes, size),
                    .size = kRecordPrefixBytes + size};
}

bool MayContinue(std::string_view bytes) {
  if (!bytes.starts_with(kSyncWord.substr(0, std::min(bytes.size(), kSyncWord.size())))) {
    return false;
  }
  if (bytes.size() < kRecordPrefixBytes) return true;
  ByteReader reader(bytes.substr(kSyncWord.size()));
  const auto size = reader.Take<uint32_t>();
  return size <= kMaxRecordBytes && size > bytes.size() - kRecordPrefixBytes;
}

size_t NextCandidate(std::string_view bytes, size_t from) {
  const size_t found = bytes.find(kSyncWord, from);
  if (found != std::string_view::npos) return found;
  // The word may begin at the end.
  const size_t tail = bytes.size() < kSyncWord.size() ? 0 : bytes.size() - kSyncWord.size() + 1;
  return std::max(from, tail);
}

std::string FormatSegmentName(const SegmentName& name) {
  return absl::StrFormat("%010u-%06u-%010u.seg", name.ordinal, name.stream_number, name.first_seq);
}

std::optional<SegmentName> ParseSegmentName(std::string_view text) {
  absl::string_view rest(text.data(), text.size());
  if (!absl::ConsumeSuffix(&rest, ".seg")) return std::nullopt;
  const std::vector<absl::string_view> parts = absl::StrSplit(rest, '-');
  SegmentName name;
  if (parts.size() != 3 || !absl::SimpleAtoi(parts[0], &name.ordinal) ||
      !absl::SimpleAtoi(parts[1], &name.stream_number) ||
      !absl::SimpleAtoi(parts[2], &name.first_seq) || name.first_seq == 0 ||
      name.first_seq > kMaxSeq || name.stream_number == 0) {
    return std::nullopt;
  }
  return name;
}

}  // namespace rigcal::agent
