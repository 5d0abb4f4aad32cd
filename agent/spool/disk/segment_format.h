// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/session/observation_batch.h"
#include "common/session/stream_key.h"
#include "common/target/observation.h"
#include "common/time/clock.h"

namespace rigcal::agent {

// A segment is a file of one stream's observations with consecutive numbers:
//   header: magic, size and checksum of the rest, then SegmentHeader
//   records: sync word (4 bytes), size of the payload (4), checksum of number and payload (4),
//            number (4), payload
// The sync word is where reading goes on behind damaged bytes.

// Which stream a segment is of.
struct SegmentHeader {
  uint32_t stream_number = 0;  // within the spool; a stream that is opened again gets another one
  StreamKey stream;
  uint32_t marker_count = 0;
  uint32_t begin_seq = 1;  // of the stream
  uint32_t first_seq = 1;  // of the segment
  uint64_t boot = 0;       // the run of the operating system that the rows' host times belong to

  friend bool operator==(const SegmentHeader&, const SegmentHeader&) = default;
};

// More than any header has.
inline constexpr size_t kMaxHeaderBytes = 1024;
inline constexpr size_t kRecordPrefixBytes = 16;
// A segment is full at this size. A longer file is none that an agent has written.
inline constexpr uint64_t kMaxSegmentBytes = uint64_t{8} << 20;
// Of a record; more clock samples than fit are left out.
inline constexpr size_t kMaxRecordBytes = size_t{64} << 10;

std::string EncodeHeader(const SegmentHeader& header);
// `bytes`: the beginning of a file. None: damaged. `*size`: where the records begin.
std::optional<SegmentHeader> DecodeHeader(std::string_view bytes, size_t* size);

// What a record holds.
struct SpooledObservation {
  Observation observation;
  std::vector<ClockSample> clock_samples;
};

// Appends a record to `*out`. Values become 32-bit floats, as on the wire.
void EncodeRecord(uint32_t seq, const Observation& observation,
                  const std::vector<ClockSample>& clock_samples, std::string* out);
// Into `*row`, whose memory is used again. False: it is none of `marker_count` markers.
bool DecodePayload(std::string_view payload, uint32_t marker_count, SpooledObservation* row);

// A record found in bytes of a segment.
struct RecordView {
  uint32_t seq = 0;
  std::string_view payload;
  size_t size = 0;  // of the whole record
};
// The intact record that begins at the front of `bytes`. None: there is none, or not all of it.
std::optional<RecordView> RecordAtFront(std::string_view bytes);
// `bytes` could be the beginning of a record that is longer than they are.
bool MayContinue(std::string_view bytes);
// Position of the next place where a record may begin, from `from` on; size() - 3 at most.
size_t NextCandidate(std::string_view bytes, size_t from);

// Files of the spool: "0000000012-000003-0000000257.seg" is the 12th segment, of stream number 3,
// from observation 257 on. The name tells what a damaged header does not.
struct SegmentName {
  uint64_t ordinal = 0;  // in order of creation over all streams
  uint32_t stream_number = 0;
  uint32_t first_seq = 0;
};
std::string FormatSegmentName(const SegmentName& name);
std::optional<SegmentName> ParseSegmentName(std::string_view text);

}  // namespace rigcal::agent
