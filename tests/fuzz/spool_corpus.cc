// SPDX-License-Identifier: Apache-2.0
#include "tests/fuzz/spool_corpus.h"

#include <fstream>
#include <initializer_list>
#include <string>
#include <system_error>

#include "agent/spool/disk/checkpoint.h"
#include "agent/spool/disk/segment_format.h"

namespace rigcal::agent {
namespace {

bool SaveText(const std::filesystem::path& folder, const std::string& name,
              const std::string& bytes) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  std::ofstream file(folder / name, std::ios::binary);
  file << bytes;
  file.close();
  return static_cast<bool>(file);
}

Observation Row(int64_t time_ns, uint32_t clock_epoch) {
  Observation row;
  row.time_ns = time_ns;
  row.clock_epoch = clock_epoch;
  row.markers.resize(2);
  row.markers[0].visible = true;
  row.markers[0].centre_px = {10, 20};
  return row;
}

std::string Records(uint32_t first, uint32_t last) {
  std::string bytes;
  for (uint32_t seq = first; seq <= last; ++seq) EncodeRecord(seq, Row(seq, seq / 4), {}, &bytes);
  return bytes;
}

// A record as mode 2 of the target takes it.
std::string Piece(uint16_t seq, const std::string& payload) {
  std::string bytes = {static_cast<char>(seq & 255), static_cast<char>(seq >> 8),
                       static_cast<char>(payload.size())};
  return bytes + payload;
}

std::string PayloadOf(uint32_t seq) { return Records(seq, seq).substr(kRecordPrefixBytes); }

bool SaveSegments(const std::filesystem::path& folder) {
  const std::string records = Records(1, 12);
  std::string damaged = records;
  damaged[100] = static_cast<char>(damaged[100] ^ 1);
  bool ok = SaveText(folder, "good", "\x01" + records);
  ok &= SaveText(folder, "with_another_behind", "\x05" + records);
  ok &= SaveText(folder, "flipped_bit", "\x01" + damaged);
  ok &= SaveText(folder, "cut", "\x01" + records.substr(0, records.size() - 20));
  ok &= SaveText(folder, "no_header", std::string(1, '\0') + records);
  ok &= SaveText(folder, "zeros", "\x01" + Records(1, 3) + std::string(200, '\0') + Records(6, 8));
  std::string pieces = "\x03";
  for (const uint16_t seq : std::initializer_list<uint16_t>{1, 2, 2, 9, 5, 10})
    pieces += Piece(seq, PayloadOf(seq));
  ok &= SaveText(folder, "numbers_out_of_order", pieces);
  ok &= SaveText(folder, "payload_that_is_none", "\x07" + Piece(1, "abc") + Piece(2, PayloadOf(2)));
  return ok;
}

bool SaveCheckpoints(const std::filesystem::path& folder) {
  DiskStream stream;
  stream.stream = {"s-1", "left", 5};
  stream.number = 1;
  stream.marker_count = 2;
  stream.end_seq = 101;
  stream.durable_seq = 50;
  stream.synced_seq = 90;
  stream.AddGap(60, 70, RefusalReason::kSpoolFull);
  EndOfCapture& end = stream.end.emplace();
  end.last_seq = 100;
  end.report.refused.push_back({"left", RefusalReason::kCsvBadTime, 2, "f.csv:3"});
  end.report.frames.emplace();
  end.report.detections.emplace();
  SpoolCheckpoint checkpoint{.last_stream_number = 4, .last_ordinal = 9, .streams = {stream}};
  checkpoint.streams.push_back(stream);
  checkpoint.streams.back().number = 2;
  checkpoint.streams.back().end.reset();
  const std::string bytes = EncodeCheckpoint(checkpoint);
  bool ok = SaveText(folder, "whole", std::string(1, '\0') + bytes);
  ok &= SaveText(folder, "body", "\x01" + bytes.substr(16));
  ok &= SaveText(folder, "empty_spool", "\x01" + EncodeCheckpoint({}).substr(16));
  return SaveText(folder, "cut_body", "\x01" + bytes.substr(16, 60)) && ok;
}

}  // namespace

bool SaveSpool(const std::filesystem::path& corpus) {
  const bool segments = SaveSegments(corpus / "spool_segment");
  return SaveCheckpoints(corpus / "spool_checkpoint") && segments;
}

}  // namespace rigcal::agent
