// SPDX-License-Identifier: Apache-2.0
#include "agent/spool/disk/disk_stream.h"

#include <algorithm>
#include <optional>

#include "agent/spool/disk/segment_scanner.h"

namespace rigcal::agent {

uint64_t DiskStream::AddGap(uint32_t first, uint32_t past, RefusalReason reason) {
  first = std::max(first, durable_seq + 1);
  uint64_t added = 0;
  std::vector<SpoolGap> merged;
  const auto add = [&](uint32_t from, uint32_t to) {
    if (from >= to) return;
    added += to - from;
    if (!merged.empty() && merged.back().end == from && merged.back().reason == reason) {
      merged.back().end = to;
    } else {
      merged.push_back({from, to, reason});
    }
  };
  // The parts of [first, past) between the gaps that are known.
  for (const SpoolGap& gap : gaps) {
    if (gap.end > first && gap.first < past) {
      add(first, std::min(gap.first, past));
      first = std::max(first, gap.end);
    } else if (gap.first >= past) {
      add(first, past);
      first = past;
    }
    if (!merged.empty() && merged.back().end == gap.first && merged.back().reason == gap.reason) {
      merged.back().end = gap.end;
    } else {
      merged.push_back(gap);
    }
  }
  add(first, past);
  gaps = std::move(merged);
  ahead = {};
  if (added > 0) dropped[reason] += added;
  CountRows();
  return added;
}

void DiskStream::SetDurable(uint32_t now_durable_seq) {
  durable_seq = std::max(durable_seq, std::min(now_durable_seq, end_seq - 1));
  std::erase_if(gaps, [this](const SpoolGap& gap) { return gap.end <= durable_seq + 1; });
  if (!gaps.empty()) gaps.front().first = std::max(gaps.front().first, durable_seq + 1);
  CountRows();
}

void DiskStream::CountRows() {
  row_count = end_seq - 1 - durable_seq;
  for (const SpoolGap& gap : gaps) row_count -= gap.end - gap.first;
}

const SpoolGap* DiskStream::GapAt(uint32_t seq) const {
  const auto found = std::ranges::find_if(
      gaps, [seq](const SpoolGap& gap) { return gap.first <= seq && seq < gap.end; });
  return found == gaps.end() ? nullptr : &*found;
}

namespace {

constexpr size_t kMinPieceBytes = 4096;

// The segment that holds `seq`, or the next one behind it.
const Segment* SegmentAt(const DiskStream& stream, uint32_t seq) {
  const auto found = std::ranges::find_if(
      stream.segments, [seq](const Segment& segment) { return seq < segment.end_seq; });
  return found == stream.segments.end() ? nullptr : &*found;
}

// A scanner that stands at `seq` or before it, for about `rows` rows. Null: the file cannot be
// opened.
std::optional<SegmentScanner> ScannerAt(FileSystem& files, DiskStream& stream,
                                        const Segment& segment, uint32_t seq, size_t rows) {
  DiskStream::Cursor& cursor = stream.cursor;
  if (cursor.ordinal != segment.ordinal || stream.cursor_file == nullptr) {
    stream.cursor_file = segment.file;
    if (stream.cursor_file == nullptr) {
      absl::StatusOr<std::shared_ptr<SpoolFile>> opened = files.Open(segment.path);
      if (!opened.ok()) return std::nullopt;
      stream.cursor_file = *std::move(opened);
    }
    cursor = {.ordinal = segment.ordinal};
  }
  if (cursor.next_seq != seq) return SegmentScanner(stream.cursor_file, 0);
  const uint64_t row_bytes = segment.bytes / (segment.end_seq - segment.first_seq) + 1;
  return SegmentScanner(stream.cursor_file, cursor.offset,
                        std::clamp<size_t>(rows * row_bytes, kMinPieceBytes, kMaxRecordBytes));
}

// How many rows are wanted, and how many may be read ahead with them, as long as those have no
// clock samples.
struct RowLimits {
  size_t wanted = 1;
  size_t most = 1;
};

// Rows from `batch->first_seq` on out of one segment. Returns the number up to which nothing can be
// read: batch->first_seq where there are rows, or nothing is missing in front of what follows.
uint32_t ReadSegment(FileSystem& files, DiskStream& stream, const Segment& segment,
                     RowLimits limits, ObservationBatch* batch) {
  const uint32_t from = batch->first_seq;
  std::optional<SegmentScanner> scanner = ScannerAt(files, stream, segment, from, limits.most);
  if (!scanner) return segment.end_seq;
  uint32_t expected = from;
  uint64_t offset = scanner->offset();
  SpooledObservation row;
  while (batch->rows() < limits.most && expected < segment.end_seq) {
    const std::optional<RecordView> record = scanner->Next();
    if (!record) break;
    if (record->seq < expected) {
      if (expected == from) offset = scanner->offset();
      continue;
    }
    // Behind the segment's end only where its name or header is wrong.
    if (record->seq >= segment.end_seq) break;
    const bool is_row =
        record->seq == expected && DecodePayload(record->payload, stream.marker_count, &row);
    if (!is_row && batch->rows() > 0) break;
    if (!is_row) return std::max(record->seq, expected + 1);
    if (batch->rows() == 0) {
      batch->clock_epoch = row.observation.clock_epoch;
      batch->Reserve(std::min<size_t>(limits.most, segment.end_seq - expected));
    } else if (batch->clock_epoch != row.observation.clock_epoch) {
      break;
    }
    if (batch->rows() >= limits.wanted && !row.clock_samples.empty()) break;
    batch->Append(row.observation);
    batch->clock_samples.insert(batch->clock_samples.end(), row.clock_samples.begin(),
                                row.clock_samples.end());
    offset = scanner->offset();
    ++expected;
  }
  if (batch->rows() == 0) return std::min(segment.end_seq, stream.end_seq);
  stream.cursor.next_seq = expected;
  stream.cursor.offset = offset;
  return from;
}

// ReadStream, from the files; rows read ahead are behind the others.
ObservationBatch ReadFiles(FileSystem& files, DiskStream& stream, uint32_t from_seq,
                           size_t max_rows, uint64_t* newly_lost) {
  ObservationBatch batch;
  batch.stream = stream.stream;
  batch.marker_count = stream.marker_count;
  batch.first_seq = from_seq;
  const auto drop_up_to = [&](uint32_t end, RefusalReason reason) {
    batch.dropped.push_back(
        {.first_seq = batch.first_seq, .count = end - batch.first_seq, .reason = reason});
    batch.first_seq = end;
  };
  if (from_seq >= stream.end_seq) return batch;
  if (from_seq <= stream.durable_seq && from_seq < stream.first_seq) {
    drop_up_to(std::min(stream.first_seq, stream.durable_seq + 1), RefusalReason::kSpoolFreed);
  }
  if (const SpoolGap* gap = stream.GapAt(batch.first_seq)) drop_up_to(gap->end, gap->reason);
  // Numbers that will not come are told on their own; the rows follow with the next call.
  if (!batch.dropped.empty()) return batch;
  uint32_t limit = stream.end_seq;
  for (const SpoolGap& gap : stream.gaps) {
    if (gap.first > from_seq) limit = std::min(limit, gap.first);
  }
  uint32_t readable_from = limit;
  if (const Segment* segment = SegmentAt(stream, from_seq)) {
    readable_from = std::max(from_seq, segment->first_seq);
    if (readable_from == from_seq) {
      const RowLimits limits{
          .wanted = max_rows,
          .most = std::min<size_t>(std::max(max_rows, kRowsAhead), limit - from_seq)};
      readable_from = ReadSegment(files, stream, *segment, limits, &batch);
    }
  }
  readable_from = std::min(readable_from, limit);
  if (readable_from > from_seq) {
    *newly_lost += stream.AddGap(from_seq, readable_from, RefusalReason::kSpoolDamaged);
    drop_up_to(readable_from, RefusalReason::kSpoolDamaged);
  }
  return batch;
}

}  // namespace

ObservationBatch ReadStream(FileSystem& files, DiskStream& stream, uint32_t from_seq,
                            size_t max_rows, uint64_t* newly_lost) {
  const ObservationBatch& ahead = stream.ahead;
  if (from_seq >= ahead.first_seq && from_seq < ahead.end_seq()) {
    const size_t begin = from_seq - ahead.first_seq;
    return ahead.Slice(begin, std::min(begin + max_rows, ahead.rows()));
  }
  stream.ahead = {};
  ObservationBatch batch = ReadFiles(files, stream, from_seq, max_rows, newly_lost);
  if (batch.rows() <= max_rows) return batch;
  stream.ahead = batch.Slice(max_rows, batch.rows());
  return batch.Slice(0, max_rows);
}

}  // namespace rigcal::agent
