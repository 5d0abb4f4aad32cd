// SPDX-License-Identifier: Apache-2.0
#include "agent/spool/disk/spool_recovery.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <optional>
#include <tuple>
#include <utility>

#include "absl/strings/str_cat.h"
#include "agent/spool/disk/checkpoint.h"
#include "agent/spool/disk/segment_format.h"
#include "agent/spool/disk/segment_scanner.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

struct FoundSegment {
  SegmentName name;
  Segment segment;
  std::optional<SegmentHeader> header;  // none: damaged
  bool is_cut = false;                  // it was longer than any segment
};

// What stands at the end of a stream's last segment.
struct SegmentEnd {
  uint32_t intact_end = 1;  // one past the last intact record
  uint32_t end = 1;         // with the damaged ones behind it, as far as they can be counted
};

class Recovery {
 public:
  Recovery(FileSystem& files, const std::string& folder, const StreamEnds& ends, uint64_t boot)
      : files_(files), folder_(folder), ends_(ends), boot_(boot) {}

  absl::StatusOr<RecoveredSpool> Run() {
    RIGCAL_RETURN_IF_ERROR(ListSegments());
    for (auto& [number, stream] : by_number_) {
      // Without segments; those are added below.
      segments_.try_emplace(number);
    }
    for (auto& [number, found] : segments_) {
      RIGCAL_RETURN_IF_ERROR(RecoverStream(number, std::move(found)));
    }
    for (const auto& [key, stream] : result_.streams) {
      for (const auto& [reason, count] : stream.dropped) result_.dropped[reason] += count;
    }
    return std::move(result_);
  }

 private:
  absl::Status ListSegments() {
    RIGCAL_ASSIGN_OR_RETURN(const auto entries, files_.List(folder_));
    for (const FileSystem::Entry& entry : entries) {
      if (entry.name == kCheckpointFile) ReadCheckpoint(entry.size);
      if (entry.name == kReserveFile) result_.has_reserve = true;
      if (entry.name == kNewCheckpointFile) {
        RIGCAL_RETURN_IF_ERROR(files_.Remove(absl::StrCat(folder_, "/", entry.name)));
      }
      const std::optional<SegmentName> name = ParseSegmentName(entry.name);
      if (!name) continue;
      const uint64_t size = CutTo(kMaxSegmentBytes, entry);
      segments_[name->stream_number].push_back(
          {.name = *name,
           .segment = {.ordinal = name->ordinal,
                       .first_seq = name->first_seq,
                       .end_seq = name->first_seq,
                       .bytes = size,
                       .path = absl::StrCat(folder_, "/", entry.name),
                       .file = nullptr},
           .header = std::nullopt,
           .is_cut = size < entry.size});
      result_.bytes += size;
      result_.last_ordinal = std::max(result_.last_ordinal, name->ordinal);
      result_.last_stream_number = std::max(result_.last_stream_number, name->stream_number);
    }
    return absl::OkStatus();
  }

  // A segment's file that is longer than any, by holes or by what others wrote into it: the rest is
  // damage, takes no room in the spool, and is not read.
  uint64_t CutTo(uint64_t size, const FileSystem::Entry& entry) {
    if (entry.size <= size) return entry.size;
    const std::string path = absl::StrCat(folder_, "/", entry.name);
    const auto file = files_.Open(path);
    const absl::Status cut = file.ok() ? (*file)->Truncate(size) : file.status();
    spdlog::error("spool: {} is damaged: it has {} MiB, and no segment has more than {} MiB; {}",
                  path, entry.size >> 20, size >> 20,
                  cut.ok() ? "the rest is cut off" : std::string(cut.message()));
    return size;
  }

  void ReadCheckpoint(uint64_t size) {
    std::optional<SpoolCheckpoint> checkpoint;
    const auto file = files_.Open(absl::StrCat(folder_, "/", kCheckpointFile));
    if (file.ok() && size <= kMaxCheckpointBytes) {
      const auto bytes = (*file)->ReadAt(0, size);
      if (bytes.ok()) checkpoint = DecodeCheckpoint(*bytes);
    }
    if (!checkpoint) {
      spdlog::error(
          "spool {}: the checkpoint is damaged; everything in the segments is sent again, and the "
          "server knows what it has",
          folder_);
      return;
    }
    discarded_up_to_ = checkpoint->last_stream_number;
    result_.last_stream_number =
        std::max(result_.last_stream_number, checkpoint->last_stream_number);
    result_.last_ordinal = std::max(result_.last_ordinal, checkpoint->last_ordinal);
    for (DiskStream& stream : checkpoint->streams) {
      by_number_.insert_or_assign(stream.number, std::move(stream));
    }
  }

  void Doom(std::vector<FoundSegment> found) {
    for (FoundSegment& one : found) result_.doomed.push_back(std::move(one.segment));
  }

  absl::Status RecoverStream(uint32_t number, std::vector<FoundSegment> found) {
    const auto known = by_number_.find(number);
    if (known == by_number_.end() && number <= discarded_up_to_) {
      Doom(std::move(found));
      return absl::OkStatus();
    }
    std::ranges::sort(found, {}, [](const FoundSegment& one) {
      return std::tuple(one.name.first_seq, one.name.ordinal);
    });
    for (FoundSegment& one : found) ReadHeader(one);
    DiskStream stream;
    if (known != by_number_.end()) {
      stream = std::move(known->second);
    } else if (!FromHeaders(found, &stream)) {
      CountUnknown(std::move(found));
      return absl::OkStatus();
    }
    RIGCAL_RETURN_IF_ERROR(AddSegments(std::move(found), &stream));
    Keep(std::move(stream));
    return absl::OkStatus();
  }

  void ReadHeader(FoundSegment& one) {
    const auto file = files_.Open(one.segment.path);
    const auto bytes = file.ok() ? (*file)->ReadAt(0, kMaxHeaderBytes) : file.status();
    size_t size = 0;
    if (bytes.ok()) one.header = DecodeHeader(*bytes, &size);
    const bool fits = one.header && one.header->stream_number == one.name.stream_number &&
                      one.header->first_seq == one.name.first_seq;
    if (fits) return;
    one.header.reset();
    spdlog::error("spool: the header of {} is damaged", one.segment.path);
  }

  static bool FromHeaders(const std::vector<FoundSegment>& found, DiskStream* stream) {
    for (const FoundSegment& one : found) {
      if (!one.header) continue;
      stream->stream = one.header->stream;
      stream->number = one.header->stream_number;
      stream->marker_count = one.header->marker_count;
      stream->begin_seq = one.header->begin_seq;
      stream->boot = one.header->boot;
      // Older segments are gone only after they were acknowledged.
      stream->durable_seq = std::max(found.front().name.first_seq, stream->begin_seq) - 1;
      stream->end_seq = stream->durable_seq + 1;
      return true;
    }
    return false;
  }

  // Segments of a stream that nothing names any more.
  void CountUnknown(std::vector<FoundSegment> found) {
    uint64_t lost = 0;
    for (const FoundSegment& one : found) {
      uint64_t records = 0;
      if (const auto file = files_.Open(one.segment.path); file.ok()) {
        SegmentScanner scanner(*file, 0);
        while (scanner.Next()) ++records;
      }
      lost += std::max<uint64_t>(records, 1);
    }
    if (lost == 0) return;
    spdlog::error("spool {}: {} observations are lost: nothing tells of which camera they are",
                  folder_, lost);
    result_.dropped[RefusalReason::kSpoolDamaged] += lost;
    Doom(std::move(found));
  }

  static SegmentEnd FindEnd(const FoundSegment& last, const std::shared_ptr<SpoolFile>& file) {
    SegmentEnd end{.intact_end = last.name.first_seq, .end = last.name.first_seq};
    SegmentScanner scanner(file, 0);
    uint64_t records = 0, bytes = 0;
    while (const std::optional<RecordView> record = scanner.Next()) {
      ++records;
      bytes += record->size;
      if (record->seq < end.intact_end || record->seq >= kMaxSeq) continue;
      end.intact_end = record->seq + 1;
    }
    end.end = end.intact_end;
    uint64_t tail = scanner.tail_bytes();
    // Nothing but a header: not a record.
    if (records == 0 && last.header) {
      const uint64_t header = EncodeHeader(*last.header).size();
      tail = last.segment.bytes > header ? last.segment.bytes - header : 0;
    }
    if (tail == 0) return end;
    // The size of a file that was cut tells nothing of how many there were.
    if (last.is_cut) tail = 1;
    const uint64_t usual = records == 0 ? tail : std::max<uint64_t>(1, bytes / records);
    const uint64_t lost = std::max<uint64_t>(1, (tail + usual / 2) / usual);
    end.end = static_cast<uint32_t>(std::min<uint64_t>(end.end + lost, kMaxSeq));
    return end;
  }

  absl::Status AddSegments(std::vector<FoundSegment> found, DiskStream* stream) {
    SegmentEnd end{.intact_end = stream->durable_seq + 1, .end = stream->durable_seq + 1};
    for (size_t i = 0; i < found.size(); ++i) {
      Segment& segment = found[i].segment;
      if (i + 1 < found.size()) {
        segment.end_seq = found[i + 1].name.first_seq;
      } else if (const auto file = files_.Open(segment.path); file.ok()) {
        // What the operating system had when the agent ended must not be taken for synced.
        RIGCAL_RETURN_IF_ERROR((*file)->Sync());
        end = FindEnd(found[i], *file);
        segment.end_seq = end.intact_end;
      }
      stream->segments.push_back(std::move(segment));
    }
    stream->is_of_other_boot = boot_ == 0 || stream->boot != boot_;
    uint32_t known_end = stream->end ? stream->end->last_seq + 1 : stream->synced_seq + 1;
    // Numbers up to a gap were given, even if no row in front of it reached the disk.
    if (!stream->gaps.empty()) known_end = std::max(known_end, stream->gaps.back().end);
    if (!stream->end) {
      const std::optional<uint32_t> written =
          stream->is_of_other_boot ? std::nullopt : ends_.Read(stream->number);
      stream->end_is_unknown = !written;
      known_end = std::max(known_end, written ? std::max(*written, end.intact_end) : end.end);
    }
    stream->end_seq = std::max(stream->durable_seq + 1, known_end);
    const uint32_t first =
        stream->segments.empty() ? stream->end_seq : stream->segments.front().first_seq;
    uint64_t lost = 0;
    for (const auto& [from, to] :
         {std::pair{stream->durable_seq + 1, first}, std::pair{end.intact_end, stream->end_seq}}) {
      if (from < to) lost += stream->AddGap(from, to, RefusalReason::kSpoolDamaged);
    }
    if (lost > 0) {
      spdlog::error("camera {}: {} observations of session {} are lost: the spool is damaged",
                    stream->stream.camera, lost, stream->stream.session_id);
    }
    stream->synced_seq = stream->end_seq - 1;
    if (!stream->end) {
      EndOfCapture& interrupted = stream->end.emplace();
      interrupted.stream = interrupted.report.stream = stream->stream;
      interrupted.last_seq = stream->end_seq - 1;
      interrupted.interrupted = true;
    }
    if (stream->end_is_unknown) {
      spdlog::error(
          "camera {}: nothing tells how many observations of session {} were detected behind "
          "number "
          "{}, when the {}",
          stream->stream.camera, stream->stream.session_id, stream->end_seq - 1,
          stream->is_of_other_boot ? "computer stopped" : "agent ended");
    }
    while (!stream->segments.empty() &&
           stream->segments.front().end_seq <= stream->durable_seq + 1) {
      result_.doomed.push_back(std::move(stream->segments.front()));
      stream->segments.pop_front();
    }
    stream->first_seq =
        stream->segments.empty() ? stream->end_seq : stream->segments.front().first_seq;
    stream->CountRows();
    return absl::OkStatus();
  }

  void Keep(DiskStream stream) {
    const StreamKey key = stream.stream;
    const auto [place, inserted] = result_.streams.try_emplace(key);
    // Discarded and opened again, with a checkpoint from before: the newer one counts.
    DiskStream& older = place->second;
    if (!inserted) {
      if (older.number > stream.number) std::swap(older, stream);
      for (Segment& segment : older.segments) result_.doomed.push_back(std::move(segment));
    }
    older = std::move(stream);
  }

  FileSystem& files_;
  const std::string& folder_;
  const StreamEnds& ends_;
  const uint64_t boot_;
  uint32_t discarded_up_to_ = 0;
  std::map<uint32_t, DiskStream> by_number_;  // of the checkpoint
  std::map<uint32_t, std::vector<FoundSegment>> segments_;
  RecoveredSpool result_;
};

}  // namespace

absl::StatusOr<RecoveredSpool> RecoverSpool(FileSystem& files, const std::string& folder,
                                            const StreamEnds& ends, uint64_t boot) {
  return Recovery(files, folder, ends, boot).Run();
}

}  // namespace rigcal::agent
